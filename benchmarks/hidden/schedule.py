"""What is recorded of one team: two random trials, a periodic one, a static one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.trajectories import (
    Trajectory,
    random_vias,
    sphere_motion,
    static_orientations,
)


@dataclass(frozen=True)
class Schedule:
    """Trials of one data set, random ones first; the default lasts 164 s or a little more.

    Attributes:
        randoms: number of random trials.
        vias: vias of each.
        periodic_s: length of the periodic trial's motion [s]; None for no periodic trial.
        hold_s: time at each hold of the static trial [s]; None for no static trial.
    """

    randoms: int = 2
    vias: int = 27
    periodic_s: float | None = 35.0
    hold_s: float | None = 4.5

    def trajectories(self, scene: TeamScene, rng: np.random.Generator) -> list[Trajectory]:
        """Commands of every trial."""
        home = scene.wrist_home_b
        out = [random_vias(home, rng, vias=self.vias) for _ in range(self.randoms)]
        if self.periodic_s is not None:
            out.append(sphere_motion(home, scene.X_1i, duration_s=self.periodic_s, rng=rng))
        if self.hold_s is not None:
            out.append(static_orientations(home, scene.X_1i, hold_s=self.hold_s))
        return out


SHORT = (
    Schedule(randoms=2, vias=20, periodic_s=None, hold_s=None),
    Schedule(randoms=1, vias=20, periodic_s=30.0, hold_s=None),
    Schedule(randoms=1, vias=20, periodic_s=None, hold_s=4.5),
)
"""Two trials: as much as a first log may have."""
