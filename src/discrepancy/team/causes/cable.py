"""Cables, straps and springs that pull at a robot's grasp or at the payload."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Mapping, Sequence
from itertools import product
from typing import ClassVar

import numpy as np

from discrepancy.numbers import Numbers
from discrepancy.team.causes.base import REACH_M, Cause, Context, Shape, by_axis, stack
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array
from estimator.so3 import cross

CABLES, CABLE_LINES = 10_000, 100
"""Distinguishable cables: directions 0.1 rad apart times eight stretches; their lines at the payload, 0.1 m apart."""

TETHER_LEVER_M, TETHER_FINER_M, TETHER_STEP_M = 0.4, (0.2, 0.07, 0.025), 0.02
"""Levers of a payload tether [m]: first grid, finer grids, and step of finite differences. Chosen."""

CABLE_STIFFENS_RANGE_PER_M, CABLE_STIFFENS_STEP_PER_M, STRAPS = (-3.0, 1000.0), 20.0, 20
"""Relative growth of a strap's stiffness per metre: range, step of finite differences, distinguishable values."""

CABLE_NEAR_PER_M, CABLE_NEAR_RANGE_PER_M, CABLE_NEAR_STEP_PER_M = 1.0, (0.05, 5.0), 0.4
"""Inverse distance of the anchor [1/m]: first value, range, and step of finite differences. Chosen: size of a room."""

CABLE_STRETCHES_M, CABLE_STRETCH_STEP_M = (0.03, 0.0, 0.1), 0.015
"""Stretch at home [m] tried first (sometimes slack, half of the time, never); step of finite differences. Chosen."""

CABLE_TURNS, CABLE_TURN_STEP = (-0.45, 0.45), 0.15
"""Slopes across each of six axes that give 24 first directions of a cable; step of finite differences. Chosen."""

TURNS, OFFSETS = ("turn_1", "turn_2"), ("offset_1_m", "offset_2_m")
"""Shape numbers: direction, as slopes across an axis; offset of the line from the centre of mass."""
STRETCH, NEAR, STIFFENS = "stretch_m", "near_per_m", "stiffens_per_m"
"""Shape numbers: stretch at home; inverse distance of the anchor; relative growth of stiffness per stretch."""
SLOPE_STEPS: Mapping[str, float] = (
    dict.fromkeys(TURNS, CABLE_TURN_STEP)
    | dict.fromkeys(OFFSETS, TETHER_STEP_M)
    | {STRETCH: CABLE_STRETCH_STEP_M, NEAR: CABLE_NEAR_STEP_PER_M}
    | {STIFFENS: CABLE_STIFFENS_STEP_PER_M}
)


def is_cable(shape: Shape) -> bool:
    """Whether a tether's shape is that of a cable."""
    return STRETCH in shape


def pull(shape: Shape, moved: Array) -> Array:
    """Force over stiffness on the attachment point [m], in {b}, shape (Q, 3).

    A cable is stretched by e at home, and its anchor is at the distance D along the unit vector u. With the point
    displaced by x, the stretch is |D u - x| - D + e, and the force acts along D u - x. A slack cable has no force. A
    strap stretched by d pulls with d + s d^2.

    Args:
        shape: a cable's.
        moved: displacement of the point from home [m], in {b}, shape (Q, 3).
    """
    near = _near(shape)
    away = direction(shape) - near * moved
    length = np.linalg.norm(away, axis=1)
    longer = (near * np.sum(moved**2, axis=1) - 2.0 * moved @ direction(shape)) / (length + 1.0)
    stretched: Array = np.maximum(shape[STRETCH] + longer, 0.0)
    pulled = stretched * (1.0 + _stiffens(shape) * stretched)
    return (pulled / length)[:, None] * away


def direction(shape: Shape) -> Array:
    """Unit vector from the attachment point at home to the anchor, in {b}, shape (3,)."""
    across = np.roll(np.array([np.nan, *(shape[name] for name in TURNS)]), _axis(shape))
    across[_axis(shape)] = 1.0 - 2.0 * (shape["side"] % 2)
    return across / np.linalg.norm(across)


def lever(shape: Shape) -> Array:
    """Vector from the centre of mass to the nearest point of the cable's line at home [m], in {1}, shape (3,)."""
    u, to = direction(shape), np.roll(np.array([0.0, *(shape[name] for name in OFFSETS)]), _axis(shape))
    return np.asarray(to - to @ u * u, dtype=np.float64)


