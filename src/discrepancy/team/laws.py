"""Where something may be wrong that no table lists, what it may be a function of, and what it does to the rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arm.gimbal import moment_about_axes
from estimator.arrays import Array
from estimator.rigid_team.slots import PHI, PHI_DDOT, PHI_DOT, TAU, THETA, THETA_DDOT, THETA_DOT

LAW_SLOW_RAD_PER_S = 4e-3
"""Below which a direction of motion fades. Chosen: as in the friction of the catalogue."""

Kind = Literal[
    "time", "angle", "travel", "rate", "acceleration", "torque", "direction", "position", "velocity", "tilt", "vector"
]  # fmt: skip


@dataclass(frozen=True)
class Variable:
    """One signal.

    Attributes:
        name: as in the JSON and in the simulator's effect ``law``, such as ``phi_2_1``.
        words: for people, such as ``angle of driven joint 1 of robot 2``.
        symbol: in a formula.
        unit: of its values.
        kind: decides which functions of it make sense.
        slow: of a rate, below which its direction fades [``unit``].
        wave: of an angle or a travel, by which the phase of its slowest sine grows [rad per ``unit``]: once a turn, or
            once over the whole way.
        parts: of a vector, its components; a law by all of them has no direction that was chosen beforehand.
        turns: of what is felt at the origin, the turn accelerations that change it elsewhere, component by component.
    """

    name: str
    words: str
    symbol: str
    unit: str
    kind: Kind
    slow: float = LAW_SLOW_RAD_PER_S
    wave: float = 1.0
    parts: tuple[Variable, ...] = ()
    turns: tuple[Variable, ...] = ()

    @property
    def each(self) -> tuple[Variable, ...]:
        """Its components, or itself."""
        return (*self.parts, *self.turns) or (self,)

    @property
    def axes(self) -> tuple[str, ...]:
        """Of a vector, what its components' names end with."""
        return tuple(part.name.removeprefix(f"{self.name}_") for part in self.parts)


TIME = Variable("time", "time", "t", "s", "time")
"""Since the trial began."""


_JOINTS: dict[str, tuple[slice, str, str, str, Kind]] = {
    "phi": (PHI, "angle of driven joint {j} of robot {i}", "phi", "rad", "angle"),
    "phi_rate": (PHI_DOT, "rate of driven joint {j} of robot {i}", "phi'", "rad/s", "rate"),
    "phi_acceleration": (PHI_DDOT, "acceleration of driven joint {j} of robot {i}", "phi''", "rad/s^2", "acceleration"),
    "theta": (THETA, "angle of gimbal axis {j} of robot {i}", "theta", "rad", "angle"),
    "theta_rate": (THETA_DOT, "rate of gimbal axis {j} of robot {i}", "theta'", "rad/s", "rate"),
    "theta_acceleration": (
        THETA_DDOT, "acceleration of gimbal axis {j} of robot {i}", "theta''", "rad/s^2", "acceleration",
    ),
    "tau": (TAU, "torque of driven joint {j} of robot {i}", "tau", "N m", "torque"),
}  # fmt: skip
_PAYLOAD: dict[str, tuple[str, str, str, Kind]] = {
    "payload_position": ("position of the payload along {axis}", "p", "m", "position"),
    "payload_velocity": ("velocity of the payload along {axis}", "v", "m/s", "velocity"),
    "payload_acceleration": ("acceleration of the payload along {axis}", "a", "m/s^2", "acceleration"),
    "payload_felt": (
        "acceleration that the payload feels, less gravity, along its {axis}", "f", "m/s^2", "acceleration",
    ),
    "payload_rate": ("turn rate of the payload about its {axis}", "omega", "rad/s", "rate"),
    "payload_turn": ("turn acceleration of the payload about its {axis}", "alpha", "rad/s^2", "acceleration"),
    "payload_up": ("tilt of the payload, component of up along its {axis}", "up", "1", "tilt"),
}  # fmt: skip


