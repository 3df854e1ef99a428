"""The causes at a joint: what one unit of each number adds to the measured torque."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from estimator.arrays import Array

Shape = Mapping[str, float]


@dataclass(frozen=True, eq=False)
class JointSignals:
    """One joint of one log, W samples.

    Attributes:
        q, v, a: position, velocity, acceleration, shape (W,).
        direction: of the motion in [-1, 1], shape (W,).
        load: torque that the model asks for without friction, shape (W,).
        asked: the same with the model's friction, shape (W,).
        torque: as measured, shape (W,).
        t: time [s], shape (W,).
        dt: step [s].
        travel, middle: range of the positions over all logs, and its middle.
        speed: root mean square of the velocity over all logs.
        until: duration of the longest log [s].
    """

    q: Array
    v: Array
    a: Array
    direction: Array
    load: Array
    asked: Array
    torque: Array
    t: Array
    dt: float
    travel: float
    middle: float
    speed: float
    until: float


@dataclass(frozen=True)
class Span:
    """Sizes of one joint that priors are made of.

    Attributes:
        torque: root mean square of the measured torque [N m or N].
        speed: of the velocity.
        acceleration: of the acceleration.
        travel: range of the position.
    """

    torque: float
    speed: float
    acceleration: float
    travel: float


@dataclass(frozen=True)
class JointCause:
    """One cause at a joint.

    Attributes:
        name: of the cause.
        parameters: names with units, k of them.
        columns: (signals, shape) -> arrays (W,), k of them.
        slab: (span, shape) -> standard deviations if the cause is there, k of them.
        shapes: numbers inside the columns that are tried.
        positive: parameters that cannot be negative.
    """

    name: str
    parameters: tuple[str, ...]
    columns: Callable[[JointSignals, Shape], Sequence[Array]]
    slab: Callable[[Span, Shape], Sequence[float]]
    shapes: tuple[Shape, ...] = ({},)
    positive: tuple[str, ...] = ()
    group: Mapping[str, float] = field(default_factory=dict)


def _bent(s: JointSignals, bristle: float) -> Array:
    """Direction of dry friction that gives way by a small angle first (Dahl 1968)."""
    step = np.diff(s.q, prepend=s.q[0])
    keep = np.exp(-np.abs(step) / bristle)
    side = np.sign(step)
    out, last = np.empty_like(s.q), 0.0
    for k in range(len(out)):
        last = side[k] + (last - side[k]) * keep[k]
        out[k] = last
    return out


def _friction(s: JointSignals, shape: Shape) -> Sequence[Array]:
    dry = _bent(s, shape["bristle_rad"]) if "bristle_rad" in shape else s.direction
    return dry, s.v


def _sublinear(s: JointSignals, shape: Shape) -> Sequence[Array]:
    return (s.direction * np.log1p(np.abs(s.v) / (shape["share"] * s.speed)), )


CAUSES = (
    JointCause("friction", ("coulomb_Nm", "viscous_Nms_per_rad"), _friction,
               lambda z, h: (z.torque, z.torque / z.speed),
               ({},)),
    JointCause("torque_offset", ("offset_Nm",), lambda s, h: (np.ones_like(s.q),), lambda z, h: (z.torque,)),
    JointCause("armature", ("armature_kgm2",), lambda s, h: (s.a,), lambda z, h: (z.torque / z.acceleration,)),
    JointCause("torque_scale", ("scale",), lambda s, h: (s.asked * (1.0 + h["bend"] * (np.abs(s.asked) / (np.sqrt(np.mean(s.asked**2)) + 1e-12) - 1.0)),),
               lambda z, h: (0.5,), ({"bend": 0.0}, {"bend": -0.1}, {"bend": 0.1})),
    JointCause("torque_delay", ("delay_s",), lambda s, h: (-np.gradient(s.torque, s.dt),), lambda z, h: (0.02,)),
    JointCause("stribeck", ("excess_Nm",), lambda s, h: (s.direction * np.exp(-np.abs(s.v) / (h["share"] * s.speed)),),
               lambda z, h: (z.torque,), ({"share": 0.05}, {"share": 0.1}, {"share": 0.2})),
    JointCause("asymmetric_coulomb", ("asymmetry_Nm",), lambda s, h: (np.abs(s.direction),), lambda z, h: (z.torque,)),
    JointCause("asymmetric_viscous", ("asymmetry_Nms_per_rad",), lambda s, h: (np.abs(s.v),), lambda z, h: (z.torque / z.speed,)),
    JointCause("sublinear_friction", ("bend_Nm",), _sublinear, lambda z, h: (z.torque,), ({"share": 0.1}, {"share": 0.3}, {"share": 1.0})),
    JointCause("load_friction", ("share",), lambda s, h: (s.direction * np.abs(s.load),), lambda z, h: (0.3,)),
    JointCause("warming", ("more_Nm", "more_Nms_per_rad"),
               lambda s, h: (s.direction * np.exp(-s.t / (h["share"] * s.until)), s.v * np.exp(-s.t / (h["share"] * s.until))),
               lambda z, h: (z.torque, z.torque / z.speed), ({"share": 0.1}, {"share": 0.3}, {"share": 1.0})),
    JointCause("spring", ("stiffness_Nm_per_rad", "offset_Nm"), lambda s, h: (s.q - s.middle, np.ones_like(s.q)),
               lambda z, h: (2.0 * z.torque / z.travel, z.torque)),
    JointCause("counterbalance", ("cosine_Nm", "sine_Nm"), lambda s, h: (np.cos(s.q), np.sin(s.q)), lambda z, h: (z.torque, z.torque)),
    JointCause("ripple", ("cosine_Nm", "sine_Nm"), lambda s, h: (np.cos(h["turns"] * s.q), np.sin(h["turns"] * s.q)),
               lambda z, h: (z.torque, z.torque), ({"turns": 2.0}, {"turns": 3.0}, {"turns": 4.0}, {"turns": 6.0})),
)
"""At one joint."""
