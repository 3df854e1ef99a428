"""Charts of a diagnosis: residuals over time, against quantities, by place and along sources; evidence; torques."""

from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np

from discrepancy.numbers import Shown
from discrepancy.result.read import is_of_joints, name_of
from discrepancy.result.report import drawn, label, relation
from discrepancy.result.traces import Group, Trace, binned, group_units, groups, multiples, spectrum
from estimator.arrays import Array
from estimator.statistics import rms
from mocobot_report.charts import (
    Axis,
    Chart,
    Key,
    Line,
    Panel,
    axis,
    bars,
    dots,
    line,
    log_axis,
    points_of_each,
    row_layout,
    rule,
    stacked_chart,
    thinned,
)
from mocobot_report.folder import Diagnosed
from mocobot_report.numbers import percent, plain, spelled, without_percent
from mocobot_report.tables import Entry, Num, value

Values = Mapping[str, Any]
BAND = Key("", "±2 standard deviations of clean data", "band", "band")
CLEAN = Key("", "clean data", "text", "dash")
LOG_FROM = 8.0  # residual above which an axis is logarithmic [multiples of clean noise]. Chosen.
QUANTITIES = {
    "speed": "m/s", "velocity": "m/s", "position": "m", "acceleration": "m/s²", "load": "N m", "force": "N",
    "temperature": "°C",
}  # fmt: skip
"""Units of the quantities against which a team's misfit is plotted."""
OF_JOINTS = {"speed": "typical speeds"}  # entries of ``QUANTITIES`` that differ for a single robot


def misfits(*, named: bool, lines: bool = False) -> tuple[Key, Key]:
    """Make legend entries for the misfit as simulated, and for that with tolerances and the named causes, if any."""
    after = "with causes and tolerances" if named else "with tolerances"
    square, circle = ("line", "line") if lines else ("square", "circle")
    return Key("before", "as simulated", "before", square), Key("after", after, "after", circle)


def residuals(found: Diagnosed, names: Sequence[str], say: Callable[[str], object]) -> dict[str, Any] | None:
    """Make charts and table rows from ``residuals.npz``; None without that file."""
    traces = found.traces
    if not traces:
        return None
    grouped, named = groups(found.channels), bool(found.values["causes"])
    units = group_units(traces, grouped)
    most, trials = points_of_each(len(traces)), []
    for trace, name in zip(traces, names, strict=True):
        say(f"residuals of {name}")
        views = {"as simulated": trace.before} | ({"with the named causes": trace.after} if named else {})
        physical = [
            _physical(f"{name}: residual {view}", _channels(trace, values, grouped, units, most), grouped, named)
            for view, values in views.items()
        ]  # fmt: skip
        whitened = _multiples(trace, name, grouped, named)
        trials.append({"name": name, "physical": physical, "multiples": whitened})
    say("dependence of the residual")
    keys = misfits(named=named, lines=True)
    shown_in = QUANTITIES | (OF_JOINTS if is_of_joints(found.values) else {})
    against = [
        (quantity or "frequency", [_dependence(traces, group, quantity, shown_in, keys) for group in grouped])
        for quantity in [*traces[0].quantities, None]
    ]
    return {
        "trials": trials, "rms": _rms(traces, grouped, units, named=named), "against": against,
        "keys": [*keys, CLEAN],
    }  # fmt: skip


def _components(grouped: Sequence[Group]) -> list[Key]:
    """Make the legend of the components, each with the label of the last group that has it."""
    several = [group.components for group in grouped if len(group.columns) > 1]
    labels = [next(filter(None, each[::-1])) for each in zip_longest(*several)] or ["value"]
    return [Key(f"c{k + 1}", shown, f"c{k % 3 + 1}") for k, shown in enumerate(labels)]


def _channels(
    trace: Trace, values: Array, grouped: Sequence[Group], units: Mapping[str, Shown], most: int
) -> list[Panel]:
    """Make one panel per group of channels, with a band of clean data."""
    keys, n, panels = _components(grouped), trace.moving, []
    for group in grouped:
        columns, (unit, scale) = list(group.columns), units[group.unit]
        largest = float(np.abs(trace.before[:, columns]).max(initial=0.0))
        limit = scale * 1.05 * max(largest, 2.5 * float(trace.sigma[:, columns].max(initial=0.0))) or scale
        lines = _lines(trace, scale * values[:, columns], keys, most)
        time, sigma = thinned(trace.time[:n], trace.sigma[:n, columns], 1.0 / trace.rate_hz, n)
        band = (time, 2.0 * scale * sigma.max(axis=1)) if n else None
        panels.append(Panel(group.name, spelled(unit), lines, (-limit, limit), band=band))
    return panels