def joint_variable(name: str, robot: int, joint: int) -> Variable:
    """A signal of one joint (robot and joint from 1)."""
    _, words, symbol, unit, kind = _JOINTS[name]
    said = words.format(i=robot, j=joint)
    return Variable(f"{name}_{robot}_{joint}", said, f"{symbol}_{robot}{joint}", unit, kind)


def payload_variable(name: str, axis: str) -> Variable:
    """A signal of the payload: position and velocity in {b1}, the others in {1}."""
    words, symbol, unit, kind = _PAYLOAD[name]
    return Variable(f"{name}_{axis}", words.format(axis=axis), f"{symbol}_{axis}", unit, kind)


def payload_felt() -> Variable:
    """What something in the payload feels, wherever it sits."""
    parts, turns = (
        tuple(payload_variable(n, axis) for axis in "xyz") for n in ("payload_felt", "payload_turn")
    )
    words = "acceleration felt in the payload, less gravity"
    return Variable("payload_felt", words, "f", parts[0].unit, "vector", parts=parts, turns=turns)


def signals_of(linear: TrialLinear) -> dict[str, Array]:
    """Values of all of them in one trial, shape (Q,) each."""
    signals, out = linear.signals, {TIME.name: linear.signals.time - linear.signals.time[0]}
    for name, (slots, *_) in _JOINTS.items():
        for i in range(linear.robots):
            for j in range(3):
                out[f"{name}_{i + 1}_{j + 1}"] = linear.s[:, i, slots][:, j]
    motion = linear.motion
    position = linear.data.p_bi[:, 0]
    vectors = {
        "payload_position": position,
        "payload_velocity": signals.with_rates(position)[1],
        "payload_acceleration": motion.acceleration,
        "payload_felt": motion.acceleration + linear.data.gravity_mps2 * motion.up,
        "payload_rate": motion.omega,
        "payload_turn": motion.alpha,
        "payload_up": motion.up,
    }
    for name, vector in vectors.items():
        for axis, values in zip("xyz", np.asarray(vector).T, strict=True):
            out[f"{name}_{axis}"] = np.ascontiguousarray(values)
    return out


@dataclass(frozen=True)
class Place:
    """One error signal, or one for each of some axes.

    Attributes:
        name: what is wrong, as in the JSON, such as ``tau reading``.
        robot, joint: where, from 1, or None.
        targets: the simulator's name of what each component adds to, such as ``tau_2_1``.
        axes: names of the components in words; one empty name where there is one.
        unit: of the error.
        title: in words, with the part in braces as in ``Candidate.title``.
        own: signals of the same joint or robot: those that it most likely depends on.
        offset: whether a constant has to go with every law, because no cause of the catalogue is one here.
        without: signals that hold the error itself, such as the very torque that is read; it is no function of those.
        where: the place in words, of what sits at no robot and no joint.
        called: what the part is called besides its number, such as `` (elbow)``.
        units: of each component where they differ from ``unit``; empty where they do not.
        twin: name of a place whose rows are the same, minus these; only the response to the commands separates them.
    """

    name: str
    robot: int | None
    joint: int | None
    targets: tuple[str, ...]
    axes: tuple[str, ...]
    unit: str
    title: str
    own: tuple[Variable, ...] = ()
    offset: bool = False
    units: tuple[str, ...] = ()
    twin: str | None = None
    without: tuple[Variable, ...] = ()
    where: str = "payload"
    called: str = ""

    @property
    def key(self) -> tuple[str, int | None, int | None]:
        """Which place."""
        return self.name, self.robot, self.joint


XYZ = ("x", "y", "z")
READINGS = {"phi reading": "phi", "theta reading": "theta", "tau reading": "tau"}


