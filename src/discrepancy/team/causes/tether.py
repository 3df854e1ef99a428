"""A spring from a grasp to a fixed point: a hose, a cable."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from discrepancy.team.causes import cable
from discrepancy.team.causes.base import Cause


class Tether(Cause):
    """Force k (anchor - grasp) on the payload at a robot's grasp, anchor fixed in that robot's {b}.

    The columns are the force at the home position and the stiffness. With ``stretch_m`` in its shape it is a cable, of
    which stiffness is all.
    """

    title = "tether at {grasp}"
    family = "sea_torque"
    parameters = ("force_x_N", "force_y_N", "force_z_N", "stiffness_N_per_m")
    scales = (0.1, 0.1, 0.1, 1.0)
    at = "grasp"
    shapes = ({}, *cable.first_ways())
    fleeting = True
    determined: ClassVar[Mapping[str, float]] = cable.SLOPE_STEPS
    positive = ("stiffness_N_per_m",)
    separate = "A run without payload, or a second payload at the same place, separates an outside force from a sensor."

    def sentence(self, n):
        return (
            f"something like a cable pulls at the grasp with {n('stiffness_N_per_m', 'N/m')} towards "
            f"{n.vector('anchor', 'm')} in its base frame{cable.slack(n)}"
        )

    def columns(self, trial, robot, joint, shape):
        data, grasps = trial.data, trial.shared.grasps
        home = np.array([0.0, 0.0, trial.design.home_height_m])
        moved = data.p_bi[:, robot] - home
        if cable.is_cable(shape):
            forces = [cable.pull(shape, moved)]
        else:
            forces = [*(np.broadcast_to(axis, moved.shape) for axis in np.eye(3)), -moved]
        columns = []
        for force_b in forces:
            force = np.einsum("qji,qj->qi", data.R_bi[:, robot], force_b) @ grasps.R_1i[robot].T
            columns.append(trial.of_wrench(force, np.cross(grasps.p_1i[robot], force)))
        return cable.beside_force(columns)

    def further(self, shape):
        return cable.every_way()

    def grown(self, shape):
        return cable.strap(shape)

    def finer(self, shape):
        return cable.otherwise_slack(shape)

    def alike(self, shape):
        return cable.alike(shape) if cable.is_cable(shape) else self.among

    def slope_step(self, name, number):
        return self.determined[name]

    def physical(self, values, context):
        return cable.tied(values, context.shape, np.array([0.0, 0.0, context.home_height_m]))