def _physical(title: str, panels: Sequence[Panel], grouped: Sequence[Group], named: bool) -> Chart:
    keys = _components(grouped)
    said = f"{title}, every group of channels over time; rms values are in the table below."
    note = "same scale as simulated and with the causes" if named else ""
    return stacked_chart(title, said, panels, keys=[*keys, BAND] if len(keys) > 1 else [BAND], note=note)


def _lines(trace: Trace, values: Array, keys: Sequence[Key], most: int) -> list[Line]:
    """Plot columns over time: the time series as lines, the means over holds as points."""
    n = trace.moving
    time, shown = thinned(trace.time[:n], values[:n], 1.0 / trace.rate_hz, most)
    columns = range(values.shape[1])
    lines = [Line(keys[k], time, shown[:, k]) for k in columns]
    if n < len(trace.time):
        lines += [Line(keys[k], trace.time[n:], values[n:, k], points=True) for k in columns]
    return lines


def _multiples(trace: Trace, name: str, grouped: Sequence[Group], named: bool) -> Chart:
    """Plot the running rms of each group of channels relative to clean noise."""
    keys, panels = misfits(named=named, lines=True), []
    for group in grouped:
        lines, top = [], 1.0
        for key, white in zip(keys, (trace.white_before, trace.white_after), strict=True):
            shown = multiples(trace, white, group.columns)
            top = max(top, float(shown.max(initial=0.0)))
            lines += _lines(trace, shown[:, None], [key], 600)
        log = top > LOG_FROM
        limits = (0.4, top) if log else (0.0, max(2.0, 1.1 * top))
        panels.append(Panel(group.name, "× clean", lines, limits, rule=1.0, log=log))
    title = f"{name}: rms over 1 s in multiples of clean noise"
    said = f"{title}, every group of channels over time."
    return stacked_chart(title, said, panels, keys=[*keys, CLEAN], note="" if named else "nothing is named")


def _rms(
    traces: Sequence[Trace], grouped: Sequence[Group], units: Mapping[str, Shown], *, named: bool
) -> list[list[Entry]]:
    """Tabulate physical and whitened rms of every channel over all trials."""
    kinds = ("before", "after") if named else ("before",)
    rows: list[list[Entry]] = []
    for group in grouped:
        unit, scale = units[group.unit]
        for k, (column, component) in enumerate(zip(group.columns, group.components, strict=True)):
            physical = [value(scale * rms_of(traces, kind, column)) for kind in kinds]
            white = [value(rms_of(traces, kind, column)) for kind in ("white_before", "white_after")]
            names = [group.name if k == 0 else "", component if len(group.columns) > 1 else ""]
            rows.append([*names, spelled(unit), *physical, *white])
    return rows


def _dependence(
    traces: Sequence[Trace], group: Group, quantity: str | None, units: Mapping[str, str], keys: Sequence[Key]
) -> Chart:
    """Plot the whitened rms of a group of channels against a quantity, or against frequency if it is None."""
    what, unit = quantity or "frequency", units.get(quantity, "") if quantity else "Hz"
    style = {"mode": "lines+markers", "marker": {"size": 5}} if quantity else {}
    data, seen, columns = [], [1.0], list(group.columns)
    for key, kind in zip(keys, ("white_before", "white_after"), strict=True):
        found = binned(traces, kind, columns, quantity) if quantity else spectrum(traces, kind, columns)
        if found is not None:
            hover = f"{key.label}<br>%{{x:.3g}}: %{{y:.3g}} × clean"
            data.append(line(*found, key, hover, width=1.6, **style))
            seen += [float(found[1].min()), float(found[1].max())]
    if max(seen) > LOG_FROM:
        upward = log_axis("× clean", [max(v, 0.05) for v in seen])
    else:
        upward = axis("× clean", range=[0.0, max(2.0, 1.12 * max(seen))], zeroline=False, nticks=5)
    across = axis(f"{what} [{unit}]" if unit else what, zeroline=False, nticks=6)
    layout = {"xaxis": across, "yaxis": upward, "margin": {"l": 52}, "shapes": [rule(y=1.0, thin=True)]}
    said = f"Whitened rms of {group.name} against {what}, before and after."
    return Chart(f"{group.name} against {what}", said, data, layout, 210)


def places(values: Values, names: Sequence[str]) -> dict[str, Any]:
    """Make charts of the misfit by channel and trial, and of its share along single sources."""
    keys = misfits(named=bool(values["causes"]))
    before, after = values["residual"]["nominal"]["signature"], values["residual"]["signature"]
    charts = []
    if before.get("channel") and after.get("channel"):
        charts.append(_misfit("Misfit by channel", before["channel"], after["channel"], {}, keys))
    if before.get("trial") and after.get("trial") and len(before["trial"]) > 1:
        shown = dict(zip(values["recordings"], names, strict=True))
        charts.append(_misfit("Misfit by trial", before["trial"], after["trial"], shown, keys))
    if before.get("along"):
        charts.append(_along("Where the misfit as simulated points", before["along"], "before"))
    if after.get("along") and values["verdict"] != "consistent":
        charts.append(_along("Where what is left points", after["along"], "after"))
    return {"charts": charts, "said": before["sentence"]}


