"""A spring from the payload to a fixed point: a hose, a cable."""

from typing import ClassVar

import numpy as np

from discrepancy import rules
from discrepancy.team.causes.base import Cause, stack

LEVERS = ("lever_x_m", "lever_y_m", "lever_z_m")


class PayloadTether(Cause):
    """Force k (anchor - point) on a point of the payload, anchor fixed in robot 1's {b}.

    The columns are the force at home and the stiffness; the point is the shape, seen from the centre of mass along the
    axes of {1}.
    """

    title = "tether of the payload"
    family = "sea_torque"
    parameters = ("force_x_N", "force_y_N", "force_z_N", "stiffness_N_per_m")
    scales = (0.1, 0.1, 0.1, 1.0)
    at = "payload"
    among = rules.TETHER_POINTS
    shapes = tuple(
        dict(zip(LEVERS, map(float, lever), strict=True))
        for lever in (
            np.zeros(3),
            *(sign * rules.TETHER_LEVER_M * e for e in np.eye(3) for sign in (1.0, -1.0)),
        )
    )
    determined: ClassVar = dict.fromkeys(LEVERS, rules.TETHER_STEP_M)
    positive = ("stiffness_N_per_m",)
    separate = "A run without payload, or a second payload at the same place, separates an outside force from a sensor."

    def sentence(self, n):
        return (
            f"something like a cable pulls at the payload's point {n.vector('point', 'm')} in {{1}} with "
            f"{n('stiffness_N_per_m', 'N/m')} towards {n.vector('anchor', 'm')} in robot 1's base frame"
        )

    def columns(self, trial, robot, joint, shape):
        R, p = trial.data.R_bi[:, 0], trial.data.p_bi[:, 0]  # {1} in {b1}
        point = trial.shared.pi[1:4] / trial.shared.pi[0] + _lever(shape)
        away = np.array([0.0, 0.0, trial.design.home_height_m]) + point - (p + R @ point)
        forces = [np.einsum("qji,j->qi", R, axis) for axis in np.eye(3)] + [np.einsum("qji,qj->qi", R, away)]
        return stack([trial.of_wrench(force, np.cross(point, force)) for force in forces])

    def finer(self, shape):
        """Nearer to the best; a tether is tied within the payload's reach."""
        moved = [
            dict(shape) | {name: shape[name] + step}
            for name in LEVERS
            for far in rules.TETHER_FINER_M
            for step in (far, -far)
        ]
        return [other for other in moved if np.linalg.norm(_lever(other)) <= rules.SLOSH_REACH_M]

    def slope_step(self, name, number):
        return self.determined[name]

    def possible(self, values, se, shape):
        """It must pull the more the farther it is.

        A constant force down is also what the arms' own weight and a scale common to all springs leave open.
        """
        return bool(values[3] > rules.PULL_SE * se[3])

    def physical(self, values, context):
        force, k = values[:3], values[3] if abs(values[3]) > 1e-6 else 1e-6
        point = context.p_1c + _lever(context.shape)
        anchor = force / k + np.array([0.0, 0.0, context.home_height_m]) + point
        return (
            {"stiffness_N_per_m": float(k)}
            | {f"anchor_{axis}_m": float(x) for axis, x in zip("xyz", anchor, strict=True)}
            | {f"point_{axis}_m": float(x) for axis, x in zip("xyz", point, strict=True)}
        )


def _lever(shape):
    """From the centre of mass to where it is tied, in {1} [m], shape (3,)."""
    return np.array([shape[name] for name in LEVERS])
