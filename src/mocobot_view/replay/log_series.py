"""Time series of a replay in Rerun."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from mocobot_view import colours
from mocobot_view.colours import Colour
from mocobot_view.replay.log_time import send_scalars
from mocobot_view.replay.replay_trial import ReplayTrial

Array = NDArray[np.float64]

XYZ = ("x", "y", "z")


def log_series(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log all series below ``series`` in the trial's root, one entity per quantity and robot."""
    recording, motion = trial.recording, trial.motion
    measured: dict[str, tuple[Array, tuple[str, ...]]] = {
        "phi": (recording.phi, ("1", "2", "3")),
        "theta": (recording.theta, ("z", "y", "x")),
        "tau": (recording.tau, ("1", "2", "3")),
    }
    for quantity, (values, parts) in measured.items():
        _per_robot(stream, trial, quantity, trial.time, values, parts)
    _log_wrists(stream, trial)
    if trial.data is not None:
        time = trial.data.time
        for quantity, values in (
            ("omega", trial.data.twist[..., :3]),
            ("velocity", trial.data.twist[..., 3:]),
            ("moment", trial.data.wrench[..., :3]),
            ("force", trial.data.wrench[..., 3:]),
        ):
            _per_robot(stream, trial, quantity, time, values, XYZ)
        if trial.balance is not None:
            _vector(stream, f"{trial.name}/series/balance_force", time, trial.balance.force)
            if trial.balance.moment is not None:
                _vector(stream, f"{trial.name}/series/balance_moment", time, trial.balance.moment)
    if motion is not None:
        _per_robot(
            stream, trial, "grasp_position_mm", trial.time, 1e3 * motion.gap_position_m[..., None], ("",)
        )
        _per_robot(
            stream, trial, "grasp_rotation_mrad", trial.time, 1e3 * motion.gap_rotation_rad[..., None], ("",)
        )


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


def _vector(stream: rr.RecordingStream, path: str, time: Array, values: Array) -> None:
    _lines(stream, path, time, values, list(XYZ), list(colours.AXES))


def _lines(
    stream: rr.RecordingStream,
    path: str,
    time: Array,
    values: Array,
    names: list[str],
    shades: list[Colour],
    width: float = 1.2,
) -> None:
    stream.log(path, rr.SeriesLines(names=names, colors=shades, widths=width), static=True)
    send_scalars(stream, path, time, values)
