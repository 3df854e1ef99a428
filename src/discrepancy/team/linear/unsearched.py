"""A trial that no fit has seen, at robots and a payload that others have told of."""

import numpy as np

from discrepancy.team.linear.by_unknowns import by_bases
from discrepancy.team.linear.jacobian import BySignals, by_signals
from discrepancy.team.linear.reduction import Reduction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear, filtered
from estimator.arrays import Array
from estimator.recording.model import Recording
from estimator.rigid_team.residual import Shared, balance, grasp_data, pose_residual, poses
from estimator.rigid_team.start import start_bases


def trial_at(recording: Recording, shared: Shared, *, full: bool) -> TrialLinear:
    """The trial where its bases fit it on average; without ``full`` the robots' signals are left out.

    Derivatives by the shared unknowns are left out: they stay.
    """
    signals, arms = Signals.of(recording), recording.metadata.arms
    reduction = Reduction.of(signals)
    angles = signals.phi[signals.keep], signals.theta[signals.keep]
    bases = start_bases(*poses(*angles, arms), shared)
    s = filtered(signals)
    data = grasp_data(s, arms, signals.rate_hz)
    pose = pose_residual(signals.phi, signals.theta, shared, bases, arms)
    residual = reduction(np.concatenate([pose, balance(data, shared)[0]], axis=1))
    N = s.shape[1]
    J = by_signals(s, data, shared, bases, arms) if full else BySignals.none(N, 6 * N)
    none, own = np.zeros((*residual.shape, 0)), reduction(by_bases(data, shared, bases))
    return TrialLinear(signals, s, data, shared, bases, arms, reduction, residual, J, none, own)


def without_bases(trial: TrialLinear, rows: Array) -> Array:
    """Rows, shape (n, C), without what the bases' places can explain of them, every channel in its own scale."""
    scale = np.maximum(np.sqrt(np.mean(rows**2, axis=0)), 1e-300)
    columns = (trial.by_bases / scale[:, None]).reshape(rows.size, -1)
    if not columns.shape[1]:
        return rows
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    values = np.linalg.lstsq(columns / size, (rows / scale).ravel(), rcond=None)[0] / size
    return rows - trial.by_bases @ values
