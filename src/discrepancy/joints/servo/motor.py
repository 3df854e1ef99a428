"""Torques of drives whose logs have duties, voltages or currents of an unknown constant: as much per unit as suits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from discrepancy.joints.mechanics.nominal import inverse_torque
from discrepancy.joints.mechanics.tree import Tree
from discrepancy.joints.model import SerialModel
from discrepancy.joints.signals import Signals
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.filtering import low_pass
from mocobot_logs.joints.joint_log import JointLog

MOTOR_SHARE, MOVES_THROUGHOUT = 0.5, 0.98
"""Cut-off of the fit of what a volt is worth, over the rows', and the share of its filter's window in which the joint
moves. Chosen: noise of accelerations would make the torque look smaller than it is."""
LEAST_DRIVEN_SHARE = 0.1
"""Least share of the square of what a drive was given that the model's torque accounts for. Chosen: nobody can tell
what a volt is worth at a joint that only rubs."""


@dataclass(frozen=True)
class Motor:
    """What a drive gives per unit of what the logs have.

    Attributes:
        joint: which, from 0.
        torque_per_unit: at standstill, at the joint [N m or N per ``unit``].
        unit: ``V``, ``full duty`` or ``A``.
    """

    joint: int
    torque_per_unit: float
    unit: str

    def sentence(self, name: str) -> str:
        """What is to be said of it."""
        speed = "" if self.unit == "A" else "; what that loses to speed counts as viscous, or as back-EMF"
        return (
            f"Torques of joint {name} are taken as {self.torque_per_unit:.4g} (N m, or N of a slide) per {self.unit} "
            f"that its drive was given, as the model's masses have it{speed}."
        )


def with_torques(
    model: SerialModel, logs: Sequence[JointLog]
) -> tuple[tuple[JointLog, ...], tuple[Motor, ...]]:
    """The logs with torques of every joint that has a duty or a current in all of them, and what these are worth.

    A voltage gives a torque at standstill that is in proportion to it; what it loses to the speed (back-EMF) is left to
    the causes. How much per volt follows from the model: with masses as drawn, or as wrong as these are.

    Args:
        model: the robot as described.
        logs: of it, those of the reference included.

    Raises:
        InputError: a drive does not go with what the model asks for.
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
    """Which joints' torques come from a voltage or a duty, so that speed costs torque, shape (J,)."""
    out = np.zeros(joints, dtype=bool)
    out[[motor.joint for motor in motors if motor.unit != "A"]] = True
    return out


def _raw(logs: Sequence[JointLog], joints: int) -> tuple[list[Array], list[str]]:
    """What drives of unknown constants were given in every log (Q, J), and its unit; empty where torques are known."""
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
    """By least squares: what the drive was given is torque over its constant, plus friction, back-EMF, rotor, offset.

    Friction by load is among them, or a servo that mostly lifts would seem to give less. At rest friction is anything.
    """
    left, right = [], []
    for s in signals:
        side, load, speed = np.clip(s.dq[:, j] / s.slow[j], -1.0, 1.0), s.inverse[:, j], s.dq[:, j]
        on = np.ones(len(speed)) if s.enabled is None else s.enabled
        cutoff = MOTOR_SHARE * s.cutoff_hz
        # Noise has no sign, and would be a load where there is none.
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
            "`mocobot inspect` looks for wrong signs and joints"
        )
    return Motor(j, float(1.0 / found[0]), unit)
