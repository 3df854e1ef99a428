"""Time series of a replay in Rerun."""

import numpy as np
import rerun as rr

from estimator.arrays import Array
from mocobot_view import colours
from mocobot_view.colours import Colour
from mocobot_view.replay.log_time import send
from mocobot_view.replay.replay_trial import ReplayTrial

XYZ = ("x", "y", "z")


def log_series(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log all series below ``series`` in the trial's root, one entity per quantity and robot."""
    recording, data, motion, balance = trial.recording, trial.data, trial.motion, trial.balance
    _log_wrists(stream, trial)
    series: list[tuple[str, Array, Array, tuple[str, ...]]] = [
        ("phi", trial.time, recording.phi, ("1", "2", "3")),
        ("theta", trial.time, recording.theta, ("z", "y", "x")),
        ("tau", trial.time, recording.tau, ("1", "2", "3")),
    ]
    if data is not None:
        series += [
            ("omega", data.time, data.twist[..., :3], XYZ),
            ("velocity", data.time, data.twist[..., 3:], XYZ),
            ("moment", data.time, data.wrench[..., :3], XYZ),
            ("force", data.time, data.wrench[..., 3:], XYZ),
        ]
    if motion is not None:
        series += [
            ("grasp_position_mm", trial.time, 1e3 * motion.gap_position_m[..., None], ("",)),
            ("grasp_rotation_mrad", trial.time, 1e3 * motion.gap_rotation_rad[..., None], ("",)),
        ]
    for quantity, time, values, parts in series:
        _per_robot(stream, trial, quantity, time, values, parts)
    if data is not None and balance is not None:
        for quantity, values in (("balance_force", balance.force), ("balance_moment", balance.moment)):
            if values is not None:
                path = f"{trial.name}/series/{quantity}"
                _lines(stream, path, data.time, values, list(XYZ), list(colours.AXES))


def _log_wrists(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Measured and commanded wrist positions, robot by robot, so that each pair shares a plot."""
    for i in range(trial.robots):
        path = f"{trial.name}/series/wrist/omnid{i + 1}"
        measured = trial.bodies.wrist[:, i]
        _lines(stream, f"{path}/measured", trial.time, measured, list(XYZ), colours.shades(i + 1))
        if trial.recording.ref is not None:
            names = [f"{axis} commanded" for axis in XYZ]
            pale = colours.shades(i + 1, saturation=0.15)
            _lines(stream, f"{path}/commanded", trial.time, trial.recording.ref[:, i], names, pale, width=3.0)


def _per_robot(
    stream: rr.RecordingStream,
    trial: ReplayTrial,
    quantity: str,
    time: Array,
    values: Array,
    parts: tuple[str, ...],
) -> None:
    """One entity for a quantity of all robots, shape (Q, N, k): a row costs as much as three numbers."""
    names, shades = [], []
    for robot in range(1, trial.robots + 1):
        names += [f"omnid{robot} {part}".strip() for part in parts]
        shades += colours.shades(robot) if len(parts) == 3 else [colours.of_robot(robot)]
    _lines(stream, f"{trial.name}/series/{quantity}", time, values.reshape(len(values), -1), names, shades)


def _lines(
    stream: rr.RecordingStream,
    path: str,
    time: Array,
    values: Array,
    names: list[str],
    shades: list[Colour],
    width: float = 1.2,
) -> None:
    """k lines of one entity at times [s], shape (Q, k)."""
    stream.log(path, rr.SeriesLines(names=names, colors=shades, widths=width), static=True)
    counts = np.full(len(values), values.shape[1])
    send(stream, path, time, rr.Scalars.columns(scalars=values.ravel()).partition(counts))
