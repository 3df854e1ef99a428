"""Rounding of a recording's channels, as far as the samples show it."""

from dataclasses import dataclass, replace

import numpy as np

from estimator.arm.delta import jacobian
from estimator.arrays import Array
from estimator.quantisation import quantisation_step, rounding_step
from estimator.recording.model import Recording
from estimator.signals.holds import BATCH_S, Hold

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
    """Of phi (0), theta (1) or tau (2) of all robots: as told, or as the samples show; None where neither does."""
    told = recording.metadata.sampling
    if told is not None:
        return max(step for sampling in told for step in sampling.steps_of(kind)) or None
    channels = (recording.phi, recording.theta, recording.tau)[kind]
    found = [quantisation_step(channels[:, i, k]) for i, k in np.ndindex(channels.shape[1:])]
    return max((step for step in found if step is not None), default=None)
