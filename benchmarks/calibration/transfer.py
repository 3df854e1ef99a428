"""A payload estimated with robots that were calibrated before, on another payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.arrays import Array
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.calibrate.equations import TrialEquations
from estimator.calibrate.fit import Fit, Trial, fit
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Rows
from estimator.calibrate.sensing import Sensing
from estimator.calibrate.start import start_bases
from estimator.calibrate.unknowns import Unknowns
from estimator.recording.model import Recording
from estimator.rigid_team.residual import Shared

HELD = Prior(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def transferred(calibration: Calibration, recordings: Sequence[Recording]) -> CalibratedPayload:
    """Grasps and payload with the robots held as calibrated; the covariance has their uncertainty in it."""
    first = calibrate(recordings, prior=HELD).payloads[0]
    sensing, units = Sensing.of(recordings), calibration.units
    shared = Shared(first.grasps, first.parameters)
    rows = [Rows.of(recording) for recording in recordings]
    trials = [Trial(one, 0, sensing) for one in rows]
    bases = tuple(start_bases(one, units, shared) for one in rows)
    found = fit(trials, Unknowns(units, (shared,), bases), HELD)
    at = found.layout.of_payload(0)
    by_units = _by_units(found)[at]
    carried = found.unknowns.carried[0]
    covariance = found.covariance[at, at] + by_units @ calibration.covariance @ by_units.T
    grasped = len(covariance) - 10
    return CalibratedPayload(
        first.label,
        replace(carried.grasps, covariance=covariance[:grasped, :grasped]),
        carried.pi,
        covariance,
        by_units @ calibration.by_scale.ravel(),
    )


def _by_units(found: Fit) -> Array:
    """How the solution of all else follows the robots, shape (K, N ``COUNT``)."""
    size, units = found.layout.size, found.layout.of_units
    H, g = np.zeros((size, size)), np.zeros(size)
    for trial in found.trials:
        trial.all.add_to(H, g)
    return -found.covariance @ H[:, units]
