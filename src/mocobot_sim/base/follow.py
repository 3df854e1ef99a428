"""Bases that follow what their arms hold: each keeps itself under its own wrist."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from estimator.arm.delta import forward_kinematics
from estimator.arrays import Array
from mocobot_sim.base.drive import BaseDrive
from mocobot_sim.base.motion import PlanarMotion, moved, wrapped, yaw_of
from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.as_built import AsBuilt, units_of
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.trial.actors import Stage


class FollowingDrive(BaseDrive):
    """Drives of bases whose plan is made as they go: an actor of a trial.

    Every base reads its own arm: by how far the wrist has left the place over the base, and by how far the gimbal has
    turned about z. It drives at a speed that would undo that in 1 / gain, within limits.

    Args:
        mounts: where the robots stand at the beginning, N transforms.
        as_built: sensor zeros of every unit; empty for robots as designed.
        gain_per_s: g [1/s].
        fastest: limits of turning [rad/s] and of each component of velocity [m/s].
        rate_hz: control rate [Hz].
    """

    def __init__(
        self,
        mounts: RigidTransform,
        as_built: Sequence[AsBuilt] = (),
        gain_per_s: float = 3.0,
        fastest: tuple[float, float] = (0.6, 0.4),
        rate_hz: float = 1000.0,
    ) -> None:
        place = np.column_stack([mounts.translation[:, :2], yaw_of(mounts.rotation.as_matrix())])
        super().__init__(PlanarMotion(rate_hz, place[None], np.zeros((1, len(mounts), 3))))
        self._follow, self._limit = gain_per_s, np.array([fastest[0], fastest[1], fastest[1]])
        units = units_of(as_built, len(mounts))
        self._phi_zero = np.array([unit.phi_zero_rad for unit in units])
        self._theta_zero = np.array([unit.theta_zero_rad[0] for unit in units])

    def start(self, stage: Stage) -> None:
        """Begin; the wrists are where they shall stay over their bases.

        Raises:
            InputError: as ``BaseDrive.begin``.
        """
        super().start(stage)
        self._stage = stage
        self._goal = self._pose[0].copy()
        self._wanted = np.zeros_like(self._goal)
        self._home = self._offsets()

    def _offsets(self) -> Array:
        """Gimbal's turn about z [rad] and wrist's x, y [m] in every {b}, as the sensors have them, shape (N, 3)."""
        design, index, qpos = omnid_design(), self._stage.index, self._stage.data.qpos
        phi = home_phi(design) + qpos[index.motor_qpos] + qpos[index.spring_qpos] + self._phi_zero
        turn = qpos[index.gimbal_qpos[:, 0]] + self._theta_zero
        return np.column_stack([turn, forward_kinematics(phi, design)[:, :2]])

    def _planned(self, tick: int) -> tuple[Array, Array]:
        if tick % self._ticks == 0:
            offset = self._offsets() - self._home
            offset[:, 0] = wrapped(offset[:, 0])
            self._wanted = np.clip(self._follow * offset, -self._limit, self._limit)
        self._goal = moved(self._goal, self._wanted / self._rate_hz)
        return self._goal, self._wanted
