"""A trial that no fit has seen, at robots and a payload that others have told of."""

import numpy as np

from discrepancy.team.linear.noise import Noise
from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear, linearise
from estimator.arrays import Array
from estimator.recording.model import Recording
from estimator.rigid_team import Shared, poses, start_bases


def trial_at(recording: Recording, shared: Shared, noise: Noise, *, full: bool) -> TrialLinear:
    """The trial where its bases fit it on average; without ``full`` the robots' signals are left out."""
    signals, arms = noise.known_to(Signals.of(recording)), recording.metadata.arms
    angles = signals.phi[signals.keep], signals.theta[signals.keep]
    bases = start_bases(*poses(*angles, arms), shared)
    return linearise(signals, shared, bases, arms, Reduction.of(signals), full=full, known=True)


def without_bases(trial: TrialLinear, rows: Array) -> Array:
    """Rows, shape (n, C), without what the bases' places can explain of them, every channel in its own scale."""
    if not rows.size:
        return rows
    scale = np.maximum(np.sqrt(np.mean(rows**2, axis=0)), 1e-300)
    columns = (trial.by_bases / scale[:, None]).reshape(rows.size, -1)
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    values = np.linalg.lstsq(columns / size, (rows / scale).ravel(), rcond=None)[0] / size
    return rows - trial.by_bases @ values
