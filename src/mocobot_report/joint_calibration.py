"""Report of a robot calibrated from joint logs: what it predicts, what the logs determine, and what they do not."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from discrepancy.joints import calibrated
from discrepancy.joints.calibration import Parameter
from estimator.statistics import rms
from mocobot_report.charts import Chart, Key, dots, log_axis, row_layout
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
"""Legend of torques left; groups are attributes of ``HeldOut``."""


def context(result: "Result", say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/joint-calibration.html``."""
    say("calibration")
    told: calibrated.Told = result.found
    known, torque = [p for p in told.parameters if p.determined], np.maximum(told.rms("torque"), 1e-12)
    tiles = [
        (f"torque left, {k.label}", percent(rms(told.rms(k.group) / torque)), "of rms torque") for k in LEFT
    ]
    count = counted(len(told.combinations), "combination")
    tiles.append(
        ("parameters determined", f"{len(known)} of {len(told.parameters)}", f"and {count} of others")
    )
    sides = [
        (f"of the {of}", [p for p in known if p.in_model == own]) for of, own in (("model", 1), ("log", 0))
    ]
    return {
        "title": f"Calibration of {told.model.path.name} from {counted(len(told.logs), 'log')} of its joints",
        "told": told, "gain": calibrated.to_text(told.found).partition("\n")[0],
        "findings": calibrated.findings(told.found), "tiles": tiles, "left": _chart(told),
        "determined": [_parameters(told, name, own) for name, own in sides if own],
        "combinations": _combinations(told), "pictures": [],
    }  # fmt: skip


def _chart(told: calibrated.Told) -> Chart:
    """Plot the torque left of every joint."""
    names, left, data = told.names, [told.rms(key.group).tolist() for key in LEFT], []
    for key, x in zip(LEFT, left, strict=True):
        text = [f"{name}, {key.label}: {plain(number)}" for name, number in zip(names, x, strict=True)]
        data.append(dots(x, range(len(names)), key, text))
    across = log_axis("rms torque", [number for x in left for number in x])
    which = "parts that were not fitted" if told.validated else "the only part, which was fitted"
    label = "Torque that given model, least squares and calibrated model leave of every joint, and noise."
    return Chart(f"Torque left of {which}", label, data, keys=LEFT, **row_layout(names, across, row_px=36))


def _parameters(told: calibrated.Told, name: str, parameters: list[Parameter]) -> Markup:
    rows: list[list[Entry]] = []
    for p in parameters:
        what, unit, scale = calibrated.described(p.name)
        place = calibrated.place_in_words(told.found, p.place)
        cells = measurement(scale * p.value, scale * p.se), value(scale * p.prior, 2)
        rows.append([f"{what} of {place}", spelled(unit), value(scale * p.model, 4), *cells])
    note, head = "assumed: standard deviation before the logs", ["", "unit", "given", "found", "assumed ±"]
    return table(f"Determined, {name}", head, rows, note=note, stack=True)


def _combinations(told: calibrated.Told) -> Markup:
    rows: list[list[Entry]] = []
    for c in told.combinations:
        terms, unit = calibrated.combination_in_words(c)
        rows.append([terms, spelled(unit), value(c.model, 4), measurement(c.value, c.se)])
    note = "m: mass; mx, my, mz: first moments; xx, ..., yz: moments of inertia; all about the link's frame"
    head = ["", "unit", "given", "found"]
    return table("Determined in combination only", head, rows, note=note, stack=True)