def _misfit(title: str, before: Values, after: Values, shown: Values, keys: Sequence[Key]) -> Chart:
    """Plot chi²/n of every channel or trial, before and after; ``shown`` maps names to labels."""
    rows = list(before)
    names = [shown.get(row, row) for row in rows]
    data, seen = [], [1.0]
    for key, values in zip(keys, (before, after), strict=True):
        numbers = [values.get(row) for row in rows]
        text = [f"{name}, {key.label}: {plain(v)}" for name, v in zip(names, numbers, strict=True)]
        data.append(dots(numbers, range(len(rows)), key, text))
        seen += numbers
    said = f"{title}: chi-square per number, before and after, one row each."
    layout = row_layout(names, log_axis("chi²/n", seen), rules=[1.0])
    return Chart(title, said, data, keys=[*keys, CLEAN], **layout)


def _along(title: str, shares: Values, colour: str) -> Chart:
    """Plot the share of the squared residual along single sources."""
    text = [percent(share) for share in shares.values()]
    more = {"cliponaxis": False, "textposition": "auto", "insidetextanchor": "end"}
    data = bars(list(shares.values()), Key("", "", colour, "band"), text, 0.62, **more)
    said = ", ".join(f"{name} {share}" for name, share in zip(shares, text, strict=True))
    across = axis("share of the misfit [%]", range=[0, 114.0 * max(shares.values())], nticks=5)
    return Chart(
        title, f"{title}: share of the squared residual along single sources: {said}", [data],
        note="share of the squared residual along what one source alone can do; sources overlap, shares do not add up",
        **row_layout(list(shares), across, row_px=30),
    )  # fmt: skip


NEEDED = Key("needed", "needed to be named", "text", "circle-open")
RELATIONS = (
    Key("named", "named", "before", "square"),
    Key("family", "same family", "after", "circle"),
    Key("other", "other", "paper", "diamond"),
)


def evidence(values: Values) -> list[Chart]:
    """Plot the evidence for the strongest candidates, without and with the named causes in the model, on one scale."""
    titles = {"before": "Nothing is named yet", "after": "What is named is in the model"}
    panels = [(title, drawn(values["evidence"][key] or [])) for key, title in titles.items()]
    seen = [entry[key] for _, entries in panels for entry in entries for key in ("nats", "needed")]
    across = log_axis("evidence [nats]", seen)
    return [_strongest(title, entries, values["causes"], across) for title, entries in panels if entries]


def _strongest(title: str, entries: Sequence[Values], causes: Sequence[Values], across: Axis) -> Chart:
    names, nats = [label(entry) for entry in entries], [entry["nats"] for entry in entries]
    needed = [entry["needed"] for entry in entries]
    rings = [f"{name}: named from {plain(n, 2)} nats" for name, n in zip(names, needed, strict=True)]
    data, keys = [dots(needed, range(len(names)), NEEDED, rings, size=7)], []
    for key in RELATIONS if causes else RELATIONS[-1:]:
        rows = [k for k, entry in enumerate(entries) if not causes or relation(entry, causes) == key.group]
        if rows:
            keys.append(key)
            text = [f"{names[k]}: {plain(nats[k])} nats, named from {plain(needed[k], 2)}" for k in rows]
            data.append(dots([nats[k] for k in rows], rows, key, text))
    said = ", ".join(f"{name} {plain(n)}" for name, n in zip(names, nats, strict=True))
    return Chart(
        title, f"{title}: evidence of the strongest candidates in nats, {said}", data,
        keys=[*keys, NEEDED] if causes else [NEEDED],
        **row_layout(names, across, left_px=190, most=40, font_px=9),
    )  # fmt: skip


MEASURED, GIVEN = Key("measured", "measured", "text"), Key("before", "model as given", "before")
COLOURS = ("r1", "r2", "r3", "r4", "r5")  # colours of the causes, which repeat
LEFT = Key("left", "left", "line", "band")
MARGIN = 1.08  # vertical range of a panel over the largest value. Chosen.
FADED = "below the frequency of the rows; all fade at the ends of a log and where nothing is to be learnt"
WIDE = 3.0  # width of the measured line, which lies below the others [px]. Chosen.


