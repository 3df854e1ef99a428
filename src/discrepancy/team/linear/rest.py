"""Friction at rest and play between its ends, within their tolerances: what they may do to a healthy team's rows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.gimbal import rate_matrix
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass
from estimator.rigid_team.slots import THETA

Tolerances = Mapping[str, Mapping[str, float]]


class Resting:
    """Draws of what joints hold while they rest: friction takes any torque up to its limit, another at every rest.

    While a joint moves, its friction is a cause of the catalogue with columns of its own; at rest it has none, and of a
    healthy joint it is noise, of the size of the tolerance.
    """

    def __init__(self, trial: TrialLinear, tolerances: Tolerances) -> None:
        """Find the rests of a trial."""
        self._trial = trial
        self._limit_Nm = {
            moves: tolerances.get(cause, {}).get(name, 0.0)
            for moves, cause, name in (
                ("phi", "joint_friction", "coulomb_Nm"),
                ("tau", "sea_hysteresis", "friction_Nm"),
                ("theta", "gimbal_friction", "coulomb_Nm"),
            )
        }
        slow = {"phi": rules.REST_RAD_PER_S, "theta": rules.REST_RAD_PER_S, "tau": rules.REST_NM_PER_S}
        self._play_m = tolerances.get("grasp_play", {}).get("play_m", 0.0)
        self._rests = {moves: _numbered(trial.signals, moves, slow[moves]) for moves in self._limit_Nm}

    def __call__(self, rng: np.random.Generator) -> Array:
        """One draw, shape (n, C)."""
        trial = self._trial
        driven = self._torque("phi", rng) + self._torque("tau", rng)
        rows = np.zeros((len(trial.reduction.time), trial.channels))
        for i in range(trial.robots):
            rows += trial.of_signals(i, tau=driven[:, i])
        gimbal = self._torque("theta", rng)
        if np.any(gimbal):
            moment = np.zeros((len(gimbal), 3))
            for i in range(trial.robots):
                axes_T = np.swapaxes(rate_matrix(trial.s[:, i, THETA]), -1, -2)
                moment += (
                    np.linalg.solve(axes_T, gimbal[:, i, :, None])[..., 0] @ trial.shared.grasps.R_1i[i].T
                )
            rows += trial.of_wrench(np.zeros_like(moment), moment)
        if self._play_m:
            for i in range(trial.robots):
                offset = np.einsum("qij,qj->qi", trial.data.R_bi[:, i], self._between(i, rng))
                rows += trial.of_pose(i, None, offset @ trial.bases.R[i].T)
        return rows

    def _between(self, robot: int, rng: np.random.Generator) -> Array:
        """Place in a grasp's play along the axes of {i} [m] while the force leaves it open, shape (Q, 3); else 0."""
        trial = self._trial
        time = trial.signals.time
        knots = np.arange(time[0], time[-1] + rules.PLAY_KNOTS_S, rules.PLAY_KNOTS_S)
        anywhere = [np.interp(time, knots, rng.standard_normal(len(knots))) for _ in range(3)]
        between = np.abs(trial.data.wrench[:, robot, 3:]) < rules.PLAY_FORCE_N
        return np.asarray(self._play_m * np.stack(anywhere, axis=1) * between)

    def _torque(self, moves: str, rng: np.random.Generator) -> Array:
        """Torque at rest [N m], shape (Q, N, 3); 0 in motion."""
        rests = self._rests[moves]
        each = self._limit_Nm[moves] * rng.standard_normal((int(rests.max(initial=0)) + 1, *rests.shape[1:]))
        each[0] = 0.0
        return np.asarray(np.take_along_axis(each, rests, axis=0))


def _numbered(signals: Signals, moves: str, slow: float) -> NDArray[np.intp]:
    """Number of the rest that each sample is in, from 1, and 0 in motion, shape (Q, N, 3)."""
    rate_hz = signals.rate_hz
    rate = differentiate(low_pass(getattr(signals, moves), rate_hz, rules.TEAM_SMOOTH_HZ), rate_hz)
    still = np.abs(rate) < slow
    starts = still & ~np.concatenate([np.zeros_like(still[:1]), still[:-1]])
    return np.asarray(np.where(still, np.cumsum(starts, axis=0), 0), dtype=np.intp)
