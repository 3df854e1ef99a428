"""How badly a team's channels fit robots that hold one rigid payload: one number for all suspicions.

Five disagreements, each over its own signal and none over zero for a true recording without noise:

- rotation: the robots' angular velocities, turned into {1} by the rotations R_1i that fit best;
- velocity: velocities of the origin of {1} by every robot, with the p_1i that fit best;
- tilt: the robots' directions of gravity in {1} [rad];
- force, moment: total force and moment in {1} against the ten inertial parameters that fit best, over the forces that
  the robots exert, and over those times their distance.

Without rotation about at least two axes, grasps are open. What is left then: angular *speeds* and the total vertical
force against one mass.

Every disagreement is put in units of what a healthy robot may show: its tolerance (``TOLERANCES``) and the noise of its
channels. The misfit is the mean of their squares: about 1 for poorly calibrated robots, hundreds for swapped channels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.grasps import pair_rotation
from estimator.identifiability import cross_information
from estimator.joint import newton_euler_regressor
from mocobot_logs.inspection.motion import Fault, Grasp

Array = NDArray[np.float64]

TOLERANCES = {
    "rotation": 0.01,
    "velocity": 0.03,
    "tilt": 0.02,
    "force": 0.03,
    "moment": 0.025,
    "angular speed": 0.01,
    "lift": 0.03,
}
"""Disagreement of robots with encoder zeros off by 1 deg, springs by 2 %, lengths by 1 mm (rad for the tilt, else over
the signal): the largest of four payloads in random, periodic and static trials, rounded up."""
SUSPICIOUS = 2.0
"""Misfit beyond which something is wrong; poorly calibrated robots stay below 1."""
FARTHEST_M = 5.0
"""Grasps farther apart than this are a wrong unit of lengths or angles."""
FAULT = 1e3
"""What a fault of all the time adds to the misfit."""
_LEAST_SPAN_M = 0.3
_TURNS = 3.0  # rotation about a second axis, over its noise, from which on grasps are determined
_RANK = 1e-6


@dataclass(frozen=True)
class Misfit:
    """How badly channels fit together.

    Attributes:
        relative: disagreements over their signals (tilt: in rad), by name.
        scaled: the same over tolerance and noise.
        faults: why the channels cannot be what they are taken for.
        determined: whether the payload turns enough to compare grasps.
        mass: mass that fits best [kg], or None.
        span: largest distance of a grasp from the first one [m], or None.
    """

    relative: dict[str, float]
    scaled: dict[str, float]
    faults: tuple[Fault, ...]
    determined: bool
    mass: float | None = None
    span: float | None = None

    @property
    def total(self) -> float:
        """Mean square of the scaled disagreements, and a large amount for every fault."""
        squares = [value**2 for value in self.scaled.values()]
        total = (float(np.mean(squares)) if squares else 0.0) + FAULT * sum(f.share for f in self.faults)
        return total if np.isfinite(total) else np.inf

    @property
    def suspicious(self) -> bool:
        """Whether robots that carry one rigid payload cannot look like this."""
        return self.total > SUSPICIOUS and self.tells

    @property
    def tells(self) -> bool:
        """Whether a misfit means anything: next to no rotation leaves noise to be compared."""
        return self.determined or bool(self.faults)


def team_misfit(
    grasps: Sequence[Grasp | None], faults: Sequence[tuple[Fault, ...]], gravity_mps2: float
) -> Misfit:
    """Compare the robots that can be told; those that cannot are faults already.

    Args:
        grasps: what every robot says, None where its posture is impossible.
        faults: the faults of every robot.
        gravity_mps2: magnitude of gravity.
    """
    every = tuple(fault for of_robot in faults for fault in of_robot)
    told = [grasp for grasp in grasps if grasp is not None]
    if not told:
        return Misfit({}, {}, every, determined=False)
    with np.errstate(all="ignore"):  # absurd channels may overflow: an infinite misfit
        omega = np.stack([g.omega for g in told], axis=1)
        noise = np.stack([g.noise for g in told]).max(axis=0)
        if not (np.all(np.isfinite(omega)) and np.all(np.isfinite([np.max(np.abs(g.wrench)) for g in told]))):
            return Misfit({}, {}, (*every, Fault(1.0, "the numbers overflow")), determined=False)
        if len(told) == 1 or _turns(omega[:, 0], float(noise[0])):
            return _rigid(told, noise, every, gravity_mps2)
        return _vertical(told, omega, noise, every, gravity_mps2)


def _turns(omega: Array, noise: float) -> bool:
    least = float(np.linalg.eigvalsh(cross_information(omega))[0])
    return bool(np.sqrt(max(least, 0.0)) > _TURNS * noise)


def _rigid(told: list[Grasp], noise: Array, faults: tuple[Fault, ...], gravity: float) -> Misfit:
    N, Q = len(told), len(told[0].omega)
    R = np.stack([pair_rotation(told[0].omega, g.omega) if k else np.eye(3) for k, g in enumerate(told)])
    omega, alpha, velocity, acceleration, up = (
        np.stack([getattr(g, name) @ R[k].T for k, g in enumerate(told)], axis=1)
        for name in ("omega", "alpha", "velocity", "acceleration", "up")
    )
    p = np.zeros((N, 3))
    for j in range(1, N):
        p[j] = _position((omega[:, 0] + omega[:, j]) / 2, velocity[:, j] - velocity[:, 0])
    w, a = omega.mean(axis=1), alpha.mean(axis=1)
    at_first = velocity - _cross(w[:, None], p)
    span = float(np.linalg.norm(p, axis=1).max())
    pairs = 3 * Q * max(N - 1, 1)
    relative, scaled = {}, {}
    if N > 1:
        spread = {
            "rotation": np.sqrt(np.sum(_apart(omega) ** 2) / pairs),
            "velocity": np.sqrt(np.sum(_apart(at_first) ** 2) / pairs),
            "tilt": np.sqrt(np.sum(_apart(up) ** 2) / (Q * (N - 1))),
        }
        signal = {"rotation": _rms(omega), "velocity": _rms(velocity), "tilt": 1.0}
        floor = {
            "rotation": noise[0],
            "velocity": np.hypot(noise[1], noise[0] * min(span, FARTHEST_M)),
            "tilt": 2.0 * noise[3],
        }
        for name, value in spread.items():
            _add(name, float(value), signal[name], floor[name], relative, scaled)
    # Total force and moment in {1} by the ten inertial parameters.
    force = np.stack([g.wrench[:, 3:] @ R[k].T for k, g in enumerate(told)], axis=1)
    moment = np.stack([g.wrench[:, :3] @ R[k].T for k, g in enumerate(told)], axis=1) + _cross(p, force)
    of_first = (acceleration - _cross(a[:, None], p) - _cross(w[:, None], _cross(w[:, None], p))).mean(axis=1)
    Y = newton_euler_regressor(w, a, of_first + gravity * up.mean(axis=1))
    reach = max(min(span, FARTHEST_M), _LEAST_SPAN_M)
    exerted = float(np.sqrt(np.mean(np.sum(np.linalg.norm(force, axis=-1), axis=1) ** 2)))
    weights = np.repeat([1.0, 1.0 / reach], 3)
    total = np.concatenate([force.sum(axis=1), moment.sum(axis=1)], axis=1)
    parameters, residual = _fit(Y * weights[:, None], total * weights)
    rms = np.sqrt(np.mean(np.sum(residual.reshape(Q, 2, 3) ** 2, axis=2), axis=0))
    for name, value in zip(("force", "moment"), rms, strict=True):
        _add(name, float(value), exerted, np.sqrt(3 * N) * noise[2], relative, scaled)
    mass = float(parameters[0])
    if mass <= 0:
        faults = (*faults, Fault(1.0, f"the forces add up to a mass of {mass:.3g} kg"))
    if span > FARTHEST_M:
        faults = (*faults, Fault(1.0, f"the grasps come out {span:.3g} m apart"))
    return Misfit(relative, scaled, faults, True, mass, span if N > 1 else None)


def _vertical(
    told: list[Grasp], omega: Array, noise: Array, faults: tuple[Fault, ...], gravity: float
) -> Misfit:
    """What can be told without any grasp frame."""
    relative, scaled = {}, {}
    speed = np.linalg.norm(omega, axis=-1)
    _add(
        "angular speed",
        _rms(_apart(speed)) * np.sqrt(len(told) / (len(told) - 1)),
        _rms(speed),
        2.0 * float(noise[0]),
        relative,
        scaled,
    )
    lift = np.sum([g.lift for g in told], axis=0)
    rise = gravity + np.mean([g.rise for g in told], axis=0)
    mass = float(lift @ rise / (rise @ rise))
    exerted = float(
        np.sqrt(np.mean(np.sum([np.linalg.norm(g.wrench[:, 3:], axis=-1) for g in told], axis=0) ** 2))
    )
    _add("lift", _rms(lift - mass * rise), exerted, np.sqrt(len(told)) * float(noise[2]), relative, scaled)
    if mass <= 0:
        faults = (*faults, Fault(1.0, f"the forces add up to a mass of {mass:.3g} kg"))
    return Misfit(relative, scaled, faults, False, mass)


def _cross(a: Array, b: Array) -> Array:
    """Cross products along the last axis; ``np.cross`` takes longer than all else together."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def _position(w: Array, difference: Array) -> Array:
    """p that best explains v_j - v_1 = w x p in {1}; shortest where it is not unique."""
    moment = np.sum(_cross(difference, w), axis=0) / len(w)
    return np.asarray(np.linalg.lstsq(cross_information(w), moment, rcond=_RANK)[0], dtype=np.float64)


def _fit(Y: Array, y: Array) -> tuple[Array, Array]:
    """Least squares of (Q, 6, 10) and (Q, 6): parameters and residuals (6 Q,)."""
    A, b = Y.reshape(-1, Y.shape[-1]), y.ravel()
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    A = A / scale
    x = np.linalg.lstsq(A.T @ A, A.T @ b, rcond=_RANK**2)[0]
    return x / scale, b - A @ x


def _add(
    name: str, value: float, signal: float, noise: float, relative: dict[str, float], scaled: dict[str, float]
) -> None:
    relative[name] = value / signal if signal > 0 else 0.0
    scaled[name] = value / max(float(np.hypot(TOLERANCES[name] * signal, noise)), 1e-300)


def _apart(x: Array) -> Array:
    """Deviation from the mean over the robots, axis 1."""
    return x - x.mean(axis=1, keepdims=True)


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
