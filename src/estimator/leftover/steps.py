"""Rounding of a recording's channels, as far as the samples show it."""

from dataclasses import dataclass

import numpy as np

from estimator.arm.delta import jacobian
from estimator.arrays import Array
from estimator.quantisation import quantisation_step, rounding_step
from estimator.recording.model import Recording

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


def steps_of(recording: Recording, cutoff_hz: float) -> Steps:
    """Steps of a recording that is filtered at ``cutoff_hz``."""
    told = recording.metadata.sampling
    steps = [rounding_step(x) for x in recording.tau.reshape(len(recording.time), -1).T]
    if told is not None:
        steps = [step for sampling in told for step in sampling.steps_of(2)]
    elif not np.ptp(recording.tau, axis=0).any():
        steps = [UNKNOWN_NM]
    theta = _coarsest(recording, 1) or 0.0
    dh = jacobian(np.median(recording.phi, axis=(0, 1)), recording.metadata.design)
    force_per_Nm = float(np.sqrt(np.linalg.inv(dh @ dh.T).diagonal().max()))
    return Steps(
        phi_rad=max(FINEST_RAD, _coarsest(recording, 0) or UNKNOWN_RAD),
        theta_rad=max(FINEST_RAD, _coarsest(recording, 1) or UNKNOWN_RAD),
        tau_Nm=max(FINEST_NM, _coarsest(recording, 2) or UNKNOWN_NM),
        arm_m=recording.metadata.design.proximal_length_m,
        cutoff_hz=cutoff_hz,
        force_N=float(np.median([step for step in steps if step] or [0.0])) * force_per_Nm,
        read_hz=min((sampling.native_hz for sampling in told or ()), default=recording.metadata.rate_hz),
        still_rad2=rounded(theta, np.var(recording.theta, axis=0)).mean(axis=-1),
    )


def rounded(step: float, noise: Array) -> Array:
    """Variance that rounding leaves of a mean over readings with a variance ``noise``: none where that dithers it.

    By the first term of the Fourier series of the rounding error (B. Widrow, IRE Trans. Circuit Theory 3, 1956); what
    rounding adds to the noise is taken out: all of it above a third of a step, in proportion to the noise below.
    """
    if not step:
        return np.zeros_like(noise)
    before = np.maximum(noise / (1.0 + np.pi**2 / 3.0), noise - step**2 / 12.0)
    return step**2 / 12.0 * np.exp(-before * (2.0 * np.pi / step) ** 2)


def _coarsest(recording: Recording, kind: int) -> float | None:
    """Of phi (0), theta (1) or tau (2) of all robots: as told, or as the samples show; None where neither does."""
    told = recording.metadata.sampling
    if told is not None:
        return max(step for sampling in told for step in sampling.steps_of(kind)) or None
    channels = (recording.phi, recording.theta, recording.tau)[kind]
    found = [quantisation_step(channels[:, i, k]) for i, k in np.ndindex(channels.shape[1:])]
    return max((step for step in found if step is not None), default=None)
