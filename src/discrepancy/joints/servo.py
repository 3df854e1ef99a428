"""Drives without torque readings: torque per voltage or current, and the proportional law of a position loop."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.ndimage import maximum_filter1d

from discrepancy.joints.mechanics import Tree, inverse_torque
from discrepancy.joints.model import SerialModel
from discrepancy.joints.signals import Signals
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.filtering import low_pass
from estimator.statistics import measured
from mocobot_logs.joints.joint_log import JointLog

MOTOR_SHARE, MOVES_THROUGHOUT = 0.5, 0.98
"""Cut-off of the fit relative to the rows; minimum share of the filter's window in which the joint must move."""
LEAST_DRIVEN_SHARE = 0.1
"""Least share of the squared drive input that the modelled torque must explain; below it, friction dominates."""


@dataclass(frozen=True)
class Motor:
    """Torque of a drive per unit of its logged input.

    Attributes:
        joint: index, from 0.
        torque_per_unit: at the joint and at zero speed [N m or N per ``unit``].
        unit: ``V``, ``full duty`` or ``A``.
    """

    joint: int
    torque_per_unit: float
    unit: str

    def sentence(self, name: str) -> str:
        """A sentence for the notes of a diagnosis."""
        speed = "" if self.unit == "A" else "; what that loses to speed counts as viscous, or as back-EMF"
        return (
            f"Torques of joint {name} are taken as {self.torque_per_unit:.4g} (N m, or N of a slide) per {self.unit} "
            f"that its drive was given, as the model's masses have it{speed}."
        )


def with_torques(
    model: SerialModel, logs: Sequence[JointLog]
) -> tuple[tuple[JointLog, ...], tuple[Motor, ...]]:
    """Add torques to the logs for joints with only a duty or a current, and return the identified motors.

    The torque at zero speed is proportional to the voltage. The loss with speed (back-EMF) is left to the causes. The
    torque per volt follows from the model's masses, so it inherits their common scale error.

    Args:
        model: the robot as described.
        logs: all logs of the robot, with those of the reference.

    Raises:
        InputError: the input of a drive does not correlate with the modelled torque.
    """
    raw, unit = _raw(logs, len(model.joints))
    unknown = [j for j, name in enumerate(unit) if name]
    if not unknown:
        return tuple(logs), ()
    tree, inverse = Tree.of(model.model), partial(inverse_torque, model.model)
    signals = [
        Signals.of(replace(log, torque=own), tree, inverse) for log, own in zip(logs, raw, strict=True)
    ]
    motors = [_motor(signals, j, unit[j], model.joints[j]) for j in unknown]
    out = []
    for log, own in zip(logs, raw, strict=True):
        torque = np.full(log.q.shape, np.nan) if log.torque is None else log.torque.copy()
        for motor in motors:
            torque[:, motor.joint] = own[:, motor.joint] * motor.torque_per_unit
        out.append(replace(log, torque=torque))
    return tuple(out), tuple(motors)


def driven_by_voltage(motors: Sequence[Motor], joints: int) -> np.ndarray:
    """Whether a joint's torque comes from a voltage or a duty and so falls with speed, shape (J,)."""
    out = np.zeros(joints, dtype=bool)
    out[[motor.joint for motor in motors if motor.unit != "A"]] = True
    return out


def _raw(logs: Sequence[JointLog], joints: int) -> tuple[list[Array], list[str]]:
    """Logged inputs (Q, J) of each log, and the unit of each joint's input; an empty unit if torques are known."""
    volts = all(log.drive.supply_V is not None for log in logs)
    unit = []
    for j in range(joints):
        told = [log.torque is not None and bool(np.isfinite(log.torque[:, j]).any()) for log in logs]
        free = [bool(np.isnan(log.drive.torque_constant[j])) for log in logs]
        duty = [log.drive.duty is not None and bool(np.isfinite(log.drive.duty[:, j]).any()) for log in logs]
        if all(told) and not any(free):
            unit.append("")
        elif all(told):
            unit.append("A")
        elif all(duty):
            unit.append("V" if volts else "full duty")
        else:
            unit.append("")
    raw = []
    for log in logs:
        own = np.full(log.q.shape, np.nan) if log.torque is None else log.torque.copy()
        for j, name in enumerate(unit):
            if name in ("V", "full duty") and log.drive.duty is not None:
                supply = log.drive.supply_V if name == "V" else None
                own[:, j] = log.drive.duty[:, j] * (1.0 if supply is None else supply)
        raw.append(own)
    return raw, unit


