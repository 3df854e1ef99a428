"""Report of a robot calibrated from joint logs: what it predicts, what the logs determine, and what they do not."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from discrepancy.joints import calibrated
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
MOMENTS = "m: mass; mx, my, mz: first moments; xx, ..., yz: moments of inertia; all about the link's frame"


def context(result: "Result", say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/joint-calibration.html``."""
    say("calibration")
    told: calibrated.Told = result.found
    known, torque = told.determined, np.maximum(told.rms("torque"), 1e-12)
    tiles = [
        (f"torque left, {k.label}", percent(rms(told.rms(k.group) / torque)), "of rms torque") for k in LEFT
    ]
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
        "tables": [table(name, head, own, note=notes.get(name, ""), stack=True) for name, own in rows.items()],
        "pictures": [],
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
