"""Where the misfit sits: by channel, by trial and along the directions of single sources; and the evidence."""

from collections.abc import Mapping, Sequence
from typing import Any

import plotly.graph_objects as go

from discrepancy.result.evidence_list import drawn, label, relation
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.charts import Axis, axis, chart, dots, figure, log_axis, row_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.numbers import percent, plain
from mocobot_report.blocks.prose import paragraph, tidy
from mocobot_report.diagnosis.keys import CLEAN, misfits
from mocobot_report.folder import Diagnosed

Values = Mapping[str, Any]
NATS = "evidence [nats]"
NEEDED = Key("needed", "needed to be named", "text", "circle-open")
RELATIONS = (
    Key("named", "named", "before", "square"),
    Key("family", "same family", "after", "circle"),
    Key("other", "other", "paper", "diamond"),
)


def evidence_sections(book: Book, diagnosed: Diagnosed, names: Sequence[str]) -> list[Node]:
    """Misfit by place, and the evidence for the strongest candidates."""
    values = diagnosed.values
    keys = misfits(named=bool(values["causes"]))
    nominal, left = values["residual"]["nominal"]["signature"], values["residual"]["signature"]
    charts = []
    if nominal.get("channel") and left.get("channel"):
        charts.append(_misfit(book, "Misfit by channel", (nominal["channel"], left["channel"]), {}, keys))
    if nominal.get("trial") and left.get("trial") and len(nominal["trial"]) > 1:
        shown = dict(zip(values["recordings"], names, strict=True))
        charts.append(_misfit(book, "Misfit by trial", (nominal["trial"], left["trial"]), shown, keys))
    if nominal.get("along"):
        charts.append(_along(book, "Where the misfit as simulated points", nominal["along"], "before"))
    if left.get("along") and values["verdict"] != "consistent":
        charts.append(_along(book, "Where what is left points", left["along"], "after"))
    said = f"As simulated: {tidy(nominal['sentence'], inside=True)}"
    return [*_section(book, "Where the misfit sits", said, charts), *_strongest_sections(book, values)]


def _section(book: Book, title: str, said: str, charts: Sequence[Node]) -> list[Node]:
    if not charts:
        return []
    return [section(book, title, paragraph(said, kind="note"), el("div", *charts, class_="pair"))]


def _misfit(
    book: Book, title: str, both: Sequence[Values], shown: Mapping[str, str], keys: Sequence[Key]
) -> Node:
    """chi2/n of every channel or trial, before and after."""
    rows = list(both[0])
    names = [shown.get(row, row) for row in rows]
    traces, seen = [], [1.0]
    for key, values in zip(keys, both, strict=True):
        numbers = [values.get(row) for row in rows]
        seen += numbers
        text = [f"{name}, {key.label}: {plain(v)}" for name, v in zip(names, numbers, strict=True)]
        traces.append(dots(numbers, range(len(rows)), key, text))
    label = f"{title}: chi-square per number, before and after, one row each."
    across = log_axis("chi²/n", seen)
    return _rows_chart(book, title, traces, names, across, label, rule=1.0, keys=[*keys, CLEAN])


def _along(book: Book, title: str, shares: Values, colour: str) -> Node:
    """Share of the squared residual along single sources."""
    names, shown = list(shares), [100.0 * v for v in shares.values()]
    bars = go.Bar(
        x=shown, y=list(range(len(names))), orientation="h", width=0.62, meta=colour, cliponaxis=False,
        text=[percent(v) for v in shares.values()], textposition="auto", insidetextanchor="end",
        hovertemplate="%{text}<extra></extra>",
    )  # fmt: skip
    across = axis("share of the misfit [%]", range=[0, 1.14 * max(shown)], nticks=5)
    said = ", ".join(f"{name} {percent(v)}" for name, v in shares.items())
    label = f"{title}: share of the squared residual along single sources: {said}"
    note = "share of the squared residual along what one source alone can do; sources overlap, so shares do not add up"
    return _rows_chart(book, title, [bars], names, across, label, row_px=30, note=note)


def _rows_chart(
    book: Book, title: str, traces: Sequence[go.Scatter | go.Bar], names: Sequence[str], across: Axis, label: str, *,
    rule: float | None = None, row_px: int = 24, left_px: int = 120, most: int = 26, font_px: int = 10, **more: Any,
) -> Node:  # fmt: skip
    """One row per name, of up to ``most`` letters in ``left_px`` pixels; a dashed line at ``rule``."""
    shown = figure(traces, xaxis=across, yaxis=row_axis(names, most), margin_l=left_px)
    if rule is not None:
        shown.add_vline(rule)
    narrow = {"yaxis.tickfont.size": font_px, "margin.l": min(left_px, 155)}
    return chart(book, title, shown, height=row_px * len(names) + 76, label=label, narrow=narrow, **more)


def _strongest_sections(book: Book, values: Values) -> list[Node]:
    """The evidence for the strongest candidates, before and after what is named is in the model."""
    evidence = values["evidence"]
    panels = {"Nothing is named yet": evidence["before"], "What is named is in the model": evidence["after"]}
    worth = {title: drawn(entries or []) for title, entries in panels.items()}
    seen = [entry[key] for entries in worth.values() for entry in entries for key in ("nats", "needed")]
    charts = [
        _strongest(book, title, entries, values["causes"], log_axis(NATS, seen))
        for title, entries in worth.items()
        if entries
    ]
    said = (
        "By how much the recordings are likelier if a cause is there besides what is in the model, in nats, for the "
        "strongest candidates; what is there leaves a mark in its relatives, too. Rings: what it takes to be named. "
        + ("Both plots have the same logarithmic scale." if len(charts) > 1 else "The scale is logarithmic.")
    )
    return _section(book, "Evidence", said, charts)


def _strongest(
    book: Book, title: str, entries: Sequence[Values], causes: Sequence[Values], across: Axis
) -> Node:
    names, nats = [label(entry) for entry in entries], [entry["nats"] for entry in entries]
    needed = [entry["needed"] for entry in entries]
    rings = [f"{name}: named from {plain(n, 2)} nats" for name, n in zip(names, needed, strict=True)]
    traces, keys = [dots(needed, range(len(names)), NEEDED, rings, size=7)], []
    for key in RELATIONS if causes else RELATIONS[-1:]:
        rows = [k for k, entry in enumerate(entries) if not causes or relation(entry, causes) == key.group]
        if rows:
            keys.append(key)
            text = [f"{names[k]}: {plain(nats[k])} nats, named from {plain(needed[k], 2)}" for k in rows]
            traces.append(dots([nats[k] for k in rows], rows, key, text))
    said = ", ".join(f"{name} {plain(n)}" for name, n in zip(names, nats, strict=True))
    return _rows_chart(
        book, title, traces, names, across, f"{title}: evidence of the strongest candidates in nats, {said}",
        left_px=190, most=40, font_px=9, keys=[*keys, NEEDED] if causes else [NEEDED],
    )  # fmt: skip
