"""Plots of the paper's tables: our errors beside the published ones."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle, groupby

import numpy as np
import plotly.graph_objects as go

from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks import palette
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import chart, column_axis, dots, figure, log_axis, row_axis
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.numbers import PLUS_MINUS, plain
from mocobot_report.blocks.units import spelled_text
from mocobot_sim.paper.fits import ONE_FIT, SELF_CALIBRATED, TRANSFER
from mocobot_sim.paper.published import payload_truth
from mocobot_sim.paper.tables import MOMENTS, PaperTable

FITS = {
    ONE_FIT: ("nominal", "circle-open"), SELF_CALIBRATED: ("c1", "triangle-up"), TRANSFER: ("c1", "triangle-up-open"),
}  # fmt: skip
"""Colour and marker of each column of fits."""
LEAST = 1e-7
"""Errors below this share of a unit are drawn at it: a logarithmic axis has no zero."""
NARROW = {"margin.l": 46, "xaxis.tickfont.size": 9}


def keys(columns: Sequence[str]) -> list[Key]:
    """Legend of the paper's column, the presets' and the fits'; presets that nobody knows yet get what is left."""
    left = zip(cycle(palette.OTHER_COLOURS), cycle(palette.OTHER_MARKERS))
    known = {name: (name, marker) for name, marker in palette.PRESETS.items()} | FITS
    return [Key(name, name, *(known[name] if name in known else next(left))) for name in columns]


def table_chart(book: Book, table: PaperTable, title: str, note: str) -> Node:
    """One column per row of a table of one unit, one dot per preset; whiskers reach up by the spread."""
    legend, rows, unit = keys(table.columns), table.rows, spelled_text(f"[{table.rows[0].unit}]")
    traces, seen = [], []
    for k, key in enumerate(legend):
        cells = [row.cells[k] for row in rows]
        values, spreads = [_drawn(c.value) for c in cells], [c.spread or 0.0 for c in cells]
        seen += [
            v + s for v, spread in zip(values, spreads, strict=True) if v is not None for s in (0.0, spread)
        ]
        text = [
            f"{key.label}, payload ({row.payload}), {row.quantity}: {plain(c.value)}"
            + ("" if c.spread is None else f" {PLUS_MINUS} {plain(c.spread, 2)}")
            + f" {unit}"
            for row, c in zip(rows, cells, strict=True)
        ]
        # Downward a whisker has no meaning on a logarithmic axis.
        up = (
            {"array": spreads, "arrayminus": [0.0] * len(rows), "thickness": 1.3, "width": 3}
            if any(spreads)
            else None
        )
        traces.append(
            dots(
                [n + _aside(k, legend, min(0.16, 0.85 / len(legend))) for n in range(len(rows))],
                values,
                key,
                text,
                error_y=up,
            )
        )
    shown = _by_payload(traces, [(row.payload, row.quantity) for row in rows], f"error {unit}", seen)
    label = f"{title}. The numbers are in Table {table.number} below."
    return chart(book, title, shown, height=330, label=label, keys=legend, note=note, narrow=NARROW)


def summary_chart(book: Book, table: PaperTable) -> Node:
    """The largest errors in percent or degrees, one line per quantity."""
    rows = [row for row in table.rows if row.unit in ("%", "deg")]
    names = [f"{row.quantity} [{row.unit}]" + (f", {row.frames}" if row.frames else "") for row in rows]
    wide = any(row.frames for row in rows)
    legend, traces, seen = keys(table.columns), [], []
    for k, key in enumerate(legend):
        values = [row.cells[k].value for row in rows]
        text = [f"{key.label}, {name}: {plain(v)}" for name, v in zip(names, values, strict=True)]
        traces.append(dots([*map(_drawn, values)], range(len(rows)), key, text, size=11))
        seen += map(_drawn, values)
    shown = figure(
        traces, xaxis=log_axis("largest error", seen),
        yaxis=row_axis(names, 40), margin_l=245 if wide else 150,
    )  # fmt: skip
    return chart(
        book, "Largest errors at a glance", shown, height=60 + 30 * len(rows), keys=legend,
        narrow={"yaxis.tickfont.size": 8 if wide else 10} | ({"margin.l": 165} if wide else {}),
        label="Largest error of every quantity, the paper's beside ours; the numbers are in the first table.",
    )  # fmt: skip


def trial_chart(book: Book, estimates: Mapping[tuple[str, str], PayloadEstimate]) -> Node | None:
    """Errors of the principal moments from every single recording."""
    payloads = list(dict.fromkeys(payload for payload, _ in estimates))
    legend, traces, seen = keys(list(dict.fromkeys(preset for _, preset in estimates))), [], []
    for p, key in enumerate(legend):
        x, y, text = [], [], []
        for k, payload in enumerate(payloads):
            truth = payload_truth(payload).principal_moments
            found = estimates.get((payload, key.group))
            for recording in () if found is None else found.recordings:
                if recording.inertia is None:
                    continue
                share = 100.0 * np.abs(recording.inertia.principal.moments / truth - 1.0)
                x += [3 * k + m + _aside(p, legend, 0.22) for m in range(3)]
                y += [_drawn(float(s)) for s in share]
                text += [
                    f"{key.label}, payload ({payload}), {recording.trial} trial, {name}: {plain(float(s))} %"
                    for name, s in zip(MOMENTS, share, strict=True)
                ]
        seen += y
        traces.append(dots(x, y, key, text, size=7, opacity=0.8))
    if not seen:
        return None
    columns = [(payload, name) for payload in payloads for name in MOMENTS]
    return chart(
        book, "Principal moments from every trial on its own", _by_payload(traces, columns, "|error| [%]", seen),
        height=330, keys=legend, narrow=NARROW,
        label="Relative error of the principal moments of inertia that each recording alone gives.",
        note="one dot per recording with motion; Table V averages them with their signs",
    )  # fmt: skip


def _drawn(value: float | None) -> float | None:
    return None if value is None else max(value, LEAST)


def _aside(k: int, legend: Sequence[Key], apart: float) -> float:
    """How far the dots of an entry of the legend stand from the middle of their column."""
    return apart * (k - (len(legend) - 1) / 2)


def _by_payload(
    traces: Sequence[go.Scatter], columns: Sequence[tuple[str, str]], title: str, seen: Iterable[float | None]
) -> go.Figure:
    """Columns of (payload, quantity) over a logarithmic axis: the payload named once, every second one shaded."""
    names, shaded = [], []
    for k, (payload, group) in enumerate(groupby(columns, key=lambda column: column[0])):
        each, start = list(group), len(names)
        for n, (_, quantity) in enumerate(each):
            head = f"<b>({payload})</b>" if n == len(each) // 2 else "<b></b>"
            names.append(f"{quantity}<br>{head}" if len(each) > 1 else head)
        shaded += [(start - 0.5, len(names) - 0.5)] if k % 2 else []
    shown = figure(traces, xaxis=column_axis(names), yaxis=log_axis(title, seen))
    for x0, x1 in shaded:
        shown.add_vrect(x0, x1, layer="below", line_width=0, opacity=0.5)
    return shown