def _motor(signals: Sequence[Signals], j: int, unit: str, name: str) -> Motor:
    """Identify a motor by least squares: input = torque / constant + friction + back-EMF + rotor inertia + offset.

    Load-dependent friction is included because it would bias a joint that mostly lifts. Samples at rest are left out:
    friction at rest is indeterminate.
    """
    left, right = [], []
    for s in signals:
        side, load, speed = np.clip(s.dq[:, j] / s.slow[j], -1.0, 1.0), s.inverse[:, j], s.dq[:, j]
        on = np.ones(len(speed)) if s.enabled is None else s.enabled
        cutoff = MOTOR_SHARE * s.cutoff_hz
        # Filter: noise has no direction and would add to the absolute load.
        passed = np.abs(low_pass(load, s.rate_hz, cutoff))
        each = [
            load,
            side,
            passed * side,
            speed,
            on * speed,
            s.ddq[:, j],
            np.ones(len(speed)),
            s.torque[:, j],
        ]
        smooth = low_pass(np.column_stack(each), s.rate_hz, cutoff)
        moves = (s.usable[:, j] & (np.abs(speed) > s.slow[j])).astype(float)
        at = low_pass(moves[:, None], s.rate_hz, cutoff)[:, 0] > MOVES_THROUGHOUT
        left.append(smooth[at, :-1])
        right.append(smooth[at, -1])
    A, b = np.concatenate(left), np.concatenate(right)
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    found = np.linalg.lstsq(A / size, b, rcond=None)[0] / size
    part = found[0] * A[:, 0]
    if found[0] <= 0 or np.sum(part**2) < LEAST_DRIVEN_SHARE * np.sum(b**2):
        raise InputError(
            f"{signals[0].log.name}: the drive of joint {name} does not go with the torque that the model asks for; "
            "`mocobot inspect LOG --model ROBOT` looks for wrong signs and joints, and motion at several frequencies "
            "tells gravity from inertia"
        )
    return Motor(j, float(1.0 / found[0]), unit)


MOST_LOOP_SHARE = 0.1
"""Largest share of the duty's variance that a loop's law may leave. Chosen: beyond it, the loop is of another type."""
LATE_S = 1e-3
"""Least delay of a loop that is reported [s]. Chosen: the timestamps of a bus are no better."""
CUT_OFF_SHARE, LEAST_CUT_OFF, CUT_OFF_SAMPLES = 0.97, 0.003, 7
"""Saturation: share of the largest duty that counts, least share of time above it, samples to exclude around it."""
LOOP_STRETCH_S = 1.0
"""Length of the stretches whose scatter gives standard errors [s]. Chosen: longer than a loop's memory."""
LEAST_ROWS = 40
"""Least number of rows to fit a loop. Chosen."""


@dataclass(frozen=True)
class LoopLaw:
    """Proportional position loop of one joint: output = ``per_rad`` * error(t - ``late_s``) + offset, within ``limit``.

    Attributes:
        joint: index, from 0.
        gain: position gain in the map; NaN if unknown.
        per_rad: output per rad or m of error.
        se: its standard error, from the scatter between one-second stretches.
        late_s: delay of the loop, with that of the readings [s].
        offset: in the output's unit.
        limit: output at saturation; inf if it never saturates.
        left: rms residual, in the output's unit.
        share: residual variance over the output's variance.
        logs: number of logs in the fit.
    """

    joint: int
    gain: float
    per_rad: float
    se: float
    late_s: float
    offset: float
    limit: float
    left: float
    share: float
    logs: int


def loop_laws(logs: Sequence[JointLog]) -> list[LoopLaw]:
    """Fit the loops of all joints with a position command and a duty, one law for each gain.

    Args:
        logs: logs of one robot; those without position commands are ignored.
    """
    told = [log for log in logs if _commanded(log)]
    if not told:
        return []
    laws = []
    for j in range(len(told[0].joints)):
        by_gain: dict[float, list[JointLog]] = {}
        for log in told:
            if log.command is not None and log.drive.duty is not None:
                here = np.isfinite(log.command[:, j]) & np.isfinite(log.drive.duty[:, j])
                if here.any():
                    gain = float(log.drive.position_gain[j])
                    by_gain.setdefault(-1.0 if np.isnan(gain) else gain, []).append(log)
        for gain, own in sorted(by_gain.items()):
            law = _law(own, j, gain if gain > 0 else np.nan)
            if law is not None:
                laws.append(law)
    return laws


