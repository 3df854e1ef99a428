"""Where the misfit sits: by channel, by trial and along the directions of single sources; and the evidence."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

from mocobot_report.blocks import paragraph, section, spelled_text, tidy
from mocobot_report.book import Book
from mocobot_report.charts import Json, Key, axis, chart, dots, layout, literal, log_axis, paint
from mocobot_report.folder import Diagnosed
from mocobot_report.html import Node, el
from mocobot_report.numbers import percent, plain

Values = Mapping[str, Any]
BEFORE = Key("before", "as simulated", "before", "square")
AFTER = Key("after", "with causes and tolerances", "after", "circle")
TOLERATED = Key("after", "with tolerances", "after", "circle")
CLEAN = Key("", "clean data", "text", "dash")


def evidence_sections(book: Book, diagnosed: Diagnosed, names: Sequence[str]) -> list[Node]:
    """Misfit by place, and the evidence for the strongest candidates."""
    values = diagnosed.values
    keys = (BEFORE, AFTER if values["causes"] else TOLERATED)
    nominal, left = values["residual"]["nominal"]["signature"], values["residual"]["signature"]
    charts: list[Node] = []
    if nominal.get("channel") and left.get("channel"):
        charts.append(_misfit(book, "Misfit by channel", nominal["channel"], left["channel"], None, keys))
    if nominal.get("trial") and left.get("trial") and len(nominal["trial"]) > 1:
        shown = dict(zip(values["recordings"], names, strict=True))
        charts.append(_misfit(book, "Misfit by trial", nominal["trial"], left["trial"], shown, keys))
    if nominal.get("along"):
        charts.append(_along(book, "Where the misfit as simulated points", nominal["along"], "before"))
    if left.get("along") and values["verdict"] != "consistent":
        charts.append(_along(book, "Where what is left points", left["along"], "after"))
    said = paragraph(f"As simulated: {tidy(nominal['sentence'], inside=True)}", kind="note")
    out = [section(book, "Where the misfit sits", said, el("div", *charts, class_="pair"))] if charts else []
    return [*out, *_map(book, diagnosed)]


def _misfit(
    book: Book,
    title: str,
    before: Values,
    after: Values,
    shown: Mapping[str, str] | None,
    keys: Sequence[Key],
) -> Node:
    """chi2/n of every channel or trial, before and after."""
    rows = list(before)
    data, seen = [], [1.0]
    for key, values in zip(keys, (before, after), strict=True):
        numbers = [values.get(name) for name in rows]
        seen += [v for v in numbers if v]
        text = [
            f"{(shown or {}).get(n, n)}, {key.label}: {plain(v)}" for n, v in zip(rows, numbers, strict=True)
        ]
        trace = dots([], [], key, text=text) | {"x": numbers, "y": list(range(len(rows)))[::-1]}
        data.append(trace)
    names = [(shown or {}).get(name, name) for name in rows]
    figure: Json = {
        "data": data,
        "layout": _sideways(names, log_axis("chi²/n", min(seen), max(seen)), rule=1.0),
        "narrow": {"yaxis.tickfont.size": 10},
    }
    return chart(
        book, title, figure, height=24 * len(rows) + 76, keys=[*keys, CLEAN],
        label=f"{title}: chi-square per number, before and after, one row each.",
    )  # fmt: skip


def _along(book: Book, title: str, shares: Values, colour: str) -> Node:
    """Share of the squared residual along single sources."""
    names = list(shares)
    key = Key("share", "", colour)
    data = [
        {
            "type": "bar", "orientation": "h", "x": [100.0 * v for v in shares.values()],
            "y": list(range(len(names)))[::-1], "marker": {"color": paint(key.colour)}, "width": 0.62,
            "text": [percent(v) for v in shares.values()], "textposition": "auto", "insidetextanchor": "end",
            "insidetextfont": {"color": paint("card")}, "outsidetextfont": {"color": paint("text")},
            "cliponaxis": False,
            "hovertemplate": "%{text}<extra></extra>",
        }
    ]  # fmt: skip
    top = max([100.0 * v for v in shares.values()], default=1.0)
    figure: Json = {
        "data": data,
        "layout": _sideways(names, axis("share of the misfit [%]", range=[0, 1.14 * top], nticks=5)),
        "narrow": {"yaxis.tickfont.size": 10},
    }
    return chart(
        book, title, figure, height=30 * len(names) + 66,
        label=f"{title}: share of the squared residual along single sources: "
        + ", ".join(f"{name} {percent(v)}" for name, v in shares.items()),
        note="share of the squared residual along what one source alone can do",
    )  # fmt: skip


def _sideways(names: Sequence[str], horizontal: Json, rule: float | None = None) -> Json:
    lines = [] if rule is None else [
        {"type": "line", "xref": "x", "x0": rule, "x1": rule, "yref": "paper", "y0": 0, "y1": 1,
         "line": {"color": paint("text"), "width": 1.2, "dash": "dash"}}
    ]  # fmt: skip
    count = len(names)
    return layout(
        xaxis=horizontal,
        yaxis=axis(
            tickvals=list(range(count))[::-1], ticktext=[literal(name, 26) for name in names],
            range=[-0.6, count - 0.4], zeroline=False, fixedrange=True, ticks="",
        ),
        shapes=lines,
        margin={"l": 120, "r": 14, "t": 8, "b": 44},
    )  # fmt: skip


def _map(book: Book, diagnosed: Diagnosed) -> list[Node]:
    """The evidence for the strongest candidates, as the diagnosis drew it."""
    path = diagnosed.folder / "evidence.png"
    try:
        drawn = path.read_bytes()
    except OSError:
        return []
    if not drawn.startswith(b"\x89PNG"):
        return []
    source = "data:image/png;base64," + base64.b64encode(drawn).decode("ascii")
    alt = (
        "Bar charts of the strongest candidates: gain of chi-square of each cause at its place, "
        "before and after what is "
        "named is in the model. Names and numbers of close rivals are in the table of alternatives."
    )
    figure = el(
        "figure",
        el("figcaption", el("b", spelled_text("Evidence for the strongest candidates")),
           "how much chi-square falls if the cause leaves its tolerance; dashed: what chance can do"),
        el("img", src=source, alt=alt, loading="lazy"),
        class_="picture",
    )  # fmt: skip
    return [section(book, "Evidence", figure)]
