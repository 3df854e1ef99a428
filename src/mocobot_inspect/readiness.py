"""Excitation of every step of an estimate from a log, and what can be estimated."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arm.delta import joints_of, wrist_fault
from estimator.arm.unit import Arms, ArmUnit, design_of
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.consistency import Trial
from estimator.estimate.payload import estimate_from_trials
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.uncertainty import FACTOR, StepReport
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from estimator.signals import GraspData, process_recording
from mocobot_inspect.signals import CUTOFF_HZ, RATE_HZ, TRIM_S
from mocobot_logs.log import Level

QUANTITIES = ("grasps", "mass", "centre of mass", "inertia")
AXES = ("roll", "pitch", "yaw")  # rotation about x, y and z of {1}
_HARDLY = 0.1  # of the rotation about the axis with most motion
_ALONG = np.cos(np.deg2rad(20.0))


@dataclass(frozen=True)
class Readiness:
    steps: tuple[StepReport, ...]  # excitation of every step of the estimate
    holds: int  # number of static holds
    axes: tuple[float, float, float] | None  # angular velocity about x, y, z of {1} [rad/s rms], or None
    reasons: dict[str, str | None]  # why each of ``QUANTITIES`` cannot be estimated, None if it can
    flags: tuple[str, ...]  # warnings of the estimate itself


def readiness(name: str, level: Level, parts: Sequence[tuple[float, Array]], arms: Arms) -> Readiness:
    """Run the estimate on uniform stretches, each a start [s] and samples (q, N, 9) at 100 Hz, and report its steps."""
    try:
        with np.errstate(over="raise", divide="raise"):
            data = [
                _processed(f"{name} from {start:.1f} s", level, part, start, arms) for start, part in parts
            ]
            trials = [Trial(f"stretch {k + 1}", "random", None, d) for k, d in enumerate(data)]
            estimate = estimate_from_trials(trials)
    except (InputError, FloatingPointError, np.linalg.LinAlgError) as error:
        reason = str(error) if isinstance(error, InputError) else f"the equations cannot be solved ({error})"
        return Readiness((), 0, None, dict.fromkeys(QUANTITIES, reason), ())
    omega = np.concatenate([d.twist[:, 0, :3] for d in data])
    x, y, z = (float(rate) for rate in np.sqrt(np.mean(omega**2, axis=0)))
    holds = sum(recording.holds for recording in estimate.recordings)
    return Readiness(estimate.steps, holds, (x, y, z), _reasons(estimate, omega), estimate.flags)


def _processed(name: str, level: Level, part: Array, start_s: float, arms: Arms) -> GraspData:
    design, units = design_of(arms), arms if isinstance(arms, ArmUnit) else None
    position, theta, effort = np.split(part, 3, axis=2)
    if level == "wrist":
        fault = wrist_fault(position, design)
        if fault is not None:
            (row, robot), what = fault
            raise InputError(f"omnid{robot + 1}, {start_s + row / RATE_HZ:.2f} s: {what}")
        position, effort = joints_of(position, effort, design)
    metadata = RecordingMetadata(
        part.shape[1], RATE_HZ, "random", "inspection", None, None, design, units=units
    )
    time = start_s + np.arange(len(part)) / RATE_HZ
    return process_recording(
        Recording(time, position, theta, effort, None, metadata, name), CUTOFF_HZ, TRIM_S
    )


def _reasons(estimate: PayloadEstimate, omega: Array) -> dict[str, str | None]:
    """Return why each of ``QUANTITIES`` cannot be estimated, None if it can."""
    grasps = estimate.grasps is not None
    weak = [direction for step in estimate.steps for direction in step.weak]
    turning = (step.noise for step in estimate.steps if step.step.startswith("rotation"))
    idle = idle_axes(omega, max(turning, default=0.0))

    def why(*words: str) -> str:
        if idle:
            return " and ".join(idle) + " not excited"
        own = [direction for direction in weak if any(word in direction.step for word in words)]
        for direction in own or weak:
            return f"{direction.direction}: {direction.reason}"
        return "nothing moves, and there is no static hold"

    return {
        "grasps": None if grasps else why("rotation", "position"),
        "mass": None if estimate.mass is not None else why("mass"),
        **{
            name: None if value is not None else why(name) if grasps else "it needs the grasps"
            for name, value in (("centre of mass", estimate.p_1c), ("inertia", estimate.inertia))
        },
    }


def idle_axes(omega: Array, noise: float) -> list[str]:
    """Return the axes of {1} about which there is hardly any rotation, in words; oblique axes are left out.

    Angular velocities (Q, 3) are in {1} [rad/s], their noise is rms.
    """
    values, vectors = np.linalg.eigh(omega.T @ omega / len(omega))
    rates = np.sqrt(np.maximum(values, 0.0))
    idle = []
    for rate, axis in zip(rates, vectors.T, strict=True):
        k = int(np.argmax(np.abs(axis)))
        if rate <= max(FACTOR * noise, _HARDLY * rates[-1]) and abs(axis[k]) > _ALONG:
            idle.append(AXES[k])
    return idle