def sentences(laws: Sequence[LoopLaw], joints: Sequence[str]) -> Iterator[str]:
    """Sentences on the loops for the notes of a diagnosis, one for each joint.

    Args:
        laws: result of ``loop_laws``.
        joints: joint names.
    """
    for j in dict.fromkeys(law.joint for law in laws):
        own = [law for law in laws if law.joint == j]
        good = [law for law in own if law.share < MOST_LOOP_SHARE]
        if not good:
            yield f"Loop of joint {joints[j]}: its duty does not go with the error of its position."
            continue
        said = ", ".join(_said(law) for law in good)
        per_gain = np.array([law.per_rad / law.gain for law in good])
        more = ""
        if len(good) > 1 and np.isfinite(per_gain).all():
            off = np.ptp(per_gain) / per_gain.mean()
            more = f"; {per_gain.mean():.4g} per rad and unit of gain, the same within {100.0 * off:.1f} %"
        late, left = float(np.median([law.late_s for law in good])), max(law.left for law in good)
        delay = f"is {1e3 * late:.1f} ms late and " if abs(late) > LATE_S else ""
        yield f"Loop of joint {joints[j]}: {said}{more}. It {delay}leaves {left:.2g} of full duty at most (rms)."


def _said(law: LoopLaw) -> str:
    value, se = measured(law.per_rad, law.se)
    at = "" if np.isnan(law.gain) else f" at gain {law.gain:g}"
    cut = "" if np.isinf(law.limit) else f" (cut off at {law.limit:.3g})"
    return f"{value} +- {se} of full duty per rad of error{at}{cut}"


def _commanded(log: JointLog) -> bool:
    return log.drive.command == "position" and log.command is not None and log.drive.duty is not None


def _law(logs: Sequence[JointLog], j: int, gain: float) -> LoopLaw | None:
    peak = min(max(float(np.nanmax(np.abs(_duty(log, j)))) for log in logs), 1.0)  # resampling can overshoot
    rows, outputs, stretches, every = [], [], [], []
    for log in logs:
        assert log.command is not None
        error, duty = log.command[:, j] - log.q[:, j], _duty(log, j)
        rate = np.gradient(error, log.period_s)
        here = log.usable & np.isfinite(error) & np.isfinite(duty)
        if log.enabled is not None:
            here &= log.enabled
        here[[0, -1]] = False
        columns = np.column_stack([error, -rate, np.ones(len(error))])
        every.append(columns[here])
        # Leave out samples that may be saturated.
        here &= maximum_filter1d(np.abs(duty), CUT_OFF_SAMPLES) < CUT_OFF_SHARE * peak
        rows.append(columns[here])
        outputs.append(duty[here])
        start = stretches[-1].max(initial=0) + 1 if stretches else 0
        stretches.append((start + log.time / LOOP_STRETCH_S).astype(int)[here])
    A, b, stretch = np.concatenate(rows), np.concatenate(outputs), np.concatenate(stretches)
    if len(b) < LEAST_ROWS or np.linalg.matrix_rank(A) < A.shape[1]:
        return None
    normal = np.linalg.inv(A.T @ A)
    found = normal @ (A.T @ b)
    left = b - A @ found
    scores = np.array([A[stretch == k].T @ left[stretch == k] for k in np.unique(stretch)])
    covariance = normal @ (scores.T @ scores) @ normal
    beyond = np.abs(np.concatenate(every) @ found) > peak / CUT_OFF_SHARE
    cut = np.mean(beyond) > LEAST_CUT_OFF
    share = float(np.sum(left**2) / max(np.sum((b - b.mean()) ** 2), 1e-300))
    return LoopLaw(
        j, gain, float(found[0]), float(np.sqrt(covariance[0, 0])), float(found[1] / found[0]), float(found[2]),
        peak if cut else np.inf, float(np.sqrt(np.mean(left**2))), share, len(logs),
    )  # fmt: skip


def _duty(log: JointLog, j: int) -> Array:
    assert log.drive.duty is not None
    return log.drive.duty[:, j]


@dataclass(frozen=True)
class Servo:
    """Position loop of one joint: output = ``per_rad`` (command - position) - ``damping`` velocity, within ``limit``.

    Attributes:
        joint: index, from 0.
        per_rad: output per rad or m of error.
        damping: output per rad/s or m/s.
        limit: largest absolute output.
        torque: torque per unit of output at zero speed [N m or N].
        by_supply: whether ``torque`` is per volt of supply, because the output is a duty.
    """

    joint: int
    per_rad: float
    damping: float
    limit: float
    torque: float
    by_supply: bool


