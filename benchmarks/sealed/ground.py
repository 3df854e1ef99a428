"""What a draw needs to know of a team."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from mocobot.campaign.effects import moving_intervals
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home
from mocobot_sim.trial.trajectories import Trajectory
from mocobot_sim.trial.truth import GroundTruth


@dataclass(frozen=True)
class Ground:
    """A team without effects, and what it does.

    Attributes:
        robots: number of robots N.
        p_1c: centre of mass in {1} [m], shape (3,).
        moving: trial number, begin and end of motion [s] of every trial that moves.
        torque_Nm: load of every spring at home [N m], shape (N, 3).
    """

    robots: int
    p_1c: np.ndarray
    moving: list[tuple[int, float, float]]
    torque_Nm: np.ndarray

    @classmethod
    def of(cls, scene: TeamScene, trajectories: Sequence[Trajectory]) -> Ground:
        """Of a team and the commands of its trials."""
        model = scene.compile()
        torque = assemble_at_home(scene, model, mujoco.MjData(model), TeamIndex.of(model))
        moving = moving_intervals(trajectories)
        return cls(scene.robots, GroundTruth.of(scene).p_1c, moving, torque)