def torques(found: Diagnosed, names: Sequence[str]) -> dict[str, Any] | None:
    """Make charts and table rows; None if the residuals hold no measured torques."""
    traces = [trace for trace in found.traces if trace.measured is not None]
    if not traces:
        return None
    grouped, causes = groups(found.channels), found.values["causes"][: len(traces[0].causes)]
    named = [name_of(cause) for cause in causes]
    most = points_of_each(len(traces))
    trials = [
        (name, _over_time(trace, name, grouped, most, named))
        for trace, name in zip(traces, names, strict=True)
    ]
    within = "in the reference, too, or tolerated" if found.values["reference"] else "within the tolerances"
    return {"trials": trials, **_shares(traces, grouped, named, Key("within", within, "r6", "band"))}


def _over_time(trace: Trace, name: str, grouped: Sequence[Group], most: int, named: Sequence[str]) -> Chart:
    """Plot measured and modelled torque of every joint."""
    after = Key("after", "model with causes and tolerances" if named else "model with tolerances", "after")
    assert trace.measured is not None
    sides = (
        (MEASURED, trace.measured),
        (GIVEN, trace.measured - trace.before),
        (after, trace.measured - trace.after),
    )
    panels = []
    for group in grouped:
        (column,) = group.columns
        limit = MARGIN * max(float(np.abs(values[:, column]).max(initial=0.0)) for _, values in sides) or 1.0
        lines = []
        for key, values in sides:
            time, shown = thinned(trace.time, values[:, [column]], 1.0 / trace.rate_hz, most)
            lines.append(Line(key, time, shown[:, 0], width=WIDE if key is MEASURED else 1.2))
        panels.append(Panel(group.name, spelled(group.unit), lines, (-limit, limit)))
    said = f"Measured and modelled torque of every joint over time in {name}; what is explained is in the table below."
    return stacked_chart(
        f"{name}: measured and modelled", said, panels, keys=[MEASURED, GIVEN, after], note=FADED
    )


def _shares(
    traces: Sequence[Trace], grouped: Sequence[Group], named: Sequence[str], within: Key
) -> dict[str, Any]:
    """Make chart and table of the share of each joint's squared residual that a cause removes beyond those above it."""
    units = group_units(traces, grouped)
    shares = {group.name: _in_turn(traces, group.columns[0]) for group in grouped}
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(named))]
    keys = [
        Key(f"cause{k}", name, colour, "band")
        for k, (name, colour) in enumerate(zip(named, colours, strict=True))
    ]
    data = []
    for k, key in enumerate([*keys, within, LEFT]):
        each = [max(float(found[k]), 0.0) for found in shares.values()]
        text = [f"{joint}, {key.label}: {percent(share)}" for joint, share in zip(shares, each, strict=True)]
        data.append(bars(each, key, text, 0.62, textposition="none"))
    most = max((sum(max(float(x), 0.0) for x in found) for found in shares.values()), default=1.0)
    across = axis("share of the squared residual [%]", range=[0.0, 100.0 * max(most, 1.0)], nticks=5)
    said = "Share of every joint's squared residual torque that each cause removes; the numbers are in the table below."
    chart = Chart(
        "What each cause explains of every joint", said, data, keys=[*keys, within, LEFT],
        **row_layout(list(shares), across, row_px=30),
    )  # fmt: skip
    rows: list[list[Entry]] = []
    for group in grouped:
        unit, scale = units[group.unit]
        sizes = [
            value(scale * rms_of(traces, kind, group.columns[0])) for kind in ("measured", "before", "after")
        ]
        told = [Num(without_percent(percent(float(share)))) for share in shares[group.name]]
        rows.append([f"{group.name} [{spelled(unit)}]", *sizes, *told])
    head = [
        "rms", "measured", "before", "after", *(f"{name} [%]" for name in named), f"{within.label} [%]",
        "left [%]",
    ]  # fmt: skip
    return {"shares": chart, "head": head, "rows": rows}


def _in_turn(traces: Sequence[Trace], column: int) -> Array:
    """Return the shares of a channel's squared residual: removed by each cause in turn, by the tolerances, and left."""
    left = np.concatenate([trace.before[:, column] for trace in traces])
    squares = [float(left @ left)]
    for k in range(len(traces[0].causes)):
        left = left - np.concatenate([trace.causes[k][:, column] for trace in traces])
        squares.append(float(left @ left))
    squares.append(float(sum(trace.after[:, column] @ trace.after[:, column] for trace in traces)))
    return np.append(-np.diff(squares), squares[-1]) / (squares[0] or 1.0)


def rms_of(traces: Sequence[Trace], kind: str, column: int) -> float:
    """Return the rms of one channel over all trials."""
    return rms(np.concatenate([getattr(trace, kind)[:, column] for trace in traces]))
