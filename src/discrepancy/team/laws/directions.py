"""What an error at a place does to the residual at every row: through its value, rate and acceleration."""

from __future__ import annotations

import numpy as np

from discrepancy.team.laws.place import Place
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.dynamics import moment_about_axes
from estimator.arm.motion import PHI, PHI_DDOT, PHI_DOT, TAU, THETA, THETA_DDOT, THETA_DOT
from estimator.arrays import Array


def directions_at(linear: TrialLinear, place: Place) -> Array:
    """Residual per unit of an error, its rate and its acceleration, shape (n, components, 3 or 1, C).

    Args:
        linear: the trial.
        place: one of ``places.places_of``.

    The direction at a row is that in its middle: an error changes faster than how it shows.
    """
    at = linear.reduction.sample
    robot, joint = (place.robot or 1) - 1, (place.joint or 1) - 1
    if place.name in ("phi reading", "theta reading"):
        slots = (PHI, PHI_DOT, PHI_DDOT) if place.name == "phi reading" else (THETA, THETA_DOT, THETA_DDOT)
        J = [linear.J.at(robot, kind, at)[..., joint] for kind in slots]
        return np.stack(J, axis=1)[:, None]
    if place.name in ("tau reading", "driven torque"):
        sign = 1.0 if place.name == "tau reading" else -1.0  # a torque beside the spring is not read
        return sign * linear.J.at(robot, TAU, at)[:, None, None, :, joint]
    if place.name == "gimbal torque":
        moment = moment_about_axes(linear.s[at][:, robot, THETA], np.eye(3)[joint])
        moment = moment @ linear.shared.grasps.R_1i[robot].T
        return _wrench(linear, np.zeros_like(moment), moment)[:, None, None]
    if place.name in ("base position", "grasp position"):
        turned = linear.bases.R[robot] if place.name == "base position" else None
        return np.stack([_moved(linear, robot, axis, turned) for axis in np.eye(3)], axis=1)
    return np.stack(list(_of_payload(linear, place.name)), axis=1)


def _wrench(linear: TrialLinear, force: Array, moment: Array) -> Array:
    """Residual of an outside wrench on the payload at the origin of {1}, in {1}, (n, 3) each: shape (n, C)."""
    out = np.zeros((len(force), linear.channels))
    out[:, -6:-3], out[:, -3:] = -force, -moment
    return out


def _moved(linear: TrialLinear, robot: int, axis: Array, base: Array | None) -> Array:
    """Residual of a displacement of a grasp frame as seen from {b1}, by value, rate and acceleration, (n, 3, C).

    Args:
        linear: the trial.
        robot: from 0.
        axis: along which, shape (3,): of the robot's {b}, or of its grasp frame {i}.
        base: axes of the robot's base in {b1}; None for an axis of {i}.
    """
    at = linear.reduction.sample
    displacement = (
        np.tile(base @ axis, (len(at), 1))
        if base is not None
        else linear.data.R_bi[at][:, 0] @ (linear.shared.grasps.R_1i[robot] @ axis)
    )
    out = np.zeros((len(at), 3, linear.channels))
    for i in range(1, linear.robots):
        sign = 1.0 if robot == 0 else -1.0 if robot == i else 0.0
        out[:, 0, 6 * (i - 1) + 3 : 6 * i] = sign * displacement
    wrist = -displacement @ linear.bases.R[robot]
    by_wrist = linear.by_wrist[robot][at]
    out[:, 1, -6:] = np.einsum("nij,nj->ni", by_wrist[..., :3], wrist)
    out[:, 2, -6:] = np.einsum("nij,nj->ni", by_wrist[..., 3:], wrist)
    return out


def _of_payload(linear: TrialLinear, name: str) -> list[Array]:
    """Residual of every component of an error of the payload, shape (n, 3 or 1, C) each."""
    at = linear.reduction.sample
    motion = linear.motion
    R = linear.data.R_bi[at][:, 0]
    com = linear.shared.pi[1:4] / linear.shared.pi[0]
    none = np.zeros((len(at), 3))
    omega, alpha = motion.omega[at], motion.alpha[at]
    # Acceleration of the origin of {1} less gravity, in {1}.
    felt = motion.acceleration[at] + linear.data.gravity_mps2 * motion.up[at]
    if name == "force on payload":
        forces = [R[:, k] for k in range(3)]  # unit vector k of {b1}, in {1}
        return [
            *(_wrench(linear, f, _cross(com, f))[:, None] for f in forces),
            *(_wrench(linear, none, f)[:, None] for f in forces),
        ]
    if name == "payload mass":  # a point mass at the centre that is known of
        needed = felt + _cross(alpha, com) + _cross(omega, _cross(omega, com))
        return [_wrench(linear, -needed, -_cross(com, needed))[:, None]]
    axes = [np.tile(axis, (len(at), 1)) for axis in np.eye(3)]
    if name == "payload centre":
        # d/dt^2 of R c m, and gravity's moment: value, rate and acceleration of the first moment in {1}.
        return [
            np.stack(
                [
                    _wrench(linear, -(_cross(alpha, e) + _cross(omega, _cross(omega, e))), -_cross(e, felt)),
                    _wrench(linear, -2.0 * _cross(omega, e), none),
                    _wrench(linear, -e, -_cross(com, e)),
                ],
                axis=1,
            )
            for e in axes
        ]  # fmt: skip
    # Angular momentum fixed in the payload: its change is omega x h.
    return [_wrench(linear, none, -_cross(omega, e))[:, None] for e in axes]


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(np.cross(a, b), dtype=np.float64)
