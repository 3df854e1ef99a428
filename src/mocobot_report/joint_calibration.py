"""Report of a robot calibrated from joint logs: what it predicts, what the logs determine, and what they do not."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from discrepancy.joints.calibrated import Told, combination_in_words
from discrepancy.joints.calibration import Parameter
from mocobot_report.charts import Chart, Key, dots, log_axis, row_layout
from mocobot_report.numbers import counted, plain, spelled
from mocobot_report.tables import Entry, measurement, table, value

if TYPE_CHECKING:
    from mocobot_report.folder import Result

LEFT = (
    Key("model", "given model", "before", "circle"),
    Key("least_squares", "least squares", "c1", "diamond"),
    Key("calibrated", "calibrated", "after", "square"),
    Key("noise", "noise", "text", "x"),
)
"""Legend of torques left; the groups are those of ``calibrated.HELD_OUT``."""


def context(result: "Result", say: Callable[[str], object]) -> dict[str, Any]:
    """Return the data of ``assets/joint-calibration.html``."""
    say("calibration")
    told: Told = result.found
    known = [p for p in told.parameters if p.determined]
    tiles = [(f"torque left, {key.label}", told.share(key.group), "of rms torque") for key in LEFT]
    count = counted(len(told.combinations), "combination")
    tiles.append(
        ("parameters determined", f"{len(known)} of {len(told.parameters)}", f"and {count} of others")
    )
    sides = {
        "of the model": [p for p in known if p.in_model],
        "of the log": [p for p in known if not p.in_model],
    }
    return {
        "title": f"Calibration of {told.model.path.name} from {counted(len(told.logs), 'log')} of its joints",
        "told": told, "tiles": tiles, "left": _chart(told),
        "determined": [_parameters(told, name, own) for name, own in sides.items() if own],
        "combinations": _combinations(told), "pictures": [],
    }  # fmt: skip


def joint_names(told: Told) -> list[str]:
    """Return names and units of the joints with torques."""
    return [f"{told.model.joints[j]} [{'N' if told.model.slides[j] else 'N m'}]" for j in told.joints]


def _chart(told: Told) -> Chart:
    """Plot the torque left of every joint."""
    names, each = joint_names(told), {key: told.rms(key.group) for key in LEFT}
    data = [
        dots(
            x,
            range(len(x)),
            key,
            [f"{name}, {key.label}: {plain(v)}" for name, v in zip(names, x, strict=True)],
        )
        for key, x in each.items()
    ]
    across = log_axis("rms torque", [v for x in each.values() for v in x])
    which = "parts that were not fitted" if told.validated else "the only part, which was fitted"
    label = "Torque that given model, least squares and calibrated model leave of every joint, and noise."
    return Chart(f"Torque left of {which}", label, data, keys=LEFT, **row_layout(names, across, row_px=36))


def _parameters(told: Told, name: str, parameters: list[Parameter]) -> Any:
    rows: list[list[Entry]] = []
    for p in parameters:
        what, unit, scale = told.in_words(p)
        found = measurement(scale * p.value, scale * p.se)
        rows.append([what, spelled(unit), value(scale * p.model, 4), found, value(scale * p.prior, 2)])
    note = "± standard error; assumed: standard deviation before the logs"
    return table(
        f"Determined, {name}",
        ["parameter", "unit", "given", "found", "assumed ±"],
        rows,
        note=note,
        stack=True,
    )


def _combinations(told: Told) -> Any:
    rows: list[list[Entry]] = []
    for c in told.combinations:
        terms, unit = combination_in_words(c)
        rows.append([terms, value(c.model, 4), measurement(c.value, c.se, spelled(unit))])
    note = "m: mass; mx, my, mz: first moments; xx, ..., yz: moments of inertia; all about the link's frame"
    return table("Determined in combination only", ["terms", "given", "found"], rows, note=note, stack=True)