def places_of(robots: int) -> list[Place]:
    """Places of N robots and their payload, in the order in which they are tried."""
    out = []
    for i in range(1, robots + 1):
        for j in (1, 2, 3):
            driven = tuple(joint_variable(n, i, j) for n in ("phi", "phi_rate", "phi_acceleration", "tau"))
            gimbal = tuple(joint_variable(n, i, j) for n in ("theta", "theta_rate", "theta_acceleration"))
            out += [
                _joint("tau reading", i, j, "tau", "N m", "reading of the torque sensor of {driven joint}", driven,
                       twin="driven torque"),
                _joint("phi reading", i, j, "phi", "rad", "reading of the angle of {driven joint}", driven),
                _joint("theta reading", i, j, "theta", "rad", "reading of the angle of {gimbal axis}", gimbal),
                _joint("gimbal torque", i, j, "gimbal_torque", "N m", "torque in {gimbal axis}", gimbal, offset=True),
            ]  # fmt: skip
        out.append(
            Place("base position", i, None, tuple(f"base_position_{i}_{a}" for a in XYZ), XYZ, "m",
                  "displacement of {base}")
        )  # fmt: skip
        out.append(
            Place("grasp position", i, None, tuple(f"grasp_position_{i}_{a}" for a in XYZ), XYZ, "m",
                  "displacement of {grasp}")
        )  # fmt: skip
    own = tuple(payload_variable(n, a) for n in ("payload_position", "payload_velocity") for a in XYZ)
    inner = tuple(
        payload_variable(n, a)
        for n in ("payload_felt", "payload_acceleration", "payload_rate", "payload_up")
        for a in XYZ
    )
    inner += (payload_felt(),)
    out += [
        _at_payload("force on payload", (*(f"payload_force_{a}" for a in XYZ), *(f"payload_moment_{a}" for a in XYZ)),
                 ("force x", "force y", "force z", "moment x", "moment y", "moment z"), "N",
                 "force and moment on the payload, in the world", own, units=("N",) * 3 + ("N m",) * 3),
        _at_payload("payload mass", ("payload_mass",), ("",), "kg", "mass of the payload", ()),
        _at_payload("payload centre", tuple(f"payload_first_moment_{a}" for a in XYZ), XYZ, "kg m",
                 "first moment of the payload's mass", inner),
        _at_payload("payload spin", tuple(f"payload_spin_{a}" for a in XYZ), XYZ, "kg m^2/s",
                 "angular momentum inside the payload", ()),
    ]  # fmt: skip
    return out


def _joint(
    name: str, robot: int, joint: int, target: str, unit: str, title: str, own: tuple[Variable, ...], *,
    offset: bool = False, twin: str | None = None,
) -> Place:  # fmt: skip
    return Place(
        name, robot, joint, (f"{target}_{robot}_{joint}",), ("",), unit, title, own, offset, twin=twin
    )


def _at_payload(
    name: str,
    targets: tuple[str, ...],
    axes: tuple[str, ...],
    unit: str,
    title: str,
    own: tuple[Variable, ...],
    units: tuple[str, ...] = (),
) -> Place:
    return Place(name, None, None, targets, axes, unit, title, own, units=units)


def directions_at(linear: TrialLinear, place: Place) -> Array:
    """Residual per unit of an error, its rate and its acceleration, shape (n, components, 3 or 1, C).

    Args:
        linear: the trial.
        place: one of ``places.places_of``.

    The direction at a row is that in its middle: an error changes faster than how it shows.
    """
    at = linear.reduction.sample
    robot, joint = (place.robot or 1) - 1, (place.joint or 1) - 1
    if place.name in ("phi reading", "theta reading"):
        slots = (PHI, PHI_DOT, PHI_DDOT) if place.name == "phi reading" else (THETA, THETA_DOT, THETA_DDOT)
        J = [linear.J.at(robot, kind, at)[..., joint] for kind in slots]
        return np.stack(J, axis=1)[:, None]
    if place.name in ("tau reading", "driven torque"):
        sign = 1.0 if place.name == "tau reading" else -1.0  # a torque beside the spring is not read
        return sign * linear.J.at(robot, TAU, at)[:, None, None, :, joint]
    if place.name == "gimbal torque":
        moment = moment_about_axes(linear.s[at][:, robot, THETA], np.eye(3)[joint])
        moment = moment @ linear.shared.grasps.R_1i[robot].T
        return _wrench(linear, np.zeros_like(moment), moment)[:, None, None]
    if place.name in ("base position", "grasp position"):
        turned = linear.bases.R[robot] if place.name == "base position" else None
        return np.stack([_moved(linear, robot, axis, turned) for axis in np.eye(3)], axis=1)
    return np.stack(list(_of_payload(linear, place.name)), axis=1)


