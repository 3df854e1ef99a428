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

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array
from estimator.so3 import cross
from estimator.statistics import rms
from mocobot_inspect.wiring.motion import Fault, Grasp
from mocobot_inspect.wiring.rigid_body import FARTHEST_M, Body, rigid_body

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
FAULT = 1e3
"""What a fault of all the time adds to the misfit."""
RIGID = ("rotation", "velocity", "tilt", "force", "moment")
_LEAST_SPAN_M = 0.3
_RANK = 1e-12


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
        parts: number of disagreements that there are, those included that were left out.
    """

    relative: dict[str, float]
    scaled: dict[str, float]
    faults: tuple[Fault, ...]
    determined: bool
    mass: float | None = None
    span: float | None = None
    parts: int | None = None

    @property
    def total(self) -> float:
        """Mean square of the scaled disagreements, and a large amount for every fault."""
        squares = [value**2 for value in self.scaled.values()]
        mean = sum(squares) / (self.parts or len(squares)) if squares else 0.0
        total = mean + FAULT * sum(f.share for f in self.faults)
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
    grasps: Sequence[Grasp | None],
    faults: Sequence[tuple[Fault, ...]],
    gravity_mps2: float,
    body: Body | None = None,
    enough: float = np.inf,
    most_noise: Array | None = None,
) -> Misfit:
    """Compare the robots that can be told; those that cannot are faults already.

    Args:
        grasps: what every robot says, None where its posture is impossible.
        faults: the faults of every robot.
        gravity_mps2: magnitude of gravity.
        body: motion of the payload, where it is known from the same grasps.
        enough: a misfit beyond this need not be exact: forces are left out once the motion alone makes it as large.
        most_noise: bound of the noise, as in ``Grasp``: what makes noise of the signals explains nothing.
    """
    every = tuple(fault for of_robot in faults for fault in of_robot)
    told = [grasp for grasp in grasps if grasp is not None]
    if not told:
        return Misfit({}, {}, every, determined=False)
    with np.errstate(all="ignore"):  # absurd channels may overflow: an infinite misfit
        body = body or rigid_body(told, most_noise)
        if body is None:
            return Misfit({}, {}, (*every, Fault(1.0, "the numbers overflow")), determined=False)
        if len(told) > 1 and not body.turns:
            return _vertical(told, body, every, gravity_mps2)
        if body.span > FARTHEST_M:
            every = (*every, Fault(1.0, f"the grasps come out {body.span:.3g} m apart"))
        relative, scaled = {}, {}
        for name, (value, signal, noise) in body.spread.items():
            _add(name, value, signal, noise, relative, scaled)
        bound = Misfit(relative, scaled, every, determined=True, parts=len(RIGID))
        if bound.total > enough:
            return bound
        return _balanced(told, body, bound, gravity_mps2)


def _balanced(told: list[Grasp], body: Body, motion: Misfit, gravity: float) -> Misfit:
    """Total force and moment in {1} by the ten inertial parameters."""
    N, Q = len(told), len(told[0].omega)
    force = np.stack([g.force @ R.T for g, R in zip(told, body.R_1i, strict=True)])
    moment = cross(body.p_1i[:, None], force)
    reach = max(min(body.span, FARTHEST_M), _LEAST_SPAN_M)
    weights = np.repeat([1.0, 1.0 / reach], 3)
    total = np.concatenate([force.sum(axis=0), moment.sum(axis=0)], axis=1)
    parameters, residual = _fit(body.regressor(gravity) * weights[:, None], total * weights)
    rms = np.sqrt(np.mean(np.sum(residual.reshape(Q, 2, 3) ** 2, axis=2), axis=0))
    exerted = float(np.sqrt(np.mean(np.sum(np.sqrt(np.sum(force**2, axis=-1)), axis=0) ** 2)))
    relative, scaled, faults = dict(motion.relative), dict(motion.scaled), motion.faults
    for name, value in zip(("force", "moment"), rms, strict=True):
        _add(name, float(value), exerted, float(np.sqrt(3 * N) * body.noise[2]), relative, scaled)
    mass = float(parameters[0])
    if mass <= 0:
        faults = (*faults, Fault(1.0, f"the forces add up to a mass of {mass:.3g} kg"))
    return Misfit(relative, scaled, faults, True, mass, body.span if N > 1 else None)


def _vertical(told: list[Grasp], body: Body, faults: tuple[Fault, ...], gravity: float) -> Misfit:
    """What can be told without any grasp frame."""
    relative, scaled = {}, {}
    speed = np.stack([np.linalg.norm(g.omega, axis=1) for g in told])
    apart = rms(speed - speed.mean(axis=0)) * np.sqrt(len(told) / (len(told) - 1))
    _add("angular speed", float(apart), rms(speed), 2.0 * float(body.noise[0]), relative, scaled)
    lift = np.sum([g.lift for g in told], axis=0)
    rise = gravity + np.mean([g.rise for g in told], axis=0)
    mass = float(lift @ rise / (rise @ rise))
    exerted = rms(np.sum([np.linalg.norm(g.force, axis=-1) for g in told], axis=0))
    noise = float(np.sqrt(len(told)) * body.noise[2])
    _add("lift", rms(lift - mass * rise), exerted, noise, relative, scaled)
    if mass <= 0:
        faults = (*faults, Fault(1.0, f"the forces add up to a mass of {mass:.3g} kg"))
    return Misfit(relative, scaled, faults, False, mass)


def _fit(Y: Array, y: Array) -> tuple[Array, Array]:
    """Least squares of (Q, 6, 10) and (Q, 6): parameters and residuals (6 Q,)."""
    A, b = Y.reshape(-1, Y.shape[-1]), y.ravel()
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
    A = A / scale
    x = np.linalg.lstsq(A.T @ A, A.T @ b, rcond=_RANK)[0]
    return x / scale, b - A @ x


def _add(
    name: str, value: float, signal: float, noise: float, relative: dict[str, float], scaled: dict[str, float]
) -> None:
    relative[name] = value / signal if signal > 0 else 0.0
    scaled[name] = value / max(float(np.hypot(TOLERANCES[name] * signal, noise)), 1e-300)
