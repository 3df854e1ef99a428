"""Compare what no rigid payload on these robots explains with sensor noise and rounding.

Standard errors come from the scatter of the data about the model. Robots that differ from their design (encoder zeros,
lengths, springs) contradict each other smoothly along the motion, and scatter hardly shows this. So each recording is
fitted with all parameters of a payload free, and the residual is compared with noise:

- flanges and grasps: R_b1 R_1i R_bi^T and h_1 + R_b1 p_1i - R_b1bi h_i are constant; free are the grasp (R_1i, p_1i)
and the position and heading of every base;
- forces and moments: linear in the ten inertial parameters, all free.

Noise is measured by sixth-order differences at a lag of 1 / (2 cut-off). Noise below the cut-off is uncorrelated after
that time, and the differences keep 2 % of motion below a fifth of the cut-off. Only the filtered data are used, so
resampling, which changes noise above the cut-off, hardly matters. The rounding error of a resting joint is constant,
so it is computed from the channels' steps and added.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import comb
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arm.delta import jacobian
from estimator.arrays import Array
from estimator.estimate.grasps import GraspEstimate
from estimator.quantisation import quantisation_step, rounding_step
from estimator.recording.model import Recording
from estimator.rigid_team import payload_equations
from estimator.signals import BATCH_S, GraspData, Hold
from estimator.statistics import rms_length

FINEST_RAD, FINEST_NM = 2 * np.pi / 2**17, 2e-3
"""Steps below which errors of the simulated mechanics dominate (compliant rods and welds, integration). Measured:
noise-free recordings of the simulation leave 5 um, 9 urad and 14 mN."""
UNKNOWN_RAD, UNKNOWN_NM = 2 * np.pi / 2**14, 0.01
"""Steps of channels with neither visible nor documented steps, such as wrist positions. Chosen: the coarsest plausible
ones according to models/omnid/README.md."""


@dataclass(frozen=True)
class Steps:
    """Rounding steps of the channels, and the factors that convert them to errors at the wrist.

    Attributes:
        phi_rad, theta_rad, tau_Nm: steps of driven angles, gimbal angles and torques, the coarsest of each kind.
        arm_m: length of the driven links [m].
        cutoff_hz: cut-off of the low-pass filter [Hz].
        force_N: torque step converted to a force component at the wrist; 0 if no step is visible; a plausible step if
            no torque changes.
        read_hz: rate of the torque readings [Hz].
        still_rad2: variance from rounding of gimbal angles that rest on one reading throughout, for every robot, mean
            of its angles [rad^2], shape (N,).
    """

    phi_rad: float
    theta_rad: float
    tau_Nm: float
    arm_m: float
    cutoff_hz: float
    force_N: float
    read_hz: float
    still_rad2: Array

    def of_hold(self, hold: Hold) -> Hold:
        """Return a hold with the rounding variance of its forces."""
        noise_N2 = BATCH_S * self.read_hz * np.var(hold.batches[..., 3:], axis=0)
        return replace(hold, rounding_N2=float(rounded(self.force_N, noise_N2).mean()))


def steps_of(recording: Recording, cutoff_hz: float) -> Steps:
    """Return the steps of a recording that is filtered at ``cutoff_hz``."""
    told = recording.metadata.sampling or ()
    dh = jacobian(np.median(recording.phi, axis=(0, 1)), recording.metadata.design)
    per_Nm = float(np.sqrt(np.linalg.inv(dh @ dh.T).diagonal().max()))
    forces = [step * (per_Nm if of.level == "joint" else 1.0) for of in told for step in of.steps[6:]]
    if not told:
        tau = recording.tau.reshape(len(recording.time), -1)
        forces = [per_Nm * (rounding_step(x) if np.ptp(tau, axis=0).any() else UNKNOWN_NM) for x in tau.T]
    return Steps(
        phi_rad=max(FINEST_RAD, _coarsest(recording, 0) or UNKNOWN_RAD),
        theta_rad=max(FINEST_RAD, _coarsest(recording, 1) or UNKNOWN_RAD),
        tau_Nm=max(FINEST_NM, _coarsest(recording, 2) or UNKNOWN_NM),
        arm_m=recording.metadata.design.proximal_length_m,
        cutoff_hz=cutoff_hz,
        force_N=float(np.median([step for step in forces if step] or [0.0])),
        read_hz=min((of.native_hz for of in told), default=recording.metadata.rate_hz),
        still_rad2=rounded(_coarsest(recording, 1) or 0.0, np.var(recording.theta, axis=0)).mean(axis=-1),
    )


def rounded(step: float, noise: Array) -> Array:
    """Return the rounding variance of a mean over readings with variance ``noise``; dithering reduces it to zero.

    This is the first term of the Fourier series of the rounding error (B. Widrow, IRE Trans. Circuit Theory 3, 1956).
    In squared steps, a noise variance x before rounding becomes x + (1 - exp(-4 pi^2 x)) / 12 after it. The
    approximation 1 - exp(-y) = y / (1 + y / 2) inverts this.
    """
    if not step:
        return np.zeros_like(noise)
    a, after = 2.0 * np.pi**2, noise / step**2
    b = a * after - 1.0 - np.pi**2 / 3.0
    return step**2 / 12.0 * np.exp(-b - np.sqrt(b**2 + 4.0 * a * after))


def _coarsest(recording: Recording, kind: int) -> float | None:
    """Return the coarsest step of phi (0), theta (1) or tau (2), as documented or from the samples; None if unknown."""
    told = recording.metadata.sampling
    if told is not None:
        return max(step for sampling in told for step in sampling.steps_of(kind)) or None
    channels = (recording.phi, recording.theta, recording.tau)[kind]
    found = [quantisation_step(channels[:, i, k]) for i, k in np.ndindex(channels.shape[1:])]
    return max((step for step in found if step is not None), default=None)


_ORDER = 6
_RANK = 1e-9


@dataclass(frozen=True)
class Leftover:
    """A quantity that is zero for a rigid payload and ideal robots.

    Attributes:
        name: ``"flange_position"``, ``"flange_rotation"``, ``"force"`` or ``"moment"``.
        unit: SI.
        left: rms length of the residual of the best rigid payload.
        noise: rms length that noise and rounding explain.
    """

    name: str
    unit: str
    left: float
    noise: float

    @property
    def ratio(self) -> float:
        """Residual over noise."""
        return self.left / self.noise

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain types, with the field names as keys."""
        return asdict(self)