def _wrench(linear: TrialLinear, force: Array, moment: Array) -> Array:
    """Residual of an outside wrench on the payload at the origin of {1}, in {1}, (n, 3) each: shape (n, C)."""
    out = np.zeros((len(force), linear.channels))
    out[:, -6:-3], out[:, -3:] = -force, -moment
    return out


def _moved(linear: TrialLinear, robot: int, axis: Array, base: Array | None) -> Array:
    """Residual of a displacement of a grasp frame as seen from {b1}, by value, rate and acceleration, (n, 3, C).

    Args:
        linear: the trial.
        robot: from 0.
        axis: along which, shape (3,): of the robot's {b}, or of its grasp frame {i}.
        base: axes of the robot's base in {b1}; None for an axis of {i}.
    """
    at = linear.reduction.sample
    displacement = (
        np.tile(base @ axis, (len(at), 1))
        if base is not None
        else linear.data.R_bi[at][:, 0] @ (linear.shared.grasps.R_1i[robot] @ axis)
    )
    out = np.zeros((len(at), 3, linear.channels))
    for i in range(1, linear.robots):
        sign = 1.0 if robot == 0 else -1.0 if robot == i else 0.0
        out[:, 0, 6 * (i - 1) + 3 : 6 * i] = sign * displacement
    wrist = -displacement @ linear.bases.R[robot]
    by_wrist = linear.by_wrist[robot][at]
    out[:, 1, -6:] = np.einsum("nij,nj->ni", by_wrist[..., :3], wrist)
    out[:, 2, -6:] = np.einsum("nij,nj->ni", by_wrist[..., 3:], wrist)
    return out


def _of_payload(linear: TrialLinear, name: str) -> list[Array]:
    """Residual of every component of an error of the payload, shape (n, 3 or 1, C) each."""
    at = linear.reduction.sample
    motion = linear.motion
    R = linear.data.R_bi[at][:, 0]
    com = linear.shared.pi[1:4] / linear.shared.pi[0]
    none = np.zeros((len(at), 3))
    omega, alpha = motion.omega[at], motion.alpha[at]
    # Acceleration of the origin of {1} less gravity, in {1}.
    felt = motion.acceleration[at] + linear.data.gravity_mps2 * motion.up[at]
    if name == "force on payload":
        forces = [R[:, k] for k in range(3)]  # unit vector k of {b1}, in {1}
        return [
            *(_wrench(linear, f, _crossed(com, f))[:, None] for f in forces),
            *(_wrench(linear, none, f)[:, None] for f in forces),
        ]
    if name == "payload mass":  # a point mass at the centre that is known of
        needed = felt + _crossed(alpha, com) + _crossed(omega, _crossed(omega, com))
        return [_wrench(linear, -needed, -_crossed(com, needed))[:, None]]
    axes = [np.tile(axis, (len(at), 1)) for axis in np.eye(3)]
    if name == "payload centre":
        # d/dt^2 of R c m, and gravity's moment: value, rate and acceleration of the first moment in {1}.
        return [
            np.stack(
                [
                    _wrench(linear, -(_crossed(alpha, e) + _crossed(omega, _crossed(omega, e))), -_crossed(e, felt)),
                    _wrench(linear, -2.0 * _crossed(omega, e), none),
                    _wrench(linear, -e, -_crossed(com, e)),
                ],
                axis=1,
            )
            for e in axes
        ]  # fmt: skip
    # Angular momentum fixed in the payload: its change is omega x h.
    return [_wrench(linear, none, -_crossed(omega, e))[:, None] for e in axes]


def _crossed(a: Array, b: Array) -> Array:
    return np.asarray(np.cross(a, b), dtype=np.float64)
