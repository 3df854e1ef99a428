"""What no rigid payload on these robots explains, beside what noise and rounding of the sensors leave.

Standard errors come from the scatter of the data about the model. Robots that are not as designed (zeros of encoders,
lengths, springs) contradict each other in a smooth way that follows the motion, which scatter tells little of. So every
recording is fitted with all that a payload may be, and what is left over is compared with noise:

- flanges and grasps: R_b1 R_1i R_bi^T and h_1 + R_b1 p_1i - R_b1bi h_i do not change with time; open are the
  grasp (R_1i, p_1i) and the place and heading of every base;
- forces and moments: linear in the ten inertial parameters, all of them open.

Noise is what is left of differences of sixth order over 1 / (2 cut-off): noise below the cut-off has forgotten itself
after that time, and motion below a fifth of the cut-off leaves 2 % of itself. It is told from the filtered data alone,
so that resampling, which changes noise above the cut-off, hardly matters. Rounding of a joint that stands still does
not change from sample to sample and is added from the channels' steps.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from math import comb
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arrays import Array
from estimator.estimate.fusion import fuse
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.joint import newton_euler_regressor
from estimator.leftover.steps import Steps
from estimator.signals.grasp_data import GraspData
from estimator.statistics import rms_length

_ORDER = 6
_RANK = 1e-9


@dataclass(frozen=True)
class Leftover:
    """One quantity that is zero if all is well.

    Attributes:
        name: ``"flange_position"``, ``"flange_rotation"``, ``"force"`` or ``"moment"``.
        unit: SI.
        left: rms length of what the best rigid payload leaves over.
        noise: what noise and rounding leave of it.
    """

    name: str
    unit: str
    left: float
    noise: float

    @property
    def ratio(self) -> float:
        """How many times the noise."""
        return self.left / self.noise

    def to_dict(self) -> dict[str, Any]:
        """Plain types; keys as the fields."""
        return asdict(self)


def left_over(data: GraspData, grasps: GraspEstimate, steps: Steps) -> tuple[Leftover, ...]:
    """What the best rigid payload leaves of a recording: gaps at the flanges (none for one robot), forces, moments."""
    lag = max(2, round(0.5 * data.rate_hz / steps.cutoff_hz))
    stride = lag // 2  # the filter leaves nothing that needs more samples
    names = ("time", "R_bi", "p_bi", "twist", "twist_dot", "wrench")
    data = replace(
        data, rate_hz=data.rate_hz / stride, **{name: getattr(data, name)[::stride] for name in names}
    )
    lag //= stride
    rotation, position = _rounding(grasps, steps)
    force, moment = _balance(data, grasps)
    per_force = np.sqrt(3 * grasps.robots / 12) * steps.tau_Nm / steps.arm_m
    levers = grasps.p_1i - grasps.p_1i.mean(axis=0)
    reach = float(np.sqrt(np.mean(np.sum(levers**2, axis=1)) * 2 / 3))
    parts = [("force", "N", force[None], per_force), ("moment", "N m", moment[None], per_force * reach)]
    if grasps.robots > 1:
        turned, apart = _closure(data, grasps)
        parts = [
            ("flange_position", "m", apart, position),
            ("flange_rotation", "rad", turned, rotation),
            *parts,
        ]
    return tuple(
        Leftover(name, unit, rms_length(left.reshape(-1, 3)), float(np.hypot(_noise(left, lag), rounding)))
        for name, unit, left, rounding in parts
    )


def _rounding(grasps: GraspEstimate, steps: Steps) -> tuple[float, float]:
    """Rounding of joints at rest in a pair's rotation [rad] and position [m]."""
    phi, theta = steps.phi_rad / np.sqrt(12), steps.theta_rad / np.sqrt(12)
    distance = float(np.mean(np.sum(grasps.p_1i[1:] ** 2, axis=1))) if grasps.robots > 1 else 0.0
    return np.sqrt(6) * theta, float(np.sqrt(6 * (phi * steps.arm_m) ** 2 + 2 * distance * theta**2))


def _closure(data: GraspData, grasps: GraspEstimate) -> tuple[Array, Array]:
    """Rotation [rad] and position [m] of the flanges {2}..{N} off their grasps, in {b1}, shape (N - 1, Q, 3)."""
    R_b1 = data.R_bi[:, 0]
    turned, apart = [], []
    for i in range(1, data.robots):
        loop = R_b1 @ grasps.R_1i[i] @ np.swapaxes(data.R_bi[:, i], -1, -2)
        mean = so3.chordal_mean(loop)
        heading = Rotation.from_rotvec(
            [0.0, 0.0, np.arctan2(mean[1, 0] - mean[0, 1], mean[0, 0] + mean[1, 1])]
        )
        turn = Rotation.from_matrix(loop @ heading.as_matrix().T).as_rotvec()
        vertical = np.broadcast_to([[0.0], [0.0], [1.0]], (len(turn), 3, 1))
        turned.append(_rest(np.concatenate([R_b1, vertical], axis=2), turn))
        gap = data.p_bi[:, 0] + R_b1 @ grasps.p_1i[i] - heading.apply(data.p_bi[:, i])
        apart.append(_rest(np.concatenate([R_b1, np.broadcast_to(np.eye(3), R_b1.shape)], axis=2), gap))
    return np.array(turned), np.array(apart)


def _balance(data: GraspData, grasps: GraspEstimate) -> tuple[Array, Array]:
    """Forces [N] and moments about {1} [N m] that no ten inertial parameters explain, shape (Q, 3) each."""
    motion = fuse(data, grasps)
    specific = motion.acceleration + data.gravity_mps2 * motion.up
    Y = newton_euler_regressor(motion.omega, motion.alpha, specific)
    rest = _rest(Y, np.concatenate([motion.force, motion.moment], axis=1))
    return rest[:, :3], rest[:, 3:]


def _rest(A: Array, b: Array) -> Array:
    """b minus the best A x, shapes (Q, rows, K) and (Q, rows)."""
    flat = A.reshape(-1, A.shape[-1])
    scale = np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
    x = np.linalg.lstsq(flat / scale, b.ravel(), rcond=_RANK)[0]
    return b - (A @ (x / scale))


def _noise(left: Array, lag: int) -> float:
    """rms length of the noise in residuals, shape (..., Q, 3); all of them where Q is too short to tell."""
    count = left.shape[-2] - _ORDER * lag
    if count < 1:
        return rms_length(left.reshape(-1, 3))
    weights = [(-1) ** k * comb(_ORDER, k) for k in range(_ORDER + 1)]
    difference = sum(w * left[..., k * lag : k * lag + count, :] for k, w in enumerate(weights))
    return rms_length(np.reshape(difference, (-1, 3))) / np.sqrt(comb(2 * _ORDER, _ORDER))
