"""Torques of a single robot: measured against modelled over time, and what each cause explains of every joint."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from discrepancy.result.read import name_of
from discrepancy.result.traces import Group, Trace, group_units, groups
from estimator.arrays import Array
from estimator.statistics import rms
from mocobot_report.charts import (
    Chart,
    Key,
    Line,
    Panel,
    axis,
    bars,
    points_of_each,
    row_layout,
    stacked_chart,
    thinned,
)
from mocobot_report.folder import Diagnosed
from mocobot_report.numbers import percent, spelled, without_percent
from mocobot_report.tables import Entry, Num, value

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
