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
"""Steps below which the model's own errors count (rods and welds that give, integration). Measured: noise-free
recordings of the simulation leave 5 um, 9 urad and 14 mN."""
UNKNOWN_RAD, UNKNOWN_NM = 2 * np.pi / 2**14, 0.01
"""Steps of channels that do not show any and are told of none, as wrist positions hide them. Chosen: the coarsest
that models/omnid/README.md takes for plausible."""


@dataclass(frozen=True)
class Steps:
    """Steps of the channels, and what turns them into errors of the wrist.

    Attributes:
        phi_rad, theta_rad, tau_Nm: of driven angles, gimbal angles and torques, the coarsest of each kind.
        arm_m: length of the driven links [m].
        cutoff_hz: of the filter behind which errors are looked at [Hz].
        force_N: step of the torques as a component of the force at the wrist, 0 where none shows; where no torque
            changes, of one that is plausible.
        read_hz: rate of the torques' readings [Hz].
        still_rad2: what rounding leaves of gimbal angles that rest on one reading all the time, of every robot, mean
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
        """A hold with what rounding leaves of its forces."""
        noise_N2 = BATCH_S * self.read_hz * np.var(hold.batches[..., 3:], axis=0)
        return replace(hold, rounding_N2=float(rounded(self.force_N, noise_N2).mean()))


def steps_of(recording: Recording, cutoff_hz: float) -> Steps:
    """Steps of a recording that is filtered at ``cutoff_hz``."""
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
    """Variance that rounding leaves of a mean over readings with a variance ``noise``: none where that dithers it.

    By the first term of the Fourier series of the rounding error (B. Widrow, IRE Trans. Circuit Theory 3, 1956). That
    of a noise x before rounding is x + (1 - exp(-4 pi^2 x)) / 12 after it, in steps; 1 - exp(-y) is y / (1 + y / 2).
    """
    if not step:
        return np.zeros_like(noise)
    a, after = 2.0 * np.pi**2, noise / step**2
    b = a * after - 1.0 - np.pi**2 / 3.0
    return step**2 / 12.0 * np.exp(-b - np.sqrt(b**2 + 4.0 * a * after))


def _coarsest(recording: Recording, kind: int) -> float | None:
    """Coarsest step of phi (0), theta (1) or tau (2) of all robots, as told or as samples show; None where not."""
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


CONTRADICTS = 3.0
"""Left over, in what noise and rounding leave, beyond which the robots contradict each other. Measured: docs/method.md,
'Do the robots contradict each other?'."""
_WORDS = {
    "flange_position": ("flanges miss their grasps by", 1e3, "mm"),
    "flange_rotation": ("are turned off them by", 1e3, "mrad"),
    "force": ("forces do not add up by", 1.0, "N"),
    "moment": ("moments by", 1.0, "N m"),
}
"""What is said of each quantity, and the unit it is said in."""


def beyond_noise(leftovers: Sequence[Leftover]) -> list[Leftover]:
    """Those that noise does not explain."""
    return [one for one in leftovers if one.ratio > CONTRADICTS]


def contradiction(found: Sequence[tuple[str, Sequence[Leftover]]]) -> str | None:
    """The sentence, from recordings' names and what each leaves over; None where all is noise."""
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
