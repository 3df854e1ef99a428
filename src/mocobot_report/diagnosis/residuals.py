"""The residual over time, against what it may depend on, and by channel, without and with the named causes."""

from collections.abc import Mapping, Sequence
from itertools import zip_longest

import numpy as np

from discrepancy.causes.units import Shown
from discrepancy.result.pictures.residual_statistics import binned, multiples, spectrum
from discrepancy.result.traces import Group, Trace, group_units, groups
from estimator.arrays import Array
from mocobot_report.blocks.book import Book, section, tabs
from mocobot_report.blocks.charts import axis, chart, figure, line, log_axis
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key, shared_legend
from mocobot_report.blocks.numbers import spelled
from mocobot_report.blocks.prose import paragraph, verdict
from mocobot_report.blocks.series import Line, Panel, runs, stacked_chart, thinned, with_breaks
from mocobot_report.blocks.tables import Entry, table, value
from mocobot_report.blocks.units import QUANTITIES
from mocobot_report.diagnosis.keys import CLEAN, misfits
from mocobot_report.folder import Diagnosed

BAND = Key("", "±2 standard deviations of clean data", "band", "band")
LOG_FROM = 8.0
"""Multiples of clean noise above which an axis is logarithmic."""


def residual_sections(book: Book, diagnosed: Diagnosed, names: Sequence[str]) -> list[Node]:
    """Sections made of ``residuals.npz``; without it, what is missing."""
    traces = diagnosed.traces
    if not traces:
        said = (
            "residuals.npz is not in the folder, so there are no plots over time; diagnose again to get it."
        )
        return [section(book, "Residuals", verdict("warn", "No residuals", said))]
    grouped, named = groups(diagnosed.channels), bool(diagnosed.values["causes"])
    units = group_units(traces, grouped)
    trials = []
    for trace, name in zip(traces, names, strict=True):
        book.say(f"residuals of {name}")
        trials.append((name, _over_time(book, trace, name, grouped, units, named=named)))
    note = (
        "Recorded minus simulated, in physical units and in multiples of what clean data of these sensors would leave: "
        "1 is clean. Zooming one plot in time zooms those above and below."
    )
    over_time = [
        paragraph(note, kind="note"),
        tabs(book, "Trial", trials),
        _rms(traces, grouped, units, named=named),
    ]
    against = _against(book, traces, grouped, misfits(named=named, lines=True))
    return [
        section(book, "Residuals over time", over_time),
        section(book, "What the residual depends on", against),
    ]


def _over_time(
    book: Book, trace: Trace, name: str, grouped: Sequence[Group], units: Mapping[str, Shown], *, named: bool
) -> Node:
    run = runs(trace.time[: trace.moving], 1.0 / trace.rate_hz)
    views = {"as simulated": trace.before} | ({"with the named causes": trace.after} if named else {})
    note = "same scale as simulated and with the causes" if named else None
    physical = [
        _physical(book, trace, f"{name}: residual {view}", values, grouped, units, run, note)
        for view, values in views.items()
    ]
    multiples = _multiples(book, trace, name, grouped, run, named=named)
    if not named:
        return el("div", *physical, multiples, class_="pair")
    panels = [
        ("in physical units", el("div", *physical, class_="pair")),
        ("in multiples of clean noise", multiples),
    ]
    return el("div", *tabs(book, "Shown", panels))


def _physical(
    book: Book,
    trace: Trace,
    title: str,
    values: Array,
    grouped: Sequence[Group],
    units: Mapping[str, Shown],
    run: Array,
    note: str | None,
) -> Node:
    # Each component is labelled as in the last group that has it; a group of one has no components.
    several = [group.components for group in grouped if len(group.columns) > 1]
    labels = [next(filter(None, each[::-1])) for each in zip_longest(*several)] or ["value"]
    keys = [Key(f"c{k + 1}", label, f"c{k % 3 + 1}") for k, label in enumerate(labels)]
    panels = []
    for group in grouped:
        columns = list(group.columns)
        limit = _limit(trace.before[:, columns], trace.sigma[:, columns])
        unit, scale = units[group.unit]
        lines = _lines(trace, scale * values[:, columns], keys, run)
        time, sigma = with_breaks(trace.time[: trace.moving], trace.sigma[: trace.moving, columns], run)
        band = (time, 2.0 * scale * sigma.max(axis=1)) if trace.moving else None
        panels.append(Panel(group.name, spelled(unit), lines, (-scale * limit, scale * limit), band=band))
    legend = [*keys, BAND] if len(keys) > 1 else [BAND]
    label = f"{title}, every group of channels over time; rms values are in the table below."
    return stacked_chart(book, title, panels, keys=legend, note=note, label=label)


def _limit(values: Array, sigma: Array) -> float:
    return float(max(np.abs(values).max(initial=0.0), 2.5 * sigma.max(initial=0.0))) * 1.05 or 1.0


