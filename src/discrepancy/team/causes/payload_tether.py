"""A spring from the payload to a fixed point: a hose, a cable."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from discrepancy.causes.base import Shape
from discrepancy.team import constants
from discrepancy.team.causes import cable
from discrepancy.team.causes.base import Cause
from estimator.arrays import Array

SLOSH_REACH_M = 1.5
"""From the centre of mass to where it hangs at most. Chosen: no payload of three robots is larger."""

TETHER_POINTS = 1000
"""Points of a payload that are told apart. Derived: every 0.1 m of a metre each way; near the limit they err by 0.05 m.
Without it, a tether of the payload whose point is free would always explain what one at a grasp does."""

LEVERS = ("lever_x_m", "lever_y_m", "lever_z_m")


def _at(lever: Array) -> Shape:
    return dict(zip(LEVERS, lever.tolist(), strict=True))


class PayloadTether(Cause):
    """Force k (anchor - point) on a point of the payload, anchor fixed in robot 1's {b}.

    The columns are the force at home and the stiffness; the point is the shape, seen from the centre of mass along the
    axes of {1}. With ``stretch_m`` in its shape it is a cable, of which stiffness is all, and the point where its line
    is at home.
    """

    title = "tether of the payload"
    family = "sea_torque"
    parameters = ("force_x_N", "force_y_N", "force_z_N", "stiffness_N_per_m")
    scales = (0.1, 0.1, 0.1, 1.0)
    at = "payload"
    among = TETHER_POINTS
    shapes: ClassVar[tuple[Shape, ...]] = (
        dict.fromkeys(LEVERS, 0.0),
        *(_at(sign * constants.TETHER_LEVER_M * e) for e in np.eye(3) for sign in (1.0, -1.0)),
        *(cable.through(np.zeros(3), way) for way in cable.first_ways()),
    )
    fleeting = True
    determined: ClassVar[Mapping[str, float]] = {
        **dict.fromkeys(LEVERS, constants.TETHER_STEP_M),
        **cable.SLOPE_STEPS,
    }
    positive = ("stiffness_N_per_m",)
    separate = "A run without payload, or a second payload at the same place, separates an outside force from a sensor."

    def sentence(self, n):
        return (
            f"something like a cable pulls at the payload's point {n.vector('point', 'm')} in {{1}} with "
            f"{n('stiffness_N_per_m', 'N/m')} towards {n.vector('anchor', 'm')} in robot 1's base frame{cable.slack(n)}"
        )

    def columns(self, trial, robot, joint, shape):
        R, p = trial.data.R_bi[:, 0], trial.data.p_bi[:, 0]  # {1} in {b1}
        point = trial.shared.pi[1:4] / trial.shared.pi[0] + _lever(shape)
        moved = p + R @ point - (np.array([0.0, 0.0, trial.design.home_height_m]) + point)
        if cable.is_cable(shape):
            forces_b = [cable.pull(shape, moved)]
        else:
            forces_b = [*(np.broadcast_to(axis, p.shape) for axis in np.eye(3)), -moved]
        forces = [np.einsum("qji,qj->qi", R, force_b) for force_b in forces_b]
        return cable.beside_force([trial.of_wrench(force, np.cross(point, force)) for force in forces])

    def further(self, shape):
        at = _lever(shape)
        return [cable.through(at, way) for way in cable.every_way()]

    def finer(self, shape):
        """Nearer to the best; a tether is tied within the payload's reach."""
        if cable.is_cable(shape):
            return cable.otherwise_slack(shape)  # slopes tell the rest
        moved = [
            dict(shape) | {name: shape[name] + step}
            for name in LEVERS
            for far in constants.TETHER_FINER_M
            for step in (far, -far)
        ]
        return [other for other in moved if np.linalg.norm(_lever(other)) <= SLOSH_REACH_M]

    def grown(self, shape):
        return cable.strap(shape)

    def alike(self, shape):
        return cable.alike(shape) * constants.CABLE_LINES if cable.is_cable(shape) else self.among

    def slope_step(self, name, number):
        return self.determined[name]

    def physical(self, values, context):
        point = context.p_1c + _lever(context.shape)
        home = np.array([0.0, 0.0, context.home_height_m]) + point
        return cable.tied(values, context.shape, home) | {
            f"point_{axis}_m": float(x) for axis, x in zip("xyz", point, strict=True)
        }


def _lever(shape):
    """From the centre of mass to where it is tied, in {1} [m], shape (3,)."""
    if cable.is_cable(shape):
        return cable.lever(shape)
    return np.array([shape[name] for name in LEVERS])
