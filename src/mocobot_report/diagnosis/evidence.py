"""Where the misfit sits: by channel, by trial and along the directions of single sources; and the evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from discrepancy.result.evidence_list import label, relation
from mocobot_report.blocks.blocks import paragraph, section, tidy
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import Json, Key, axis, chart, dots, layout, literal, log_axis, paint
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import percent, plain
from mocobot_report.folder import Diagnosed

Values = Mapping[str, Any]
BEFORE = Key("before", "as simulated", "before", "square")
AFTER = Key("after", "with causes and tolerances", "after", "circle")
TOLERATED = Key("after", "with tolerances", "after", "circle")
CLEAN = Key("", "clean data", "text", "dash")
CHANCE = Key("", "what chance can do", "text", "dash")
RELATIONS = (
    Key("named", "named", "before", "square"),
    Key("family", "same family", "after", "circle"),
    Key("other", "other", "paper", "diamond"),
)


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
    return [*out, *_map(book, values)]


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


def _sideways(
    names: Sequence[str], horizontal: Json, rule: float | None = None, *, left: int = 120, most: int = 26
) -> Json:
    """Layout of one row per name; ``left`` pixels hold names of up to ``most`` letters."""
    lines = [] if rule is None else [
        {"type": "line", "xref": "x", "x0": rule, "x1": rule, "yref": "paper", "y0": 0, "y1": 1,
         "line": {"color": paint("text"), "width": 1.2, "dash": "dash"}}
    ]  # fmt: skip
    count = len(names)
    return layout(
        xaxis=horizontal,
        yaxis=axis(
            tickvals=list(range(count))[::-1], ticktext=[literal(name, most) for name in names],
            range=[-0.6, count - 0.4], zeroline=False, fixedrange=True, ticks="",
        ),
        shapes=lines,
        margin={"l": left, "r": 14, "t": 8, "b": 44},
    )  # fmt: skip


def _map(book: Book, values: Values) -> list[Node]:
    """The evidence for the strongest candidates, before and after what is named is in the model."""
    evidence = values.get("evidence")
    if not isinstance(evidence, Mapping):  # a diagnosis of an earlier version
        return []
    panels = [("Nothing is named yet", evidence["before"])]
    if evidence["after"] is not None:
        panels.append(("What is named is in the model", evidence["after"]))
    charts = [
        _strongest(book, title, entries, values["causes"], evidence["by_chance"])
        for title, entries in panels
        if entries
    ]
    said = paragraph(
        "How much chi-square falls if a cause leaves its tolerance, for the strongest candidates. Chance can do what "
        "is left of the dashed line.",
        kind="note",
    )
    return [section(book, "Evidence", said, el("div", *charts, class_="pair"))] if charts else []


def _strongest(
    book: Book, title: str, entries: Sequence[Values], causes: Sequence[Values], by_chance: float
) -> Node:
    names = [label(entry) for entry in entries]
    data, keys = [], []
    for key in RELATIONS if causes else RELATIONS[-1:]:
        rows = [k for k, entry in enumerate(entries) if not causes or relation(entry, causes) == key.group]
        if not rows:
            continue
        keys.append(key)
        text = [
            f"{names[k]}: gain {plain(entries[k]['gain'])}, by chance 10^{entries[k]['log10_p']:.0f}"
            for k in rows
        ]
        trace = dots([], [], key, text=text)
        data.append(
            trace
            | {"x": [max(entries[k]["gain"], 1.0) for k in rows], "y": [len(names) - 1 - k for k in rows]}
        )
    seen = [by_chance, 1.0, *(entry["gain"] for entry in entries)]
    figure: Json = {
        "data": data,
        "layout": _sideways(
            names, log_axis("gain of chi-square", 1.0, max(seen)), rule=by_chance, left=190, most=40
        ),
        "narrow": {"yaxis.tickfont.size": 9, "margin.l": 155},
    }
    return chart(
        book, title, figure, height=24 * len(names) + 76, keys=[*keys, CHANCE] if causes else [CHANCE],
        label=f"{title}: gain of chi-square of the strongest candidates, "
        + ", ".join(f"{name} {plain(entry['gain'])}" for name, entry in zip(names, entries, strict=True)),
    )  # fmt: skip
