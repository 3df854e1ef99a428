"""The residual over time, against what it may depend on, and by channel, without and with the named causes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from discrepancy.result.residual_statistics import binned, running_rms, spectrum
from discrepancy.result.traces import Group, Trace, groups
from mocobot_report.blocks.blocks import Entry, paragraph, section, table, tabs, value, verdict
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import (
    Json,
    Key,
    axis,
    chart,
    layout,
    log_axis,
    numbers,
    paint,
    shared_legend,
)
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import fitting
from mocobot_report.blocks.series import Line, Panel, height, runs, stacked, thinned
from mocobot_report.blocks.units import QUANTITIES
from mocobot_report.folder import Diagnosed

Array = NDArray[np.float64]
COLOURS = ("c1", "c2", "c3")
BEFORE, AFTER = (
    Key("before", "as simulated", "before"),
    Key("after", "with the causes and tolerances", "after"),
)
TOLERATED = Key("after", "with tolerances", "after")
CLEAN = Key("", "clean data", "text", "dash")
BAND = Key("", "±2 standard deviations of clean data", "band", "band")
LOG_FROM = 8.0
"""Multiples of clean noise above which an axis is logarithmic."""


def residual_sections(book: Book, diagnosed: Diagnosed, names: Sequence[str]) -> list[Node]:
    """Sections made of ``residuals.npz``; without it, what is missing."""
    if not diagnosed.traces:
        said = (
            "residuals.npz is not in the folder, so there are no plots over time; diagnose again to get it."
        )
        return [section(book, "Residuals", verdict("warn", "No residuals", said))]
    grouped, named = groups(diagnosed.channels), bool(diagnosed.values["causes"])
    trials = []
    for trace, name in zip(diagnosed.traces, names, strict=True):
        book.say(f"residuals of {name}")
        trials.append((name, _over_time(book, trace, name, grouped, named=named)))
    note = paragraph(
        "Recorded minus simulated, in physical units and in multiples of what clean data of these "
        "sensors would leave: 1 is "
        "clean. Zooming one plot in time zooms those above and below.",
        kind="note",
    )
    return [
        section(
            book,
            "Residuals over time",
            note,
            *tabs(book, "Trial", trials),
            _rms(diagnosed, grouped, named=named),
        ),
        section(book, "What the residual depends on", *_against(book, diagnosed, grouped, named=named)),
    ]


def _over_time(book: Book, trace: Trace, name: str, grouped: Sequence[Group], *, named: bool) -> Node:
    run = runs(trace.time[: trace.moving], 1.0 / trace.rate_hz)
    most = max((len(group.columns) for group in grouped), default=1)
    keys = [Key(f"c{k + 1}", "", COLOURS[k % 3]) for k in range(most)]
    labels = {
        k: group.components[k]
        for group in grouped
        for k in range(len(group.columns))
        if len(group.columns) > 1
    }
    keys = [Key(key.group, labels.get(k, "value"), key.colour) for k, key in enumerate(keys)]
    views = [("as simulated", trace.before)]
    views += [("with the named causes", trace.after)] if named else []
    limits = [
        _limits(trace.before[:, list(group.columns)], trace.sigma[:, list(group.columns)])
        for group in grouped
    ]
    physical = [
        _physical(book, trace, name, label, values, grouped, keys, limits, run, named=named)
        for label, values in views
    ]
    multiples = _multiples(book, trace, name, grouped, run, named=named)
    if not named:
        return el("div", *physical, multiples, class_="pair")
    panels = [
        ("in physical units", el("div", *physical, class_="pair")),
        ("in multiples of clean noise", multiples),
    ]
    return el("div", *tabs(book, "Shown", panels))


def _limits(values: Array, sigma: Array) -> float:
    return float(max(np.abs(values).max(initial=0.0), 2.5 * sigma.max(initial=0.0))) * 1.05 or 1.0


def _physical(
    book: Book, trace: Trace, name: str, label: str, values: Array, grouped: Sequence[Group], keys: Sequence[Key],
    limits: Sequence[float], run: Array, *, named: bool,
) -> Node:  # fmt: skip
    panels = []
    for group, limit in zip(grouped, limits, strict=True):
        unit, scale = fitting(group.unit, limit)
        columns = list(group.columns)
        time, shown = thinned(trace.time[: trace.moving], scale * values[: trace.moving, columns], run)
        lines = [Line(keys[k], time, shown[:, k]) for k in range(len(columns))]
        alone = slice(trace.moving, None)
        if trace.moving < len(trace.time):
            lines += [
                Line(keys[k], trace.time[alone], scale * values[alone, c], points=True)
                for k, c in enumerate(columns)
            ]
        band = 2.0 * scale * float(np.median(trace.sigma[:, columns].max(axis=1)))
        panels.append(Panel(group.name, unit, lines, (-scale * limit, scale * limit), band=band))
    legend = [*keys, BAND] if len(keys) > 1 else [BAND]
    title, note = (
        f"{name}: residual {label}",
        "same scale as simulated and with the causes" if named else None,
    )
    return chart(
        book, title, stacked(panels), height=height(panels), keys=legend, note=note,
        label=f"{title}, every group of channels over time; rms values are in the table below.",
    )  # fmt: skip


def _multiples(
    book: Book, trace: Trace, name: str, grouped: Sequence[Group], run: Array, *, named: bool
) -> Node:
    keys = (BEFORE, AFTER if named else TOLERATED)
    panels = []
    for group in grouped:
        lines, top = [], 1.0
        for key, white in zip(keys, (trace.white_before, trace.white_after), strict=True):
            square = np.mean(white[:, list(group.columns)] ** 2, axis=1)
            moving = running_rms(square[: trace.moving], trace.rate_hz)
            alone = np.sqrt(square[trace.moving :])
            top = max(top, float(moving.max(initial=0.0)), float(alone.max(initial=0.0)))
            time, shown = thinned(trace.time[: trace.moving], moving[:, None], run)
            lines.append(Line(key, time, shown[:, 0]))
            if len(alone):
                lines.append(Line(key, trace.time[trace.moving :], alone, points=True))
        log = top > LOG_FROM
        panels.append(
            Panel(
                group.name,
                "× clean",
                lines,
                (0.4, top) if log else (0.0, max(2.0, 1.1 * top)),
                rule=1.0,
                log=log,
            )
        )
    title = f"{name}: rms over 1 s in multiples of clean noise"
    return chart(
        book, title, stacked(panels), height=height(panels), keys=[*keys, CLEAN],
        note=None if named else "nothing is named",
        label=f"{title}, every group of channels over time.",
    )  # fmt: skip


def _roots(traces: Sequence[Trace], column: int) -> dict[str, float]:
    """Rms of one channel over all trials: as it is and whitened, before and after."""
    names = ("before", "after", "white_before", "white_after")
    together = {name: np.concatenate([getattr(t, name)[:, column] for t in traces]) for name in names}
    return {name: float(np.sqrt(np.mean(values**2))) for name, values in together.items()}


def _rms(diagnosed: Diagnosed, grouped: Sequence[Group], *, named: bool) -> Node:
    """Physical and whitened rms of every channel, over all trials."""
    rows: list[list[Entry]] = []
    for group in grouped:
        roots = [_roots(diagnosed.traces, column) for column in group.columns]
        unit, scale = fitting(group.unit, max(root["before"] for root in roots))
        for k, (root, component) in enumerate(zip(roots, group.components, strict=True)):
            physical = [scale * root["before"], scale * root["after"]][: 1 + named]
            rows.append(
                [group.name if k == 0 else "", component if len(roots) > 1 else "", unit,
                 *(value(v) for v in physical), value(root["white_before"]), value(root["white_after"])]
            )  # fmt: skip
    head = ["channel", "", "unit", *(["before", "after"] if named else ["rms"])]
    head += ["before [× clean]", ("after" if named else "within tolerances") + " [× clean]"]
    return table("Rms of the residual over all trials", head, rows, groups=True, headers=2)


def _against(book: Book, diagnosed: Diagnosed, grouped: Sequence[Group], *, named: bool) -> list[Node]:
    traces = diagnosed.traces
    book.say("dependence of the residual")
    panels = []
    for quantity in traces[0].quantities:
        unit = QUANTITIES.get(quantity, "")
        label = f"{quantity} [{unit}]" if unit else quantity
        charts = [_dependence(book, traces, group, quantity, label, named=named) for group in grouped]
        legend = shared_legend([BEFORE, AFTER if named else TOLERATED, CLEAN])
        panels.append((quantity, [legend, el("div", *charts, class_="trio")]))
    charts = [_dependence(book, traces, group, None, "frequency [Hz]", named=named) for group in grouped]
    legend = shared_legend([BEFORE, AFTER if named else TOLERATED, CLEAN])
    panels.append(("frequency", [legend, el("div", *charts, class_="trio")]))
    note = paragraph(
        "Whitened rms in multiples of clean data, all trials together: in bins of equal counts "
        "against speed, position, load "
        "and the like; against frequency as a spectrum. What rises with load is elastic, what "
        "rises with speed rubs, a "
        "peak is something that swings.",
        kind="note",
    )
    return [note, *tabs(book, "Against", panels)]


def _dependence(
    book: Book, traces: Sequence[Trace], group: Group, quantity: str | None, label: str, *, named: bool
) -> Node:
    keys = (BEFORE, AFTER if named else TOLERATED)
    data: list[Json] = []
    top, low = 1.0, 1.0
    for key, attribute in zip(keys, ("white_before", "white_after"), strict=True):
        columns = list(group.columns)
        found = (
            spectrum(traces, attribute, columns)
            if quantity is None
            else binned(traces, attribute, columns, quantity)
        )
        if found is None:
            continue
        x, y = found
        top, low = max(top, float(y.max())), min(low, float(y.min()))
        data.append(
            {
                "type": "scatter", "mode": "lines" if quantity is None else "lines+markers", "x": numbers(x),
                "y": numbers(y), "name": key.label, "legendgroup": key.group,
                "line": {"color": paint(key.colour), "width": 1.6}, "marker": {"color": paint(key.colour), "size": 5},
                "hovertemplate": f"{key.label}<br>%{{x:.3g}}: %{{y:.3g}} × clean<extra></extra>",
            }
        )  # fmt: skip
    vertical = (
        log_axis("× clean", max(low, 0.05), top)
        if top > LOG_FROM
        else axis("× clean", range=[0.0, max(2.0, 1.12 * top)], zeroline=False, nticks=5)
    )
    figure: Json = {
        "data": data,
        "layout": layout(
            xaxis=axis(label, zeroline=False, nticks=6),
            yaxis=vertical,
            shapes=[
                {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "yref": "y", "y0": 1.0, "y1": 1.0,
                 "line": {"color": paint("text"), "width": 1, "dash": "dash"}}
            ],
            margin={"l": 52, "r": 10, "t": 8, "b": 42},
        ),
    }  # fmt: skip
    what = label.split(" [")[0]
    return chart(
        book, f"{group.name} against {what}", figure, height=210,
        label=f"Whitened rms of {group.name} against {what}, before and after.",
    )  # fmt: skip
