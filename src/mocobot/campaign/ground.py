"""What a draw of effects needs to know of a team, and which places no recording tells apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.trajectories import SETTLE_S, Trajectory
from mocobot_sim.trial.truth import GroundTruth

PARALLEL = float(np.cos(np.deg2rad(10.0)))
"""Gimbal axes nearer than this at home are one axis: which robot's rubs cannot be decided."""


class Limits(Protocol):
    """Detection limits of a background: the size of every parameter, alone, that is about noticed."""

    def at(
        self, cause: str, robot: int | None = None, joint: int | None = None, trial: int | None = None
    ) -> Mapping[str, float]:
        """By parameter, of a cause at a place; the trial is a push's. Parameters that nothing shows are left out."""
        ...

    def pendulum(self, rng: np.random.Generator) -> tuple[float, float]:
        """A pendulum's length [m], drawn or not, and the detection limit of its mass [kg]."""
        ...


@dataclass(frozen=True)
class Ground:
    """A team without hidden effects, and what it does.

    Attributes:
        robots: number of robots.
        p_1c: centre of mass in {1} [m], shape (3,).
        moving: trial number (from 1), begin and end of motion [s].
        limits: what sizes are multiples of.
    """

    robots: int
    p_1c: Array
    moving: Sequence[tuple[int, float, float]]
    limits: Limits

    @classmethod
    def of(cls, scene: TeamScene, trajectories: Sequence[Trajectory], limits: Limits) -> "Ground":
        """Of a team, the commands of its trials, and its detection limits."""
        return cls(scene.robots, GroundTruth.of(scene).p_1c, moving_intervals(trajectories), limits)


def moving_intervals(trajectories: Sequence[Trajectory]) -> list[tuple[int, float, float]]:
    """Trial number (from 1), begin and end of the motion [s] of every trial that moves all the time."""
    return [
        (number, SETTLE_S, trajectory.duration_s - SETTLE_S)
        for number, trajectory in enumerate(trajectories, start=1)
        if trajectory.trial != "static"
    ]


def gimbal_axes(team: TeamScene) -> list[list[list[float]]]:
    """Axes of the gimbal joints 1, 2, 3 (z, y, x) at home in {1}, one per row, for every robot: shape (N, 3, 3)."""
    out = []
    for theta, X in zip(team.theta_home, team.X_1i, strict=True):
        flange = X.rotation * Rotation.from_euler("ZYX", theta).inv()  # {b} turned into {1}
        after_z = flange * Rotation.from_euler("Z", theta[0])
        after_y = after_z * Rotation.from_euler("Y", theta[1])
        axes = [flange.apply([0, 0, 1]), after_z.apply([0, 1, 0]), after_y.apply([1, 0, 0])]
        out.append(np.array(axes).tolist())
    return out


def one_axis(axes: Any, a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """Whether two gimbal joints turn about one axis, near enough.

    Args:
        axes: what ``gimbal_axes`` says.
        a, b: places, with the keys ``robot`` and ``joint`` from 1.
    """
    first, second = (np.array(axes)[x["robot"] - 1, x["joint"] - 1] for x in (a, b))
    return bool(abs(first @ second) > PARALLEL)
