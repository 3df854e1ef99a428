"""What the recordings of a calibration leave open, in words and numbers, with the experiment that would decide it."""

from __future__ import annotations

import numpy as np

from estimator.arm.unit import COUNT
from estimator.calibrate.fit import Fit
from estimator.calibrate.prior import MASSES, Prior

UNKNOWN_MASSES = 0.05
"""Relative error of arm masses that is taken for granted where nobody has weighed them."""


def undecided(
    fit: Fit, prior: Prior, scale_sd: float, *, alone: bool, single: list[str], parallel: bool = False
) -> list[str]:
    """Sentences.

    Args:
        fit: the calibration.
        prior: what was assumed.
        scale_sd: standard deviation of the held common spring scale; 0 if it is not held.
        alone: whether unloaded arms were recorded.
        single: names of payloads with one recording.
        parallel: whether the flanges are known to be parallel.
    """
    out = []
    layout = fit.layout
    masses = []
    for k, shared in enumerate(fit.unknowns.carried):
        place = layout.of_inertia(k).start
        masses.append(np.sqrt(fit.covariance[place, place]) / shared.pi[0])
    if scale_sd:
        out.append(
            "The common scale of all springs is held at its design value, for a carry tells it from the mass by the "
            f"arms' own weight alone: all masses and inertias may be off together by {100 * scale_sd:.2g} % (one "
            f"standard error). One weighed payload (--known-mass) brings that to {100 * min(masses):.1g} %."
        )
    if not parallel and prior.encoder_zero_rad:
        reach = max(float(np.max(np.linalg.norm(s.grasps.p_1i, axis=1))) for s in fit.unknowns.carried)
        degrees = np.rad2deg(prior.encoder_zero_rad)
        out.append(
            "The zeros of the last gimbal axes (theta_x) only turn the grasp frames, so frames are those that the "
            f"encoders define. Frames drawn at the flanges may be turned against them by {degrees:.2g} deg about their "
            "x axes (one standard error), which moves positions in {1} by up to "
            f"{1e3 * reach * prior.encoder_zero_rad:.2g} mm. Flanges known to be parallel (--parallel-flanges), or an "
            "index mark at each, decide them."
        )
    if not prior.arm_mass_ratio and not alone:
        share = max(_by_masses(fit, k) for k in range(layout.payloads))
        out.append(
            "The arms' masses are taken as designed but for one common factor. Where each is known to "
            f"{100 * UNKNOWN_MASSES:.0f} % only, a payload's mass is off by {100 * share:.2g} % besides (one standard "
            "error): free them (--arm-masses), best with a recording of the unloaded arms (--free)."
        )
    for name in single:
        out.append(
            f"{name}: with one recording none can be left out, so nothing shows how well the calibration foretells "
            "another; record a second motion of the same payload."
        )
    return out


def _by_masses(fit: Fit, payload: int) -> float:
    """Relative error of a payload's mass from errors of ``UNKNOWN_MASSES`` in every arm mass alone."""
    layout = fit.layout
    H = np.zeros((layout.size, layout.size))
    g = np.zeros(layout.size)
    for part in (*(trial.all for trial in fit.trials), *fit.alone, *fit.known):
        part.add_to(H, g)
    places = (np.arange(layout.robots)[:, None] * COUNT + MASSES).ravel()
    at = layout.of_inertia(payload).start
    by_mass = -(fit.covariance[at] @ H[:, places])
    return float(UNKNOWN_MASSES * np.linalg.norm(by_mass) / fit.unknowns.carried[payload].pi[0])
