"""One rigid motion that fits what all robots say of their grasps best, and what they disagree by."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from estimator.arrays import Array
from estimator.estimate.uncertainty import FACTOR, cross_information
from estimator.rigid_team import newton_euler_regressor
from estimator.so3 import chordal_mean, cross
from estimator.statistics import rms
from mocobot_inspect.wiring.motion import Grasp

FARTHEST_M = 5.0
"""Grasps farther apart than this are a wrong unit of lengths or angles."""
_RANK = 1e-6


@dataclass(frozen=True, eq=False)
class Body:
    """Motion of the payload in {1}.

    Attributes:
        R_1i, p_1i: grasp frames, shapes (N, 3, 3), (N, 3) [m].
        omega, alpha: mean angular velocity [rad/s] and acceleration [rad/s^2], shape (Q, 3).
        acceleration: of the origin of {1}, mean [m/s^2], shape (Q, 3).
        up: mean direction against gravity, shape (Q, 3).
        noise: as in ``Grasp``, the largest of all robots.
        turns: whether it turns about two axes, clearly above the noise.
        spread: disagreements of the robots, each with its signal and its noise; none for one robot.
    """

    R_1i: Array
    p_1i: Array
    omega: Array
    alpha: Array
    acceleration: Array
    up: Array
    noise: Array
    turns: bool
    spread: dict[str, tuple[float, float, float]]

    @cached_property
    def span(self) -> float:
        """Largest distance of a grasp from the first one [m]."""
        return float(np.linalg.norm(self.p_1i, axis=1).max())

    def regressor(self, gravity_mps2: float) -> Array:
        """Total force and moment in {1} by the ten inertial parameters, shape (Q, 6, 10)."""
        if "Y" not in self.__dict__:
            specific = self.acceleration + gravity_mps2 * self.up
            self.__dict__["Y"] = newton_euler_regressor(self.omega, self.alpha, specific)
        return self.__dict__["Y"]


def rigid_body(told: Sequence[Grasp], most_noise: Array | None = None) -> Body | None:
    """The motion that fits best, or None where no robot tells or the numbers overflow.

    Rotations by Wahba's problem (paper, (3)-(5)), positions by linear least squares (6)-(8), both against robot 1.

    Args:
        told: what the robots say, the first one being {1}.
        most_noise: bound of the noise, as in ``Grasp``.
    """
    if not told or not all(np.isfinite(np.sum(g.force)) and np.isfinite(np.sum(g.omega)) for g in told):
        return None
    N, Q = len(told), len(told[0].omega)
    R = np.stack([np.eye(3), *(rotation_onto(told[0].omega, g.omega) for g in told[1:])])
    omega, alpha, velocity, acceleration, up = (
        np.stack([getattr(g, name) @ R[k].T for k, g in enumerate(told)])
        for name in ("omega", "alpha", "velocity", "acceleration", "up")
    )
    p = np.zeros((N, 3))
    for j in range(1, N):
        p[j] = _position((omega[0] + omega[j]) / 2, velocity[j] - velocity[0])
    w, a = omega.mean(axis=0), alpha.mean(axis=0)
    noise = np.max([g.noise for g in told], axis=0)
    if most_noise is not None:
        noise = np.minimum(noise, most_noise)
    least = float(np.linalg.eigvalsh(cross_information(omega[0]))[0])
    spread: dict[str, tuple[float, float, float]] = {}
    if N > 1:
        count, span = Q * (N - 1), min(float(np.linalg.norm(p, axis=1).max()), FARTHEST_M)

        def apart(x: Array, components: int) -> float:
            return float(np.sqrt(np.sum((x - x.mean(axis=0)) ** 2) / (components * count)))

        at_first = velocity - cross(w, p[:, None])
        spread = {
            "rotation": (apart(omega, 3), rms(omega), float(noise[0])),
            "velocity": (apart(at_first, 3), rms(velocity), float(np.hypot(noise[1], noise[0] * span))),
            "tilt": (apart(up, 1), 1.0, 2.0 * float(noise[3])),
        }
    of_first = acceleration - cross(a, p[:, None]) - cross(w, cross(w, p[:, None]))
    return Body(
        R_1i=R,
        p_1i=p,
        omega=w,
        alpha=a,
        acceleration=of_first.mean(axis=0),
        up=up.mean(axis=0),
        noise=noise,
        turns=bool(np.sqrt(max(least, 0.0)) > FACTOR * noise[0]),
        spread=spread,
    )


def rotation_onto(a: Array, b: Array) -> Array:
    """The rotation R that brings the vectors b nearest to a in the mean, shapes (Q, 3)."""
    return chordal_mean((a.T @ b)[None])


def _position(w: Array, difference: Array) -> Array:
    """p that best explains v_j - v_1 = w x p in {1}; shortest where it is not unique."""
    moment = np.mean(cross(difference, w), axis=0)
    return np.asarray(np.linalg.lstsq(cross_information(w), moment, rcond=_RANK)[0], dtype=np.float64)