def servo_of(
    log: JointLog, j: int, motors: Sequence[Motor], laws: Sequence[LoopLaw], name: str
) -> Servo | str:
    """Build the loop of a joint from the map's gains or, for firmware gains, from fitted laws; or return why it cannot.

    Args:
        log: the log with the commands.
        j: index of the joint, from 0.
        motors: torque per unit of duty of drives without torque readings.
        laws: loops fitted to logs other than the simulated one.
        name: name of the joint.
    """
    drive = log.drive
    if drive.command != "position":
        said = "no command is logged" if drive.command == "none" else f"it is commanded a {drive.command}"
        return f"joint {name}: {said}, and the loop that is simulated is a position's"
    if log.command is None or not np.isfinite(log.command[:, j]).any():
        return f"joint {name}: no command is logged"
    if any(
        x is not None and np.nan_to_num(x[:, j]).any() for x in (drive.feedforward, drive.command_velocity)
    ):
        return f"joint {name}: it is told a torque or a velocity beside its position, which is not simulated"
    gain, damping, limit = (float(x[j]) for x in (drive.position_gain, drive.velocity_gain, drive.limit))
    damping = 0.0 if np.isnan(damping) else damping
    limit = np.inf if np.isnan(limit) else limit
    if drive.gain_of == "torque":
        if np.isnan(gain):
            return f"joint {name}: the map has no position_gain"
        return Servo(j, gain, damping, limit, 1.0, by_supply=False)
    if drive.gain_of == "velocity":
        return f"joint {name}: what torque its velocity loop gives is not known"
    motor = next((motor for motor in motors if motor.joint == j and motor.unit != "A"), None)
    if motor is None:
        return f"joint {name}: what torque a duty gives is not known"
    if drive.gain_of == "firmware" or np.isnan(gain):
        per_rad = _fitted(laws, j, gain)
        if per_rad is None:
            return f"joint {name}: the duties of other logs tell no law of its loop"
        gain, damping = per_rad, 0.0
    return Servo(j, gain, damping, min(limit, 1.0), motor.torque_per_unit, by_supply=motor.unit == "V")


def _fitted(laws: Sequence[LoopLaw], j: int, gain: float) -> float | None:
    """Output per rad at a gain: fitted at this gain, or else scaled from fits at other gains."""
    good = [law for law in laws if law.joint == j and law.share < MOST_LOOP_SHARE]
    same = [law.per_rad for law in good if law.gain == gain or (np.isnan(law.gain) and np.isnan(gain))]
    if same:
        return same[0]
    each = [law.per_rad / law.gain for law in good if np.isfinite(law.gain)]
    return float(np.mean(each)) * gain if each and np.isfinite(gain) else None


@dataclass(frozen=True, eq=False)
class Commanded:
    """Torques of servos that follow the commands of a log, on the scale of its logged torques.

    Attributes:
        servos: loops of the joints that have one.
        time: equidistant sample times [s], shape (Q,).
        command: held from sample to sample, shape (Q, J).
        supply_V: shape (Q,); 1 if no servo needs it.
        on: whether the drives are on, shape (Q,).
        late: delay of the commands, shape (J,) [s].
    """

    servos: tuple[Servo, ...]
    time: Array
    command: Array
    supply_V: Array
    on: Array
    late: Array

    @classmethod
    def of(cls, log: JointLog, servos: Sequence[Servo], late: Array | None = None) -> Commanded:
        """Build from the commands of a log; ``late`` has their delays, none if it is missing."""
        assert log.command is not None
        count = len(log.time)
        on = np.ones(count) if log.enabled is None else log.enabled.astype(float)
        supply = np.ones(count) if log.drive.supply_V is None else log.drive.supply_V
        late = np.zeros(log.q.shape[1]) if late is None else late
        return cls(tuple(servos), log.time, log.command, supply, on, late)

    def sample(self, time: float) -> int:
        """Index of the sample held at a time."""
        # The tolerance prevents rounding from selecting the previous sample.
        k = int((time - self.time[0]) / (self.time[1] - self.time[0]) + 1e-6)
        return min(max(k, 0), len(self.time) - 1)

    def told(self, time: float, q: Array, dq: Array) -> Array:
        """Torques of the servos [N m or N], shape (J,); 0 for joints without one."""
        k, out = self.sample(time), np.zeros(len(q))
        for servo in self.servos:
            j = servo.joint
            command = self.command[self.sample(time - self.late[j]), j]
            output = servo.per_rad * (command - q[j]) - servo.damping * dq[j]
            output = min(max(output, -servo.limit), servo.limit)
            out[j] = self.on[k] * servo.torque * output * (self.supply_V[k] if servo.by_supply else 1.0)
        return out
