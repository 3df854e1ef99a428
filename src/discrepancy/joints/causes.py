"""Causes at a joint, one entry each: what one unit of each number adds to the measured torque."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array

Shape = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class JointSignals:
    """One joint of one log, W samples.

    Attributes:
        q, v, a: position [rad or m] and its derivatives, shape (W,).
        direction: of the motion, -1 to 1, shape (W,).
        load: torque that the model asks for without friction [N m or N], shape (W,).
        asked: the same with friction, shape (W,).
        torque: as measured, shape (W,).
        t: time [s], shape (W,).
        span: sizes over all logs.
    """

    q: Array
    v: Array
    a: Array
    direction: Array
    load: Array
    asked: Array
    torque: Array
    t: Array
    span: Span

    @property
    def step_s(self) -> float:
        """Time between samples [s]."""
        return float(self.t[1] - self.t[0])


@dataclass(frozen=True)
class Span:
    """Sizes of one joint over all logs, which priors are made of.

    Attributes:
        torque, speed, acceleration: root mean squares.
        travel, middle: range of the position, and its middle.
        until_s: duration of the longest log [s].
    """

    torque: float
    speed: float
    acceleration: float
    travel: float
    middle: float
    until_s: float


@dataclass(frozen=True)
class JointCause:
    """One cause at a joint.

    Attributes:
        name: as in results.
        title: in words; ``{joint}`` is the place.
        parameters: names with units of joints that turn, k of them.
        columns: of (signals, shape), k series (W,) in N m or N per unit.
        slab: of (span, shape), prior standard deviations if the cause is there, k of them.
        shapes: numbers inside the columns that are tried.
        positive: parameters that, with the model's own, cannot be negative.
        kind: whether all joints may have it alike: a cause of the robot.
        rubs: whether friction at rest has the first parameter in it.
        loose: how far its law may be off, over what is usual; friction has no exact law.
    """

    name: str
    title: str
    parameters: tuple[str, ...]
    columns: Callable[[JointSignals, Shape], Sequence[Array]]
    slab: Callable[[Span, Shape], Sequence[float]]
    shapes: tuple[Shape, ...] = ({},)
    positive: tuple[str, ...] = ()
    kind: bool = False
    rubs: bool = False
    loose: float = 1.0


def _faded(s: JointSignals, h: Shape) -> Array:
    return np.exp(-s.t / (h["share"] * s.span.until_s))


def _scaled(s: JointSignals, h: Shape) -> Array:
    typical = float(np.sqrt(np.mean(s.asked**2))) or 1.0
    return s.asked * (1.0 + h["bend"] * (np.abs(s.asked) / typical - 1.0))


SHARES = ({"share": 0.1}, {"share": 0.3}, {"share": 1.0})
SPEEDS = ({"share": 0.05}, {"share": 0.1}, {"share": 0.2})
CAUSES = (
    JointCause(
        "friction", "friction in {joint}", ("coulomb_Nm", "viscous_Nms_per_rad"),
        lambda s, h: (s.direction, s.v), lambda z, h: (z.torque, z.torque / z.speed),
        positive=("coulomb_Nm", "viscous_Nms_per_rad"), kind=True, rubs=True, loose=2.0,
    ),
    JointCause(
        "torque_offset", "offset of the torque of {joint}", ("offset_Nm",),
        lambda s, h: (np.ones_like(s.q),), lambda z, h: (z.torque,), kind=True,
    ),
    JointCause(
        "armature", "rotor inertia of {joint}", ("armature_kgm2",),
        lambda s, h: (s.a,), lambda z, h: (z.torque / z.acceleration,), positive=("armature_kgm2",), kind=True,
    ),
    JointCause(
        "torque_scale", "scale of the torque of {joint}", ("scale",),
        lambda s, h: (_scaled(s, h),), lambda z, h: (0.5,), ({"bend": 0.0}, {"bend": -0.1}, {"bend": 0.1}), kind=True,
    ),
    JointCause(
        "torque_delay", "delay of the torque of {joint}", ("delay_s",),
        lambda s, h: (-np.gradient(s.torque, s.step_s),), lambda z, h: (0.02,), kind=True,
    ),
    JointCause(
        "stribeck", "Stribeck friction in {joint}", ("excess_Nm",),
        lambda s, h: (s.direction * np.exp(-np.abs(s.v) / (h["share"] * s.span.speed)),), lambda z, h: (z.torque,),
        SPEEDS, rubs=True, loose=2.0,
    ),
    JointCause(
        "asymmetric_coulomb", "Coulomb friction in {joint} that differs by direction", ("asymmetry_Nm",),
        lambda s, h: (np.abs(s.direction),), lambda z, h: (z.torque,), loose=2.0,
    ),
    JointCause(
        "asymmetric_viscous", "viscous friction in {joint} that differs by direction", ("asymmetry_Nms_per_rad",),
        lambda s, h: (np.abs(s.v),), lambda z, h: (z.torque / z.speed,), loose=2.0,
    ),
    JointCause(
        "sublinear_friction", "sublinear friction in {joint}", ("bend_Nm",),
        lambda s, h: (s.direction * np.log1p(np.abs(s.v) / (h["share"] * s.span.speed)),), lambda z, h: (z.torque,),
        SHARES, loose=2.0,
    ),
    JointCause(
        "load_friction", "friction by load in {joint}", ("share",),
        lambda s, h: (s.direction * np.abs(s.load),), lambda z, h: (0.3,), loose=2.0,
    ),
    JointCause(
        "warming", "fading friction in {joint}", ("more_Nm", "more_Nms_per_rad"),
        lambda s, h: (s.direction * _faded(s, h), s.v * _faded(s, h)), lambda z, h: (z.torque, z.torque / z.speed),
        SHARES, rubs=True, loose=2.0,
    ),
    JointCause(
        "spring", "spring at {joint}", ("stiffness_Nm_per_rad", "offset_Nm"),
        lambda s, h: (s.q - s.span.middle, np.ones_like(s.q)), lambda z, h: (2.0 * z.torque / z.travel, z.torque),
    ),
    JointCause(
        "counterbalance", "counterbalance of {joint}", ("cosine_Nm", "sine_Nm"),
        lambda s, h: (np.cos(s.q), np.sin(s.q)), lambda z, h: (z.torque, z.torque),
    ),
    JointCause(
        "ripple", "torque ripple in {joint}", ("cosine_Nm", "sine_Nm"),
        lambda s, h: (np.cos(h["turns"] * s.q), np.sin(h["turns"] * s.q)), lambda z, h: (z.torque, z.torque),
        ({"turns": 2.0}, {"turns": 3.0}, {"turns": 4.0}, {"turns": 6.0}),
    ),
)  # fmt: skip
"""At one joint."""
