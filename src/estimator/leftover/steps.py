"""Rounding of a recording's channels, as far as the samples show it."""

from dataclasses import dataclass

import numpy as np

from estimator.quantisation import quantisation_step
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
    """

    phi_rad: float
    theta_rad: float
    tau_Nm: float
    arm_m: float
    cutoff_hz: float


def steps_of(recording: Recording, cutoff_hz: float) -> Steps:
    """Steps of a recording that is filtered at ``cutoff_hz``."""
    return Steps(
        phi_rad=max(FINEST_RAD, _coarsest(recording, 0) or UNKNOWN_RAD),
        theta_rad=max(FINEST_RAD, _coarsest(recording, 1) or UNKNOWN_RAD),
        tau_Nm=max(FINEST_NM, _coarsest(recording, 2) or UNKNOWN_NM),
        arm_m=recording.metadata.design.proximal_length_m,
        cutoff_hz=cutoff_hz,
    )


def _coarsest(recording: Recording, kind: int) -> float | None:
    """Of phi (0), theta (1) or tau (2) of all robots: as told, or as the samples show; None where neither does."""
    told = recording.metadata.sampling
    if told is not None:
        return max(step for sampling in told for step in sampling.steps_of(kind)) or None
    channels = (recording.phi, recording.theta, recording.tau)[kind]
    found = [quantisation_step(channels[:, i, k]) for i, k in np.ndindex(channels.shape[1:])]
    return max((step for step in found if step is not None), default=None)