def every_way(stretches_m: Sequence[float] = CABLE_STRETCHES_M) -> list[Shape]:
    """Shapes of cables from every side, with each of some stretches."""
    ways = product(range(6), CABLE_TURNS, CABLE_TURNS, stretches_m)
    return [
        {"side": float(side), TURNS[0]: one, TURNS[1]: two, STRETCH: e, NEAR: CABLE_NEAR_PER_M}
        for side, one, two, e in ways
    ]


def first_ways() -> list[Shape]:
    """Shapes of cables that are tried first."""
    return every_way(CABLE_STRETCHES_M[:1])


def through(at: Array, shape: Shape) -> Shape:
    """Move the cable's line through a point of the payload, given from the centre of mass in {1} [m], shape (3,)."""
    u, axis = direction(shape), _axis(shape)
    _, *offsets = np.roll(at - at[axis] / u[axis] * u, -axis)
    return {**shape, **dict(zip(OFFSETS, map(float, offsets), strict=True))}


def _axis(shape: Shape) -> int:
    return int(shape["side"]) // 2


def _near(shape: Shape) -> float:
    """Inverse distance of the anchor, limited to the size of a room so that the anchor stays in front of the point."""
    return float(np.clip(shape[NEAR], *CABLE_NEAR_RANGE_PER_M))


def _stiffens(shape: Shape) -> float:
    return float(np.clip(shape.get(STIFFENS, 0.0), *CABLE_STIFFENS_RANGE_PER_M))


class Tied(Cause):
    """Force k (anchor - point) on a point of the payload, with the anchor fixed in a robot's {b}.

    The columns are the force at home and the stiffness. With ``stretch_m`` in its shape it is a cable, which has a
    stiffness only.
    """

    family = "sea_torque"
    parameters = ("force_x_N", "force_y_N", "force_z_N", "stiffness_N_per_m")
    scales = (0.1, 0.1, 0.1, 1.0)
    determined: ClassVar[Mapping[str, float]] = SLOPE_STEPS
    absolute: ClassVar[Collection[str]] = SLOPE_STEPS
    positive = ("stiffness_N_per_m",)
    separate = "A run without payload, or a second payload at the same place, separates an outside force from a sensor."

    def pulls(self, n: Numbers, point: str, frame: str) -> str:
        """Describe the pull at a point towards an anchor in a frame, and where the cable is slack and stiffens."""
        said = f"something like a cable pulls at {point} with {n('stiffness_N_per_m', 'N/m')} towards "
        said += f"{n.vector('anchor', 'm')} in {frame} base frame"
        if not n.values.get("length_m"):
            return said
        ends = f"is slack below {n('length_m', 'm')}"
        if not n.values["stiffening_N_per_m2"]:
            return f"{said}, along itself alone, and {ends}"
        return f"{said}, along itself alone, {ends} and stiffens by {n('stiffening_N_per_m2', 'N/m^2')}"

    @abstractmethod
    def attached(self, trial: TrialLinear, robot: int, shape: Shape) -> tuple[Array, Array]:
        """The point in {1}, shape (3,), and its displacement from home in {b}, shape (Q, 3)."""

    def columns(self, trial, robot, joint, shape):
        point, moved = self.attached(trial, robot, shape)
        R_bi, R_1i = trial.data.R_bi[:, robot], trial.shared.grasps.R_1i[robot]
        if is_cable(shape):
            forces = [pull(shape, moved)]
        else:
            forces = [*(np.broadcast_to(axis, moved.shape) for axis in np.eye(3)), -moved]
        forces = [np.einsum("qji,qj->qi", R_bi, force) @ R_1i.T for force in forces]
        pulls = [trial.of_wrench(force, cross(point, force)) for force in forces]
        return stack(
            [*([np.zeros_like(pulls[0])] * (4 - len(pulls))), *pulls]
        )  # a cable has no force at home

    def finer(self, shape):
        """The same cable with other stretches. No gradient leads from a cable that is never slack to one that is."""
        return [{**shape, STRETCH: e} for e in CABLE_STRETCHES_M] if is_cable(shape) else []

    def grown(self, shape):
        """The same cable as a strap, whose stiffness may grow."""
        return [{**shape, STIFFENS: 0.0}] if is_cable(shape) and STIFFENS not in shape else []

    def alike(self, shape):
        return CABLES * (STRAPS if STIFFENS in shape else 1) if is_cable(shape) else self.among

    def tied(self, values: Array, context: Context, point: Array | float = 0.0) -> dict[str, float]:
        """Stiffness, anchor in {b}, and the length below which it is slack, of a point (3,) in {b} beside the wrist."""
        shape, home = context.shape, np.array([0.0, 0.0, context.home_height_m]) + point
        stiffness = values[3] if abs(values[3]) > 1e-6 else 1e-6
        away, length_m = values[:3] / stiffness, 0.0
        if is_cable(shape):
            away = direction(shape) / _near(shape)
            length_m = max(1.0 / _near(shape) - shape[STRETCH], 0.0)
        strength = {"length_m": length_m, "stiffening_N_per_m2": float(stiffness) * _stiffens(shape)}
        return {"stiffness_N_per_m": float(stiffness)} | by_axis("anchor", "m", home + away) | strength


