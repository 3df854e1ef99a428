"""A team in closed loop, step by step, with MuJoCo's own state at hand."""

from collections.abc import Sequence

import mujoco
import numpy as np

from mocobot_sim.control.control import ControlGains, TeamController
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home

BASE_HEIGHT_M = 0.46  # origin of {b} over the floor, from models/omnid/omnid.xml


class ClosedLoop:
    """One control tick and one 1 ms step at a time."""

    def __init__(
        self, scene: TeamScene, gains: ControlGains | None = None, as_built: Sequence[AsBuilt] = ()
    ) -> None:
        self.scene = scene
        self.model = scene.compile()
        self.data = mujoco.MjData(self.model)
        self.index = TeamIndex.of(self.model)
        self.torque = assemble_at_home(scene, self.model, self.data, self.index)
        self.controller = TeamController(
            self.index, omnid_design(), gains or ControlGains(), self.data, as_built
        )

    def run(self, seconds: float, ref_b: np.ndarray, ref_dot_b: np.ndarray | None = None) -> None:
        """Hold one command."""
        ref_dot_b = np.zeros_like(ref_b) if ref_dot_b is None else ref_dot_b
        for _ in range(round(seconds * 1000)):
            self.controller.update(ref_b, ref_dot_b)
            mujoco.mj_step(self.model, self.data)
        mujoco.mj_forward(self.model, self.data)

    def wrist(self) -> np.ndarray:
        """Wrist positions in {b} from the platforms' slide joints [m], shape (N, 3)."""
        return self.data.qpos[self.index.slide_qpos] + [0.0, 0.0, omnid_design().home_height_m]

    def phi(self) -> np.ndarray:
        """Driven angles [rad], shape (N, 3), from the orientation of each proximal link in its base."""
        angles = []
        for i in range(self.index.robots):
            R_Wb = self.data.body(f"omnid{i + 1}/base").xmat.reshape(3, 3)
            along = [self.data.body(f"omnid{i + 1}/proximal{k}").xmat.reshape(3, 3)[:, 0] for k in (1, 2, 3)]
            for k, x_b in enumerate(np.array(along) @ R_Wb):
                outward = np.array([np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3), 0.0])
                angles.append(np.arctan2(x_b[2], x_b @ outward))
        return np.array(angles).reshape(-1, 3)

    def forces_on_payload(self) -> np.ndarray:
        """Force of every robot on the payload in the world [N], shape (N, 3): MuJoCo's own, after a forward pass.

        Robot 1 carries the payload as a child body: the force through that joint is ``cfrc_int``. The others
        hold it by welds, whose first three rows are forces along the world's axes on their flange.
        """
        model, data = self.model, self.data
        mujoco.mj_rnePostConstraint(model, data)
        forces = [data.cfrc_int[self.index.payload_body, 3:].copy()]
        for i in range(1, self.index.robots):
            rows = np.flatnonzero(
                (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY)
                & (data.efc_id == model.equality(f"grasp{i + 1}").id)
            )
            assert len(rows) == 6
            forces.append(-data.efc_force[rows[:3]])
        return np.array(forces)


def base_poses(scene: TeamScene) -> tuple[np.ndarray, np.ndarray]:
    """Position [m] and orientation of every {b} in the world, shapes (N, 3), (N, 3, 3), from the grasps alone."""
    R_1i = scene.X_1i.rotation.as_matrix()
    yaw = np.arctan2(R_1i[:, 1, 0], R_1i[:, 0, 0])
    R_Wb = np.zeros((scene.robots, 3, 3))
    R_Wb[:, 0, 0] = R_Wb[:, 1, 1] = np.cos(yaw)
    R_Wb[:, 1, 0], R_Wb[:, 0, 1] = np.sin(yaw), -np.sin(yaw)
    R_Wb[:, 2, 2] = 1.0
    p_Wb = scene.X_1i.translation.copy()
    p_Wb[:, 2] = BASE_HEIGHT_M
    return p_Wb, R_Wb


def in_world(scene: TeamScene, points_b: np.ndarray) -> np.ndarray:
    """Points given in every robot's {b}, shape (..., N, 3), in the world."""
    p_Wb, R_Wb = base_poses(scene)
    return p_Wb + np.einsum("nij,...nj->...ni", R_Wb, points_b)
