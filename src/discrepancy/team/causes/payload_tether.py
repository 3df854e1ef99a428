"""A spring from the payload to a fixed point: a hose, a cable."""

import numpy as np

from discrepancy import rules
from discrepancy.team.causes.base import Cause, stack


class PayloadTether(Cause):
    """Force k (anchor - point) on a point of the payload, anchor fixed in robot 1's {b}.

    The columns are the force at home, its moment about the centre of mass and the stiffness there; the moment is taken
    for constant in {1}, as the payload turns by some degrees only.
    """

    title = "tether of the payload"
    family = "sea_torque"
    parameters = (
        "force_x_N", "force_y_N", "force_z_N", "moment_x_Nm", "moment_y_Nm", "moment_z_Nm", "stiffness_N_per_m"
    )  # fmt: skip
    scales = (0.1, 0.1, 0.1, 0.03, 0.03, 0.03, 1.0)
    at = "payload"
    positive = ("stiffness_N_per_m",)
    separate = "A run without payload, or a second payload at the same place, separates an outside force from a sensor."

    def sentence(self, n):
        return (
            f"something like a cable pulls at the payload's point {n.vector('point', 'm')} in {{1}} with "
            f"{n('stiffness_N_per_m', 'N/m')} towards {n.vector('anchor', 'm')} in robot 1's base frame"
        )

    def columns(self, trial, robot, joint, shape):
        R, p = trial.data.R_bi[:, 0], trial.data.p_bi[:, 0]  # {1} in {b1}
        com = trial.shared.pi[1:4] / trial.shared.pi[0]
        away = np.array([0.0, 0.0, trial.design.home_height_m]) + com - (p + R @ com)
        forces = [np.einsum("qji,j->qi", R, axis) for axis in np.eye(3)] + [np.einsum("qji,qj->qi", R, away)]
        columns = [trial.of_wrench(force, np.cross(com, force)) for force in forces]
        none = np.zeros_like(p)
        moments = [trial.of_wrench(none, np.tile(axis, (len(p), 1))) for axis in np.eye(3)]
        return stack([*columns[:3], *moments, columns[3]])

    def possible(self, values, se, shape):
        """It must pull the more the farther it is.

        A constant force down is also what the arms' own weight and a scale common to all springs leave open.
        """
        return bool(values[6] > rules.PULL_SE * se[6])

    def physical(self, values, context):
        force, moment, k = values[:3], values[3:6], values[6] if abs(values[6]) > 1e-6 else 1e-6
        # Only the line of action shows; the point on it nearest to the centre of mass is named.
        point = context.p_1c + np.cross(force, moment) / max(force @ force, 1e-12)
        anchor = force / k + np.array([0.0, 0.0, context.home_height_m]) + point
        return (
            {"stiffness_N_per_m": float(k)}
            | {f"anchor_{axis}_m": float(x) for axis, x in zip("xyz", anchor, strict=True)}
            | {f"point_{axis}_m": float(x) for axis, x in zip("xyz", point, strict=True)}
        )