class Tether(Tied):
    """A tether at a robot's grasp, with the anchor fixed in that robot's {b}."""

    title = "tether at {grasp}"
    at = "grasp"
    shapes = ({}, *first_ways())

    def sentence(self, n):
        return self.pulls(n, "the grasp", "its")

    def attached(self, trial, robot, shape):
        moved = trial.data.p_bi[:, robot] - [0.0, 0.0, trial.design.home_height_m]
        return trial.shared.grasps.p_1i[robot], moved

    def further(self, shape):
        return every_way()

    def physical(self, values, context):
        return self.tied(values, context)


TETHER_POINTS = 1000
"""Distinguishable points of a payload, 0.1 m apart: prior odds of an attachment at a grasp against any other point."""

LEVERS = ("lever_x_m", "lever_y_m", "lever_z_m")


class PayloadTether(Tied):
    """A tether of any point of the payload, with the anchor fixed in robot 1's {b}.

    The shape is the point, from the centre of mass in {1}, or gives a cable's line at home.
    """

    title = "tether of the payload"
    at = "payload"
    among = TETHER_POINTS
    shapes: ClassVar[tuple[Shape, ...]] = (
        dict.fromkeys(LEVERS, 0.0),
        *(by_axis("lever", "m", sign * TETHER_LEVER_M * e) for e in np.eye(3) for sign in (1.0, -1.0)),
        *(through(np.zeros(3), way) for way in first_ways()),
    )
    determined: ClassVar[Mapping[str, float]] = {**dict.fromkeys(LEVERS, TETHER_STEP_M), **SLOPE_STEPS}
    absolute: ClassVar[Collection[str]] = determined

    def sentence(self, n):
        return self.pulls(n, f"the payload's point {n.vector('point', 'm')} in {{1}}", "robot 1's")

    def attached(self, trial, robot, shape):
        R, p = trial.data.R_bi[:, 0], trial.data.p_bi[:, 0]  # {1} in {b1}
        point = trial.shared.pi[1:4] / trial.shared.pi[0] + _lever(shape)
        moved = p + R @ point - (np.array([0.0, 0.0, trial.design.home_height_m]) + point)
        return point, moved

    def further(self, shape):
        at = _lever(shape)
        return [through(at, way) for way in every_way()]

    def finer(self, shape):
        """Nearby points, within the payload's reach."""
        if is_cable(shape):
            return super().finer(shape)  # Gauss-Newton steps refine the other numbers
        steps = (sign * far for far in TETHER_FINER_M for sign in (1.0, -1.0))
        moved = [{**shape, name: shape[name] + step} for name, step in product(LEVERS, steps)]
        return [other for other in moved if np.linalg.norm(_lever(other)) <= REACH_M]

    def alike(self, shape):
        return super().alike(shape) * (CABLE_LINES if is_cable(shape) else 1)

    def physical(self, values, context):
        point = context.p_1c + _lever(context.shape)
        return self.tied(values, context, point) | by_axis("point", "m", point)


def _lever(shape):
    """Attachment point from the centre of mass, in {1} [m], shape (3,)."""
    return lever(shape) if is_cable(shape) else np.array([shape[name] for name in LEVERS])
