"""Draw the effect of friction at rest and of grasp play, within their tolerances, on the rows of a healthy team."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.dynamics import rate_matrix
from estimator.arm.motion import TAU, THETA
from estimator.arrays import Array
from estimator.filtering import differentiate

PLAY_FORCE_N = 0.4
"""Force below which a payload may be anywhere in its play [N]. Chosen."""

REST_RAD_PER_S, REST_NM_PER_S = 1e-3, 0.2
"""Joint speed, and rate of a spring's torque, below which friction counts as noise. Chosen: as in the causes."""

PLAY_KNOTS_S = 0.2
"""Time between the knots of a random position in the play [s]. Chosen."""

DRAWS_AT_A_TIME, DRAWN_TOGETHER = 8, 4.5e5
"""Largest number of noise draws at a time, and of samples of all robots in them. Chosen: limits memory."""

Moves = Literal["phi", "theta", "tau"]
KINDS: tuple[tuple[Moves, str, str], ...] = (
    ("phi", "joint_friction", "coulomb_Nm"),
    ("tau", "sea_hysteresis", "friction_Nm"),
    ("theta", "gimbal_friction", "coulomb_Nm"),
)
"""Signal whose rate detects rest, its cause, and the parameter that limits the friction torque."""
HEALTHY = {"joint_friction": 1.0, "gimbal_friction": 1.0, "sea_hysteresis": 1.0, "grasp_play": 1.0}
"""Causes that act as noise at rest, and the factor by which a healthy team's tolerance is scaled."""
Tolerances = Mapping[str, Mapping[str, float]]


def limits_of(tolerances: Tolerances, resting: Mapping[str, float]) -> Tolerances:
    """Tolerances of the causes that act as noise at rest, scaled by factors.

    Args:
        tolerances: standard deviations by cause and parameter.
        resting: factor of each such cause.
    """
    return {
        cause: {name: factor * value for name, value in tolerances.get(cause, {}).items()}
        for cause, factor in resting.items()
    }


class Resting:
    """Draws of the torques that friction holds while joints rest, and of positions in the play of grasps.

    Friction at rest takes any torque up to its limit, another one during each rest. A moving joint's friction has
    columns of its own. At rest it has none, so it counts as noise of the size of its tolerance.
    """

    def __init__(self, trial: TrialLinear, tolerances: Tolerances) -> None:
        """Find the rests of a trial."""
        self._trial = trial
        self._limit_Nm: dict[Moves, float] = {
            moves: tolerances.get(cause, {}).get(name, 0.0) for moves, cause, name in KINDS
        }
        slow = {"phi": REST_RAD_PER_S, "theta": REST_RAD_PER_S, "tau": REST_NM_PER_S}
        self._play_m = tolerances.get("grasp_play", {}).get("play_m", 0.0)
        self._rests = {moves: _numbered(trial.signals, moves, slow[moves]) for moves in self._limit_Nm}

    def __call__(self, rng: np.random.Generator, draws: int = 1) -> Array:
        """Draw residual rows, shape (draws, n, C)."""
        out = []
        most = draws_at_a_time(self._trial)
        for first in range(0, draws, most):
            some = [self._drawn(rng) for _ in range(min(most, draws - first))]
            out.append(self._rows(*(np.stack(part, axis=-1) for part in zip(*some, strict=True))))
        return np.concatenate(out)

    def _drawn(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Draw torques of resting joints and gimbals [N m] and positions in the play [m], shape (Q, N, 3) each."""
        driven = self._torque("phi", rng) + self._torque("tau", rng)
        gimbal = self._torque("theta", rng)
        places = [self._between(i, rng) for i in range(self._trial.robots if self._play_m else 0)]
        return driven, gimbal, np.stack(places, axis=1) if places else np.zeros_like(driven)

    def _rows(self, driven: Array, gimbal: Array, places: Array) -> Array:
        """Residual rows, shape (D, n, C), of draws of shape (Q, N, 3, D)."""
        trial, (samples, N, _, D) = self._trial, driven.shape
        rows = trial.reduction(np.sum([trial.J(i, TAU, driven[:, i]) for i in range(N)], axis=0))
        moment = self._moments @ gimbal.reshape(samples, 3 * N, D)
        rows += trial.of_wrench(np.zeros_like(moment), moment)
        for i in range(N if self._play_m else 0):
            rows += trial.of_pose(i, None, trial.bases.R[i] @ trial.data.R_bi[:, i] @ places[:, i])
        return np.moveaxis(rows, -1, 0)

    @cached_property
    def _moments(self) -> Array:
        """Moment on the payload in {1} per unit of each gimbal torque, shape (Q, 3, 3 N)."""
        axes_T = np.swapaxes(rate_matrix(self._trial.s[..., THETA]), -1, -2)
        by_robot = np.moveaxis(self._trial.shared.grasps.R_1i @ np.linalg.inv(axes_T), 1, 2)
        return np.asarray(by_robot.reshape(len(by_robot), 3, -1), dtype=np.float64)

    def _between(self, robot: int, rng: np.random.Generator) -> Array:
        """Draw a position in a grasp's play in {i} [m], shape (Q, 3); zero where the force closes the play."""
        trial = self._trial
        time = trial.signals.time
        knots = np.arange(time[0], time[-1] + PLAY_KNOTS_S, PLAY_KNOTS_S)
        anywhere = [np.interp(time, knots, rng.standard_normal(len(knots))) for _ in range(3)]
        between = np.abs(trial.data.wrench[:, robot, 3:]) < PLAY_FORCE_N
        return np.asarray(self._play_m * np.stack(anywhere, axis=1) * between)

    def _torque(self, moves: Moves, rng: np.random.Generator) -> Array:
        """Draw the friction torque at rest [N m], shape (Q, N, 3); zero in motion."""
        rests = self._rests[moves]
        each = self._limit_Nm[moves] * rng.standard_normal((int(rests.max(initial=0)) + 1, *rests.shape[1:]))
        each[0] = 0.0
        return np.asarray(np.take_along_axis(each, rests, axis=0))


def draws_at_a_time(trial: TrialLinear) -> int:
    """Return how many noise draws of a trial fit in memory together."""
    return max(1, min(DRAWS_AT_A_TIME, int(DRAWN_TOGETHER // trial.s[..., 0].size)))


def _numbered(signals: Signals, moves: Moves, slow: float) -> NDArray[np.intp]:
    """Number each joint's rests from 1 and give motion 0, shape (Q, N, 3)."""
    each = [
        [signals.smooth(moves, robot, joint) for joint in range(3)] for robot in range(signals.phi.shape[1])
    ]
    rate = differentiate(np.moveaxis(np.array(each), 2, 0), signals.rate_hz)
    still = np.abs(rate) < slow
    starts = still & ~np.concatenate([np.zeros_like(still[:1]), still[:-1]])
    return np.asarray(np.where(still, np.cumsum(starts, axis=0), 0), dtype=np.intp)
