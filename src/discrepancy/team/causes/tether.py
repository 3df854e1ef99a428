"""A spring from a grasp to a fixed point: a hose, a cable."""

import numpy as np

from discrepancy.team.causes.base import Cause, stack


class Tether(Cause):
    """Force k (anchor - grasp) on the payload at a robot's grasp, anchor fixed in that robot's {b}.

    The columns are the force at the home position and the stiffness.
    """

    title = "tether at {grasp}"
    family = "sea_torque"
    parameters = ("force_x_N", "force_y_N", "force_z_N", "stiffness_N_per_m")
    scales = (0.1, 0.1, 0.1, 1.0)
    at = "grasp"
    positive = ("stiffness_N_per_m",)
    separate = "A run without payload, or a second payload at the same place, separates an outside force from a sensor."

    def sentence(self, n):
        return (
            f"something like a cable pulls at the grasp with {n('stiffness_N_per_m', 'N/m')} towards "
            f"{n.vector('anchor', 'm')} in its base frame"
        )

    def columns(self, trial, robot, joint, shape):
        data, grasps = trial.data, trial.shared.grasps
        home = np.array([0.0, 0.0, trial.design.home_height_m])
        samples = len(trial.s)
        forces = [np.tile(axis, (samples, 1)) for axis in np.eye(3)] + [home - data.p_bi[:, robot]]
        columns = []
        for force_b in forces:
            force = np.einsum("qji,qj->qi", data.R_bi[:, robot], force_b) @ grasps.R_1i[robot].T
            columns.append(trial.of_wrench(force, np.cross(grasps.p_1i[robot], force)))
        return stack(columns)

    def physical(self, values, context):
        k = values[3] if abs(values[3]) > 1e-6 else 1e-6
        anchor = values[:3] / k + np.array([0.0, 0.0, context.home_height_m])
        return {"stiffness_N_per_m": float(k)} | {
            f"anchor_{axis}_m": float(x) for axis, x in zip("xyz", anchor, strict=True)
        }