def _lines(trace: Trace, values: Array, keys: Sequence[Key], run: Array) -> list[Line]:
    """Columns over time: the series as lines, means of holds as points."""
    n = trace.moving
    time, shown = thinned(trace.time[:n], values[:n], run)
    columns = range(values.shape[1])
    lines = [Line(keys[k], time, shown[:, k]) for k in columns]
    if n < len(trace.time):
        lines += [Line(keys[k], trace.time[n:], values[n:, k], points=True) for k in columns]
    return lines


def _multiples(
    book: Book, trace: Trace, name: str, grouped: Sequence[Group], run: Array, *, named: bool
) -> Node:
    keys = misfits(named=named, lines=True)
    panels = []
    for group in grouped:
        lines, top = [], 1.0
        for key, white in zip(keys, (trace.white_before, trace.white_after), strict=True):
            shown = multiples(trace, white, group.columns)
            top = max(top, float(shown.max(initial=0.0)))
            lines += _lines(trace, shown[:, None], [key], run)
        log = top > LOG_FROM
        limits = (0.4, top) if log else (0.0, max(2.0, 1.1 * top))
        panels.append(Panel(group.name, "× clean", lines, limits, rule=1.0, log=log))
    title = f"{name}: rms over 1 s in multiples of clean noise"
    return stacked_chart(
        book, title, panels, keys=[*keys, CLEAN], note=None if named else "nothing is named",
        label=f"{title}, every group of channels over time.",
    )  # fmt: skip


def _rms(
    traces: Sequence[Trace], grouped: Sequence[Group], units: Mapping[str, Shown], *, named: bool
) -> Node:
    """Physical and whitened rms of every channel, over all trials."""
    rows: list[list[Entry]] = []
    for group in grouped:
        roots = [_roots(traces, column) for column in group.columns]
        unit, scale = units[group.unit]
        for k, ((before, after, *white), component) in enumerate(zip(roots, group.components, strict=True)):
            physical = [scale * root for root in (before, after)[: 1 + named]]
            names = [group.name if k == 0 else "", component if len(roots) > 1 else ""]
            rows.append([*names, spelled(unit), *map(value, physical + white)])
    head = ["channel", "", "unit", *(["before", "after"] if named else ["rms"])]
    head += ["before [× clean]", ("after" if named else "within tolerances") + " [× clean]"]
    return table("Rms of the residual over all trials", head, rows, groups=True, headers=2)


def _roots(traces: Sequence[Trace], column: int) -> list[float]:
    """Rms of one channel over all trials: before and after, both also whitened."""
    kinds = ("before", "after", "white_before", "white_after")
    together = (np.concatenate([getattr(t, kind)[:, column] for t in traces]) for kind in kinds)
    return [float(np.sqrt(np.mean(values**2))) for values in together]


def _against(
    book: Book, traces: Sequence[Trace], grouped: Sequence[Group], keys: Sequence[Key]
) -> list[Node]:
    book.say("dependence of the residual")
    panels = []
    for quantity in [*traces[0].quantities, None]:
        unit = QUANTITIES.get(quantity or "", "")
        label = "frequency [Hz]" if quantity is None else f"{quantity} [{unit}]" if unit else quantity
        charts = [_dependence(book, traces, group, quantity, label, keys) for group in grouped]
        shown = [shared_legend([*keys, CLEAN]), el("div", *charts, class_="trio")]
        panels.append((quantity or "frequency", shown))
    note = (
        "Whitened rms in multiples of clean data, all trials together: in bins of equal counts against speed, "
        "position, load and the like; against frequency as a spectrum. What rises with load is elastic, what rises "
        "with speed rubs, a peak is something that swings."
    )
    return [paragraph(note, kind="note"), *tabs(book, "Against", panels)]


def _dependence(
    book: Book, traces: Sequence[Trace], group: Group, quantity: str | None, label: str, keys: Sequence[Key]
) -> Node:
    """Whitened rms of a group of channels against a quantity; against frequency where that is None."""
    lines, seen, columns = [], [1.0], list(group.columns)
    style = {"mode": "lines"} if quantity is None else {"mode": "lines+markers", "marker": {"size": 5}}
    for key, kind in zip(keys, ("white_before", "white_after"), strict=True):
        found = (
            spectrum(traces, kind, columns) if quantity is None else binned(traces, kind, columns, quantity)
        )
        if found is not None:
            hover = f"{key.label}<br>%{{x:.3g}}: %{{y:.3g}} × clean"
            lines.append(line(*found, key, hover, width=1.6, **style))
            seen += [float(found[1].min()), float(found[1].max())]
    vertical = (
        log_axis("× clean", [max(v, 0.05) for v in seen])
        if max(seen) > LOG_FROM
        else axis("× clean", range=[0.0, max(2.0, 1.12 * max(seen))], zeroline=False, nticks=5)
    )
    shown = figure(lines, xaxis=axis(label, zeroline=False, nticks=6), yaxis=vertical, margin_l=52)
    shown.add_hline(1.0, line_width=1)
    what = label.split(" [")[0]
    return chart(
        book, f"{group.name} against {what}", shown, height=210,
        label=f"Whitened rms of {group.name} against {what}, before and after.",
    )  # fmt: skip
