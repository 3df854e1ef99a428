"""Somebody pushes the payload."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mocobot_sim.effects.base import Effect

if TYPE_CHECKING:
    import mujoco

    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class Push(Effect):
    """A force during an interval of one trial, constant but for the ``ramp_s`` in which it grows and fades.

    MJCF has no such thing: the trial writes ``xfrc_applied``. The force is given in the axes of robot 1's {b} without
    any tilt [N], the point where it acts is fixed to the payload and given in {1} [m].
    """

    on_payload = True
    repeats = True
    ranges: ClassVar = {"start_s": (0.0, 1e9), "duration_s": (0.0, 1e9), "ramp_s": (0.0, 1e9)}
    trial: int
    start_s: float
    duration_s: float
    force_x_N: float = 0.0
    force_y_N: float = 0.0
    force_z_N: float = 0.0
    point_x_m: float = 0.0
    point_y_m: float = 0.0
    point_z_m: float = 0.0
    ramp_s: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        return scene

    def acts(self, time: float) -> bool:
        """Whether a time [s] is in the interval."""
        return self.start_s <= time + 1e-9 < self.start_s + self.duration_s

    def act(self, data: mujoco.MjData, body: int, R_Wb1: np.ndarray) -> None:
        """Add the force to ``data.xfrc_applied`` of the payload's body.

        Args:
            data: the trial's, with kinematics of this instant.
            body: the payload's body id.
            R_Wb1: axes of robot 1's {b} in the world, shape (3, 3).
        """
        since, left = data.time - self.start_s, self.start_s + self.duration_s - data.time
        grown = max(0.0, min(1.0, since / self.ramp_s, left / self.ramp_s)) if self.ramp_s else 1.0
        force = grown * (R_Wb1 @ [self.force_x_N, self.force_y_N, self.force_z_N])
        arm = data.xmat[body].reshape(3, 3) @ [self.point_x_m, self.point_y_m, self.point_z_m]
        data.xfrc_applied[body, :3] += force
        data.xfrc_applied[body, 3:] += np.cross(data.xpos[body] + arm - data.xipos[body], force)
