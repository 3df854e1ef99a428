"""Plots of the paper's tables: our errors beside the published ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle, groupby

import numpy as np

from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks import palette
from mocobot_report.blocks.blocks import spelled_text
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import Json, Key, axis, chart, dots, layout, log_axis, paint
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.numbers import PLUS_MINUS, plain
from mocobot_sim.paper.published import payload_truth
from mocobot_sim.paper.tables import MOMENTS, PaperTable, Row

LEAST = 1e-7
"""Errors below this share of a unit are drawn at it: a logarithmic axis has no zero."""
SPREAD = 0.16


def keys(columns: Sequence[str]) -> list[Key]:
    """Legend of the paper's column and the presets'; presets that nobody knows yet get what is left."""
    left = zip(cycle(palette.OTHER_COLOURS), cycle(palette.OTHER_MARKERS))
    return [
        Key(name, name, name, palette.PRESETS[name])
        if name in palette.PRESETS
        else Key(name, name, *next(left))
        for name in columns
    ]


def table_chart(book: Book, table: PaperTable, title: str, note: str) -> Node:
    """One column per row of a table of one unit, one dot per preset; whiskers reach up by the spread."""
    legend, rows = keys(table.columns), table.rows
    unit, data, seen = rows[0].unit, [], []
    for k, key in enumerate(legend):
        at = [n + SPREAD * (k - (len(legend) - 1) / 2) for n in range(len(rows))]
        cells = [row.cells[k] for row in rows]
        values = [None if c.value is None else max(c.value, LEAST) for c in cells]
        seen += [v + (c.spread or 0.0) for v, c in zip(values, cells, strict=True) if v is not None]
        seen += [v for v in values if v is not None]
        text = [
            f"{key.label}, payload ({row.payload}), {row.quantity}: {plain(c.value)}"
            + ("" if c.spread is None else f" {PLUS_MINUS} {plain(c.spread, 2)}")
            + f" {spelled_text(f'[{unit}]')}"
            for row, c in zip(rows, cells, strict=True)
        ]
        data.append(dots(at, values, key, up=[c.spread for c in cells], text=text))
    figure: Json = {
        "data": data,
        "layout": layout(
            xaxis=_columns(rows),
            yaxis=log_axis(f"error [{unit}]", min(seen, default=1e-3), max(seen, default=1.0)),
            shapes=_bands(rows),
            margin={"l": 58, "r": 10, "t": 8, "b": 40},
        ),
        "narrow": {"margin.l": 46, "xaxis.tickfont.size": 9},
    }
    label = f"{title}. The numbers are in Table {table.number} below."
    return chart(book, title, figure, height=330, label=label, keys=legend, note=note)


def _columns(rows: Sequence[Row]) -> Json:
    """Ticks that name the quantity, and the payload once per group."""
    names = []
    for _, group in groupby(rows, key=lambda row: row.payload):
        each = list(group)
        for k, row in enumerate(each):
            head = f"({row.payload})" if k == len(each) // 2 or len(each) == 1 else ""
            names.append(f"{row.quantity}<br><b>{head}</b>" if len(each) > 1 else f"<b>{head}</b>")
    return axis(
        tickvals=list(range(len(rows))), ticktext=names, range=[-0.6, len(rows) - 0.4], showgrid=False, zeroline=False,
        tickangle=0, fixedrange=True, ticklabelstep=1,
    )  # fmt: skip


def _bands(rows: Sequence[Row]) -> list[Json]:
    """Every second payload on a shade."""
    shapes, start = [], 0
    for k, (_, group) in enumerate(groupby(rows, key=lambda row: row.payload)):
        end = start + len(list(group))
        if k % 2:
            shapes.append(
                {"type": "rect", "xref": "x", "yref": "paper", "x0": start - 0.5, "x1": end - 0.5, "y0": 0, "y1": 1,
                 "fillcolor": paint("sunk"), "line": {"width": 0}, "layer": "below"}
            )  # fmt: skip
        start = end
    return shapes


def summary_chart(book: Book, table: PaperTable) -> Node:
    """The largest errors in percent or degrees, one line per quantity."""
    rows = [row for row in table.rows if row.unit in ("%", "deg")][::-1]
    legend, data, seen = keys(table.columns), [], []
    for k, key in enumerate(legend):
        values = [row.cells[k].value for row in rows]
        shown = [None if v is None else max(v, LEAST) for v in values]
        seen += [v for v in shown if v is not None]
        text = [
            f"{key.label}, {row.quantity}: {plain(v)} {row.unit}" for row, v in zip(rows, values, strict=True)
        ]
        trace = dots([], [], key, text=text, size=11)
        trace |= {"x": shown, "y": list(range(len(rows)))}
        data.append(trace)
    names = [f"{row.quantity} [{row.unit}]" for row in rows]
    figure: Json = {
        "data": data,
        "layout": layout(
            xaxis=log_axis(
                "largest error over the payloads", min(seen, default=1e-3), max(seen, default=1.0)
            ),
            yaxis=axis(
                tickvals=list(range(len(rows))), ticktext=names, range=[-0.6, len(rows) - 0.4], zeroline=False,
                fixedrange=True,
            ),
            margin={"l": 150, "r": 14, "t": 8, "b": 44},
        ),
        "narrow": {"yaxis.tickfont.size": 10},
    }  # fmt: skip
    return chart(
        book, "Largest errors at a glance", figure, height=300, keys=legend,
        label="Largest error of every quantity, the paper's beside ours; the numbers are in the first table.",
    )  # fmt: skip


def trial_chart(book: Book, estimates: Mapping[tuple[str, str], PayloadEstimate]) -> Node | None:
    """Errors of the principal moments from every single recording."""
    payloads = list(dict.fromkeys(payload for payload, _ in estimates))
    presets = list(dict.fromkeys(preset for _, preset in estimates))
    rows = [Row(payload, name, "%", ()) for payload in payloads for name in MOMENTS]
    data, seen = [], []
    legend = keys(presets)
    for p, key in enumerate(legend):
        x, y, text = [], [], []
        for k, payload in enumerate(payloads):
            if (estimate := estimates.get((payload, key.group))) is None:
                continue
            truth = payload_truth(payload).principal_moments
            for recording in estimate.recordings:
                if recording.inertia is None:
                    continue
                share = 100.0 * np.abs(recording.inertia.principal.moments / truth - 1.0)
                x += [3 * k + m + 0.22 * (p - (len(legend) - 1) / 2) for m in range(3)]
                y += [max(float(s), LEAST) for s in share]
                text += [
                    f"{key.label}, payload ({payload}), {recording.trial} trial, {name}: {plain(float(s))} %"
                    for name, s in zip(MOMENTS, share, strict=True)
                ]
        seen += y
        data.append(dots(x, y, key, text=text, size=7, opacity=0.8))
    if not seen:
        return None
    figure: Json = {
        "data": data,
        "layout": layout(
            xaxis=_columns(rows),
            yaxis=log_axis("|error| [%]", min(seen), max(seen)),
            shapes=_bands(rows),
            margin={"l": 58, "r": 10, "t": 8, "b": 40},
        ),
        "narrow": {"margin.l": 46, "xaxis.tickfont.size": 9},
    }
    return chart(
        book, "Principal moments from every trial on its own", figure, height=330, keys=legend,
        label="Relative error of the principal moments of inertia that each recording alone gives.",
        note="one dot per recording with motion; Table V averages them with their signs",
    )  # fmt: skip
