"""Signals of a team that an error may be a function of."""

from __future__ import annotations

import numpy as np

from discrepancy.team.laws.variable import TIME, Kind, Variable
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.motion import PHI, PHI_DDOT, PHI_DOT, TAU, THETA, THETA_DDOT, THETA_DOT
from estimator.arrays import Array

_JOINTS: dict[str, tuple[slice, str, str, str, Kind]] = {
    "phi": (PHI, "angle of driven joint {j} of robot {i}", "phi", "rad", "angle"),
    "phi_rate": (PHI_DOT, "rate of driven joint {j} of robot {i}", "phi'", "rad/s", "rate"),
    "phi_acceleration": (PHI_DDOT, "acceleration of driven joint {j} of robot {i}", "phi''", "rad/s^2", "acceleration"),
    "theta": (THETA, "angle of gimbal axis {j} of robot {i}", "theta", "rad", "angle"),
    "theta_rate": (THETA_DOT, "rate of gimbal axis {j} of robot {i}", "theta'", "rad/s", "rate"),
    "theta_acceleration": (
        THETA_DDOT, "acceleration of gimbal axis {j} of robot {i}", "theta''", "rad/s^2", "acceleration",
    ),
    "tau": (TAU, "torque of driven joint {j} of robot {i}", "tau", "N m", "torque"),
}  # fmt: skip
_PAYLOAD: dict[str, tuple[str, str, str, Kind]] = {
    "payload_position": ("position of the payload along {axis}", "p", "m", "position"),
    "payload_velocity": ("velocity of the payload along {axis}", "v", "m/s", "velocity"),
    "payload_acceleration": ("acceleration of the payload along {axis}", "a", "m/s^2", "acceleration"),
    "payload_felt": (
        "acceleration that the payload feels, less gravity, along its {axis}", "f", "m/s^2", "acceleration",
    ),
    "payload_rate": ("turn rate of the payload about its {axis}", "omega", "rad/s", "rate"),
    "payload_turn": ("turn acceleration of the payload about its {axis}", "alpha", "rad/s^2", "acceleration"),
    "payload_up": ("tilt of the payload, component of up along its {axis}", "up", "1", "tilt"),
}  # fmt: skip


def joint_variable(name: str, robot: int, joint: int) -> Variable:
    """A signal of one joint (robot and joint from 1)."""
    _, words, symbol, unit, kind = _JOINTS[name]
    said = words.format(i=robot, j=joint)
    return Variable(f"{name}_{robot}_{joint}", said, f"{symbol}_{robot}{joint}", unit, kind)


def payload_variable(name: str, axis: str) -> Variable:
    """A signal of the payload: position and velocity in {b1}, the others in {1}."""
    words, symbol, unit, kind = _PAYLOAD[name]
    return Variable(f"{name}_{axis}", words.format(axis=axis), f"{symbol}_{axis}", unit, kind)


def payload_felt() -> Variable:
    """What something in the payload feels, wherever it sits."""
    parts, turns = (
        tuple(payload_variable(n, axis) for axis in "xyz") for n in ("payload_felt", "payload_turn")
    )
    words = "acceleration felt in the payload, less gravity"
    return Variable("payload_felt", words, "f", parts[0].unit, "vector", parts=parts, turns=turns)


def signals_of(linear: TrialLinear) -> dict[str, Array]:
    """Values of all of them in one trial, shape (Q,) each."""
    signals, out = linear.signals, {TIME.name: linear.signals.time - linear.signals.time[0]}
    for name, (slots, *_) in _JOINTS.items():
        for i in range(linear.robots):
            for j in range(3):
                out[f"{name}_{i + 1}_{j + 1}"] = linear.s[:, i, slots][:, j]
    motion = linear.motion
    position = linear.data.p_bi[:, 0]
    vectors = {
        "payload_position": position,
        "payload_velocity": signals.with_rates(position)[1],
        "payload_acceleration": motion.acceleration,
        "payload_felt": motion.acceleration + linear.data.gravity_mps2 * motion.up,
        "payload_rate": motion.omega,
        "payload_turn": motion.alpha,
        "payload_up": motion.up,
    }
    for name, vector in vectors.items():
        for axis, values in zip("xyz", np.asarray(vector).T, strict=True):
            out[f"{name}_{axis}"] = np.ascontiguousarray(values)
    return out