def left_over(data: GraspData, grasps: GraspEstimate, steps: Steps) -> tuple[Leftover, ...]:
    """Return the residuals of the best rigid payload: gaps at the flanges (none for one robot), forces, moments."""
    lag = max(2, round(0.5 * data.rate_hz / steps.cutoff_hz))
    stride = lag // 2  # the filtered signals need no higher rate
    data = data.every(stride)
    lag //= stride
    rotation, position = _rounding(grasps, steps)
    # Forces and moments about {1} that no ten inertial parameters explain, shape (Q, 6).
    wrench = _rest(*payload_equations(data, grasps))
    per_force = np.sqrt(3 * grasps.robots / 12) * steps.tau_Nm / steps.arm_m
    levers = grasps.p_1i - grasps.p_1i.mean(axis=0)
    reach = float(np.sqrt(np.mean(np.sum(levers**2, axis=1)) * 2 / 3))
    parts = [
        ("force", "N", wrench[None, :, :3], per_force),
        ("moment", "N m", wrench[None, :, 3:], per_force * reach),
    ]
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
    """Return the rounding error of resting joints in a pair's rotation [rad] and position [m]."""
    phi, theta = steps.phi_rad / np.sqrt(12), steps.theta_rad / np.sqrt(12)
    distance = float(np.mean(np.sum(grasps.p_1i[1:] ** 2, axis=1))) if grasps.robots > 1 else 0.0
    return np.sqrt(6) * theta, float(np.sqrt(6 * (phi * steps.arm_m) ** 2 + 2 * distance * theta**2))


def _closure(data: GraspData, grasps: GraspEstimate) -> tuple[Array, Array]:
    """Return rotation [rad] and position [m] errors of flanges {2}..{N} from their grasps, in {b1}, (N - 1, Q, 3)."""
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


def _rest(A: Array, b: Array) -> Array:
    """Return b minus the best A x, shapes (Q, rows, K) and (Q, rows)."""
    flat = A.reshape(-1, A.shape[-1])
    scale = np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
    x = np.linalg.lstsq(flat / scale, b.ravel(), rcond=_RANK)[0]
    return b - (A @ (x / scale))


def _noise(left: Array, lag: int) -> float:
    """Return the rms length of the noise in residuals, (..., Q, 3); of the residuals themselves for small Q."""
    count = left.shape[-2] - _ORDER * lag
    if count < 1:
        return rms_length(left.reshape(-1, 3))
    weights = [(-1) ** k * comb(_ORDER, k) for k in range(_ORDER + 1)]
    difference = sum(w * left[..., k * lag : k * lag + count, :] for k, w in enumerate(weights))
    return rms_length(np.reshape(difference, (-1, 3))) / np.sqrt(comb(2 * _ORDER, _ORDER))


CONTRADICTS = 3.0
"""Ratio of residual to noise above which the robots contradict each other. Measured: docs/method.md, 'Do the robots
contradict each other?'."""
_WORDS = {
    "flange_position": ("flanges miss their grasps by", 1e3, "mm"),
    "flange_rotation": ("are turned off them by", 1e3, "mrad"),
    "force": ("forces do not add up by", 1.0, "N"),
    "moment": ("moments by", 1.0, "N m"),
}
"""Description, factor and unit of each quantity in messages."""


def beyond_noise(leftovers: Sequence[Leftover]) -> list[Leftover]:
    """Return the quantities whose residual noise does not explain."""
    return [one for one in leftovers if one.ratio > CONTRADICTS]


def contradiction(found: Sequence[tuple[str, Sequence[Leftover]]]) -> str | None:
    """Return a sentence on contradictions, from recordings' names and leftovers; None if all is noise."""
    bad = [(name, wrong) for name, leftovers in found if (wrong := beyond_noise(leftovers))]
    if not bad:
        return None
    name, worst = max(bad, key=lambda entry: max(one.ratio for one in entry[1]))
    where = name if len(bad) == 1 else f"in {len(bad)} of {len(found)} recordings, most in {name}"
    team = any(one.name.startswith("flange") for _, leftovers in found for one in leftovers)
    moving = any(one.name.startswith("flange") for _, wrong in bad for one in wrong)
    what = (
        "Arms that differ from their design (encoder zeros, lengths, springs) do this"
        if moving or not team
        else "The flanges agree and the wrenches do not: springs or torque zeros are off, or another robot carries, "
        "too, and these are not the payload's numbers"
    )
    return (
        f"The robot{'s contradict each other' if team else ' contradicts itself'} beyond noise ({where}): "
        f"{', '.join(map(_words, worst))}. Standard errors do not cover this: values may be off by many of them. "
        f"{what}: calibrate the arms; mocobot diagnose says what else is wrong."
    )


def _words(one: Leftover) -> str:
    what, scale, unit = _WORDS[one.name]
    return f"{what} {scale * one.left:.2g} {unit} rms ({one.ratio:.2g} times noise)"
