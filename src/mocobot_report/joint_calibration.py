"""Report of a robot calibrated from joint logs: what it predicts, what the logs determine, and what they do not."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from discrepancy.joints import calibrated
from discrepancy.joints.quantities import described
from discrepancy.joints.same_kind import Comparison
from estimator.statistics import rms
from mocobot_report.charts import Chart, Key, Line, Panel, dots, line, log_axis, row_layout, stacked_chart
from mocobot_report.numbers import counted, percent, plain, spelled
from mocobot_report.tables import Entry, measurement, table, value

if TYPE_CHECKING:
    from mocobot_report.folder import Result

LEFT = (
    Key("model", "given model", "before", "circle"),
    Key("least_squares", "least squares", "c1", "diamond"),
    Key("calibrated", "calibrated", "after", "square"),
    Key("noise", "noise", "text", "x"),
)
"""Legend of what predictions leave; groups are attributes of ``HeldOut``."""
COMMAND, MEASURED = Key("command", "command", "line"), Key("measured", "measured", "text")
SIMULATED = Key("before", "given model", "before"), Key("after", "calibrated", "after")
MOMENTS = "m: mass; mx, my, mz: first moments; xx, ..., yz: moments of inertia; all about the link's frame"


def context(result: "Result", say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/joint-calibration.html``."""
    say("calibration")
    told: calibrated.Told = result.found
    known, torque = told.determined, np.maximum(told.rms("torque"), 1e-12)
    left, of = (
        ("torque left", "of rms torque") if told.predicts == "torque" else ("forecast error", "of the motion")
    )
    tiles = [(f"{left}, {k.label}", percent(rms(told.rms(k.group) / torque)), of) for k in keys_of(told)]
    count = len(told.combinations)
    share, more = (
        f"{len(known) - count} of {len(told.parameters)}",
        f"and {counted(count, 'combination')} of others",
    )
    tiles.append(("parameters determined", share, more))
    rows: dict[str, list[list[Entry]]] = {}
    for kind, words, unit, given, found, se in known.values():
        rows.setdefault(kind, []).append([words, spelled(unit), value(given, 4), measurement(found, se)])
    head, notes = ("", "unit", "given", "found"), {calibrated.COMBINED: MOMENTS}
    return {
        "title": f"Calibration of {told.model.path.name} from {counted(len(told.logs), 'log')} of its joints",
        "told": told, "gain": calibrated.gain(told.found),
        "findings": calibrated.findings(told.found), "tiles": tiles, "left": _chart(told),
        "forecasts": [_forecast(told, j) for j in told.joints] if told.forecasts else [],
        "names": [told.model.joints[j] for j in told.joints],
        "same": [(one.sentence, _differences(one)) for one in told.same],
        "tables": [table(name, head, own, note=notes.get(name, ""), stack=True) for name, own in rows.items()],
        "pictures": [],
    }  # fmt: skip


def _differences(one: Comparison) -> Markup | None:
    """Table of what two machines of one kind have."""
    rows: list[list[Entry]] = []
    for d in one.differences:
        words, unit, scale = described(d.name)
        off = scale * (d.values[0] - d.values[1])
        cells = [value(scale * x, 4) for x in d.values]
        rows.append([f"{words} of {d.places[0]}", spelled(unit), *cells, measurement(off, scale * d.se)])
    return (
        table("Determined in both", ("", "unit", *one.names, "difference"), rows, stack=True)
        if rows
        else None
    )


def keys_of(told: calibrated.Told) -> list[Key]:
    """Legend of what this calibration tells: positions have no ordinary least squares."""
    return [key for key in LEFT if key.group != "least_squares" or told.predicts == "torque"]


def _chart(told: calibrated.Told) -> Chart:
    """Plot what predictions leave of every joint."""
    keys = keys_of(told)
    names, left, data = told.names, [told.rms(key.group).tolist() for key in keys], []
    for key, x in zip(keys, left, strict=True):
        text = [f"{name}, {key.label}: {plain(number)}" for name, number in zip(names, x, strict=True)]
        data.append(dots(x, range(len(names)), key, text))
    what = "rms torque" if told.predicts == "torque" else "rms error over 1 s"
    across = log_axis(what, [number for x in left for number in x])
    which = "parts that were not fitted" if told.validated else "the only part, which was fitted"
    label = "Torque that given model, least squares and calibrated model leave of every joint, and noise."
    title = f"Torque left of {which}"
    if told.predicts == "position":
        label = "Errors of forecasts by given and calibrated model of every joint, and the readings' noise."
        title = f"Errors of forecasts from commands alone over one second: {which}"
    return Chart(title, label, data, keys=keys, **row_layout(names, across, row_px=36))


def _forecast(told: calibrated.Told, joint: int) -> list[Chart]:
    """Plot one joint over time, commanded, measured and simulated, and the response of its loop."""
    assert told.forecasts is not None
    own, name, scale = told.forecasts, told.model.joints[joint], calibrated.scale_of(told.found)
    columns, unit = own.positions[joint].T, "m" if told.model.slides[joint] else "rad"
    keys = COMMAND, MEASURED, *SIMULATED
    panels = [
        Panel("position", unit, [Line(k, own.time, x) for k, x in zip(keys, columns, strict=True)]),
        Panel("error", calibrated.unit_of(told.found, joint), [
            Line(k, own.time, scale * (x - columns[1])) for k, x in zip(SIMULATED, columns[2:], strict=True)
        ]),
    ]  # fmt: skip
    label = f"Commanded, measured and simulated position of {name} over time, and errors of the simulations."
    note = "every second begins at the estimated motion; commands alone are known from there on"
    over_time = stacked_chart(f"{name}: {own.part}", label, panels, keys=keys, note=note)
    frequency, *gains = own.responses[joint].T
    if not len(frequency):
        return [over_time]
    data = [
        line(frequency, x, k, f"{k.label}<br>%{{x:.2f}} Hz: %{{y:.3g}}")
        for k, x in zip(keys[1:], gains, strict=True)
    ]
    layout = {
        "xaxis": log_axis("frequency [Hz]", frequency), "margin": {"l": 74},
        "yaxis": log_axis("position over command", [float(x) for one in gains for x in one]),
    }  # fmt: skip
    label = f"Amplitude of the position of {name} over that of its command against frequency, measured and simulated."
    return [over_time, Chart(f"{name}: response to its command", label, data, layout, 260, keys[1:])]
