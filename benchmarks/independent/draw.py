"""What is hidden, drawn: place, size and form."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from estimator.arm.design import OmnidDesign
from independent.bodies import ROBOTS, Payload, limit_factor
from independent.effects import (
    AddedMass,
    DahlSpring,
    Drag,
    Effect,
    Friction,
    Hidden,
    Numbers,
    Pendulum,
    ProgressiveSpring,
    Push,
    RelaxingGrasp,
    SecondOrderLag,
    Tether,
    Wander,
)
from independent.numerics import Array
from independent.team import Bases

Rng = np.random.Generator

LIMITS = {
    "phi_zero": 6.6e-4, "theta_zero": 6.2e-4, "link_length": 1.4e-4, "base_tilt": 7e-4, "base_creep": 1.7e-7,
    "base_compliance": 7.1e-7, "grasp_flex": 7.1e-7, "grasp_play": 1.9e-5, "sea_bias": 0.020, "sea_scale": 6.6e-3,
    "sea_hardening": 24.0, "sea_hysteresis": 0.012, "joint_friction": 0.012, "gimbal_friction": 0.017,
    "torque_skew": 8.9e-4, "torque_lag": 8.9e-4, "sensor_lag": 9e-4, "clock_delay": 7.6e-5,
    "tether": 0.1, "push": 0.13, "drag": 0.33, "slosh": 4.5e-3, "payload_mass": 4.2e-3,
}  # fmt: skip
"""Smallest effects that show at background x1: rad, m, m/s, m/N, N m, 1, N m/rad^3, s, N, N s/m, kg (per minute)."""


@dataclass(frozen=True)
class Setting:
    """What effects are drawn for.

    Attributes:
        payload: the rigid body.
        bases: where the robots stand in the first trial.
        design: the robots' numbers.
        background: how far the robots are off.
        durations_s: of the trials [s].
    """

    payload: Payload
    bases: Bases
    design: OmnidDesign
    background: str
    durations_s: tuple[float, ...]

    def limit(self, cause: str, quantity: str | None = None) -> float:
        """Smallest effect that shows; larger where the robots are off more in ``quantity``."""
        return LIMITS[cause] * (1.0 if quantity is None else limit_factor(quantity, self.background))


@dataclass(frozen=True)
class Drawn:
    """An effect, its place (from 0), and its true parameters by the catalogue's names and by others."""

    effect: Effect
    robot: int | None = None
    joint: int | None = None
    known: dict[str, Any] = field(default_factory=dict)
    parameters: dict[str, Any] = field(default_factory=dict)


Draw = Callable[[Rng, float, Setting], Drawn]


def link_length(rng: Rng, size: float, setting: Setting) -> Drawn:
    """One of the three lengths of a leg."""
    quantity = ("proximal", "rod", "base_radius")[rng.integers(3)]
    value = size * setting.limit("link_length", quantity)
    return _number(rng, value, quantity, f"{quantity}_m", signed=True)


def sea_scale(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A spring of another stiffness; only stiffer where a softer one would hardly be a spring."""
    value = size * setting.limit("sea_scale", "sea_scale")
    return _number(rng, value, "sea_scale", "scale", signed=value < 0.3)


def joint_friction(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Dry friction in a driven joint, with up to as much viscous friction at 1 rad/s."""
    return _friction(rng, size * setting.limit("joint_friction", "joint_coulomb"), "joint")


def gimbal_friction(rng: Rng, size: float, setting: Setting) -> Drawn:
    """The same about a gimbal axis."""
    return _friction(rng, size * setting.limit("gimbal_friction", "gimbal_coulomb"), "gimbal")


def grasp_relaxing(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A grasp that gives way within tenths of a second."""
    value, relaxation = size * setting.limit("grasp_flex", "grasp_flex"), rng.uniform(0.1, 0.3)
    robot = int(rng.integers(ROBOTS))
    effect = RelaxingGrasp(robot, (value, value, value), relaxation)
    known = {"compliance_m_per_N": value, "relaxation_s": relaxation}
    return Drawn(effect, robot, None, known)


def grasp_anisotropic(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A grasp that is softer along one axis of {i} than along the others."""
    value, robot = size * setting.limit("grasp_flex", "grasp_flex"), int(rng.integers(ROBOTS))
    along = value * np.sort(rng.uniform(1.0, 1.5, 3))[rng.permutation(3)]
    return Drawn(RelaxingGrasp(robot, (*along.tolist(),)), robot, None, {}, {"along_m_per_N": along.tolist()})


def spring_progressive(rng: Rng, size: float, setting: Setting) -> Drawn:
    """k d (1 + a |d|); as far off at 0.07 rad as a cubic of that size."""
    stiffness = setting.design.sea_stiffness_Nm_per_rad
    slope = size * setting.limit("sea_hardening", "sea_hardening") * 0.07 / stiffness
    robot, joint = _place(rng)
    return Drawn(ProgressiveSpring(robot, joint, slope), robot, joint, {}, {"per_rad": slope})


def spring_dahl(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Hysteresis with rounded corners."""
    level, width = size * setting.limit("sea_hysteresis", "sea_hysteresis"), rng.uniform(0.02, 0.10)
    robot, joint = _place(rng)
    effect = DahlSpring(robot, joint, level, width)
    return Drawn(effect, robot, joint, {"friction_Nm": level}, {"width_Nm": width})


def bias_settling(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A torque zero that finds its place anew in each trial."""
    value = size * setting.limit("sea_bias", "sea_bias") * rng.choice((-1.0, 1.0))
    settling, (robot, joint) = rng.uniform(2.0, 8.0), _place(rng)
    return Drawn(
        Wander(robot, joint, value, settling),
        robot,
        joint,
        {},
        {"settles_at_Nm": value, "settling_s": settling},
    )


def driven_tanh(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Friction that fades at rest."""
    return _other_friction(rng, size, setting, "joint", "tanh", rng.uniform(0.005, 0.02), 0.0)


def driven_stribeck(rng: Rng, size: float, setting: Setting) -> Drawn:
    """LuGre's friction, higher at low speed."""
    return _other_friction(
        rng, size, setting, "joint", "stribeck", rng.uniform(2e-4, 1e-3), rng.uniform(0.2, 0.6)
    )


def gimbal_dahl(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Dahl's friction about a gimbal axis."""
    return _other_friction(rng, size, setting, "gimbal", "dahl", rng.uniform(5e-4, 5e-3), 0.0)


def torque_second_order(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Torque sensors behind a critically damped filter."""
    value, robot = size * setting.limit("torque_lag", "torque_lag"), int(rng.integers(ROBOTS))
    return Drawn(SecondOrderLag(robot, value), robot, None, {"time_constant_s": value})


def _place(rng: Rng, joints: int = 3) -> tuple[int, int]:
    return int(rng.integers(ROBOTS)), int(rng.integers(max(joints, 1)))


def _number(
    rng: Rng, value: float, quantity: str, parameter: str, *, signed: bool = False, joints: int = 3
) -> Drawn:
    """One number of ``AsBuilt``; ``joints`` is 0 for what a robot has but once."""
    robot, joint = _place(rng, joints)
    if signed:
        value *= float(rng.choice((-1.0, 1.0)))
    effect = Numbers({(quantity, robot, joint): value})
    return Drawn(effect, robot, joint if joints else None, {parameter: value})


def number(cause: str, parameter: str, *, signed: bool = False, joints: int = 3) -> Draw:
    """One number of ``AsBuilt`` that is called like its cause; other arguments as of ``_number``."""

    def draw(rng: Rng, size: float, setting: Setting) -> Drawn:
        quantity = None if cause == "sensor_lag" else cause  # a single sensor lags nowhere else
        return _number(
            rng, size * setting.limit(cause, quantity), cause, parameter, signed=signed, joints=joints
        )

    return draw


def heading(cause: str, parameters: tuple[str, str]) -> Draw:
    """Two numbers of a base that are a direction."""
    return lambda rng, size, setting: _heading(rng, size * setting.limit(cause, cause), cause, parameters)


def _heading(rng: Rng, value: float, quantity: str, parameters: tuple[str, str]) -> Drawn:
    robot, heading = int(rng.integers(ROBOTS)), rng.uniform(0, 2 * np.pi)
    x, y = float(value * np.cos(heading)), float(value * np.sin(heading))
    effect = Numbers({(quantity, robot, 0): x, (quantity, robot, 1): y})
    return Drawn(effect, robot, None, dict(zip(parameters, (x, y), strict=True)))


def _friction(rng: Rng, level: float, where: str) -> Drawn:
    (robot, joint), viscous = _place(rng), float(level * rng.uniform(0, 1))
    effect = Numbers({(f"{where}_coulomb", robot, joint): level, (f"{where}_viscous", robot, joint): viscous})
    return Drawn(effect, robot, joint, {"coulomb_Nm": level, "viscous_Nms_per_rad": viscous})


def _other_friction(
    rng: Rng, size: float, setting: Setting, where: str, law: str, scale: float, extra: float
) -> Drawn:
    level = size * setting.limit(f"{where}_friction", f"{where}_coulomb")
    robot, joint = _place(rng)
    effect = Friction(robot, joint, level, law, scale, extra, gimbal=where == "gimbal")
    return Drawn(effect, robot, joint, {"coulomb_Nm": level}, {"law": law, "scale": scale, "extra": extra})


_SPEED_MPS, _ARM2 = 0.08, 0.25
"""Usual speed of the payload, and the square of how far from its centre something that drags is [m^2]."""


def drag(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Against the velocity of the centre of mass."""
    value = size * setting.limit("drag")
    return Drawn(Drag(value), known={"coefficient_Ns_per_m": value})


def drag_turning(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Against its rotation too."""
    value = size * setting.limit("drag")
    turning = value * _ARM2 * rng.uniform(0.5, 1.5)
    return Drawn(Drag(value, turning), known={"coefficient_Ns_per_m": value, "turning_Nms_per_rad": turning})


def drag_quadratic(rng: Rng, size: float, setting: Setting) -> Drawn:
    """With the square of the speed, as large at a usual speed."""
    value = size * setting.limit("drag") / _SPEED_MPS
    return Drawn(Drag(0.0, 0.0, value), known={"quadratic_Ns2_per_m2": value})


def slosh(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A pendulum."""
    point, mass = _point(rng, setting), size * setting.limit("slosh")
    length, ratio = rng.uniform(0.1, 0.4), rng.uniform(0.005, 0.05)
    known = {"mass_kg": mass, "length_m": length, "damping_ratio": ratio} | _named(point, "point_{}_m")
    return Drawn(Pendulum(_triple(point), mass, length, ratio), known=known)


def payload_mass(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Mass that is there in some trials only, or that leaks from the start of every trial."""
    point, value = _point(rng, setting), size * setting.limit("payload_mass")
    named = _named(point, "point_{}_m")
    if rng.random() < 0.5:
        rate = -value / 60
        effect = AddedMass(_triple(point), rate_kgps=rate)
        return Drawn(effect, known={"rate_kgps": rate} | named)
    first, last = ((2, 4), (3, 4), (4, 4), (2, 3))[rng.integers(4)]
    known = {"mass_kg": value, "trial": first, "last_trial": last} | named
    return Drawn(AddedMass(_triple(point), value, first=first, last=last), known=known)


def mass_settling(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Mass that leaks fast at first and then ever more slowly."""
    point, settling = _point(rng, setting), rng.uniform(8.0, 20.0)
    rate = -size * setting.limit("payload_mass") / settling
    effect = AddedMass(_triple(point), rate_kgps=rate, settling_s=settling)
    told = {"first_rate_kgps": rate, "settling_s": settling} | _named(point, "point_{}_m")
    return Drawn(effect, known={}, parameters=told)


def tether(
    rng: Rng, size: float, setting: Setting, *, of_payload: bool = False, slack: bool = False
) -> Drawn:
    """A spring from a grasp, or any point of the payload, to a point fixed to a base.

    At home it pulls with the limit's force times ``size``, in any direction. A cable hangs slack near its anchor.
    """
    base = 0 if of_payload else int(rng.integers(ROBOTS))
    stiffness = rng.uniform(0.5, 5.0)
    stretch, length = setting.limit("tether") / stiffness, rng.uniform(0.15, 0.5) if slack else 0.0
    point = _point(rng, setting) if of_payload else setting.payload.p_1i[base]
    home = setting.bases.p_W1 + setting.bases.R_W1 @ point
    way = rng.normal(0.0, 1.0, 3)
    way *= (stretch + length) / np.linalg.norm(way)
    anchor = setting.bases.R_Wb[base].T @ (home - setting.bases.p_Wb[base]) + way
    effect = Tether(base, None, _triple(anchor), stiffness * size, length)
    known: dict[str, Any] = {"stiffness_N_per_m": stiffness * size} | _named(anchor, "anchor_{}_m")
    if slack:
        known["length_m"] = length
    if not of_payload:
        return Drawn(effect, base, None, known)
    known |= _named(point, "point_{}_m")
    return Drawn(replace(effect, point=_triple(point)), known=known)


def push(rng: Rng, size: float, setting: Setting, shape: str = "square") -> Drawn:
    """The longer, the weaker: what shows is the force times the square root of the time."""
    trial, duration = int(rng.integers(1, 1 + len(setting.durations_s))), rng.uniform(1.0, 10.0)
    start = rng.uniform(3.0, setting.durations_s[trial - 1] - duration - 3.0)
    force = rng.normal(0.0, 1.0, 3)
    force *= size * setting.limit("push") / np.sqrt(duration) / np.linalg.norm(force)
    point = _point(rng, setting)
    effect = Push(trial, start, duration, _triple(force), _triple(point), shape)
    known: dict[str, Any] = {"trial": trial, "start_s": start, "duration_s": duration}
    known |= _named(force, "force_{}_N") | _named(point, "point_{}_m")
    if shape == "trapezoid":
        known["ramp_s"] = duration / 4
    return Drawn(effect, known=known, parameters={"shape": shape})


def _point(rng: Rng, setting: Setting) -> Array:
    """A point of {1} somewhere between the grasps."""
    return rng.dirichlet(np.ones(ROBOTS)) @ setting.payload.p_1i + rng.uniform(-0.05, 0.10, 3)


def _named(values: Array, name: str) -> dict[str, float]:
    return {name.format(axis): float(value) for axis, value in zip("xyz", values, strict=True)}


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


@dataclass(frozen=True)
class Form:
    """Something that can be hidden.

    Attributes:
        cause: of the catalogue, that answers.
        other: whether its law is another than the catalogue's.
        draw: one of a size, in multiples of the smallest that shows, with its place.
    """

    cause: str
    other: bool
    draw: Draw


PLAIN: Mapping[str, Form] = {
    cause: Form(cause, False, draw)
    for cause, draw in {
        "phi_zero": number("phi_zero", "zero_rad", signed=True),
        "theta_zero": number(
            "theta_zero", "zero_rad", signed=True, joints=2
        ),  # the last turns the grasp alone
        "link_length": link_length,
        "base_tilt": heading("base_tilt", ("roll_rad", "pitch_rad")),
        "base_creep": heading("base_creep", ("x_mps", "y_mps")),
        "base_compliance": number("base_compliance", "compliance_m_per_N", joints=0),
        "grasp_flex": number("grasp_flex", "compliance_m_per_N", joints=0),
        "grasp_play": number("grasp_play", "play_m", joints=0),
        "sea_scale": sea_scale,
        "sea_bias": number("sea_bias", "bias_Nm", signed=True),
        "sea_hardening": number("sea_hardening", "cubic_Nm_per_rad3"),
        "sea_hysteresis": number("sea_hysteresis", "friction_Nm"),
        "joint_friction": joint_friction,
        "gimbal_friction": gimbal_friction,
        "torque_skew": number("torque_skew", "delay_s", joints=0),
        "torque_lag": number("torque_lag", "time_constant_s", joints=0),
        "sensor_lag": number("sensor_lag", "time_constant_s"),
        "clock_delay": number("clock_delay", "delay_s", joints=0),
        "tether": tether,
        "payload_tether": partial(tether, of_payload=True),
        "push": push,
        "drag": drag,
        "slosh": slosh,
        "payload_mass": payload_mass,
    }.items()
}
"""The catalogue's own laws, by cause."""

FORMS: Mapping[str, Form] = {
    "grasp_relaxing": Form("grasp_flex", True, grasp_relaxing),
    "grasp_anisotropic": Form("grasp_flex", True, grasp_anisotropic),
    "spring_progressive": Form("sea_hardening", True, spring_progressive),
    "spring_dahl": Form("sea_hysteresis", True, spring_dahl),
    "bias_settling": Form("sea_bias", True, bias_settling),
    "driven_tanh": Form("joint_friction", True, driven_tanh),
    "driven_stribeck": Form("joint_friction", True, driven_stribeck),
    "gimbal_dahl": Form("gimbal_friction", True, gimbal_dahl),
    "torque_second_order": Form("torque_lag", True, torque_second_order),
    "tether_slack": Form("tether", True, partial(tether, slack=True)),
    "payload_tether_slack": Form("payload_tether", True, partial(tether, of_payload=True, slack=True)),
    "push_half_sine": Form("push", True, partial(push, shape="half_sine")),
    "push_trapezoid": Form("push", True, partial(push, shape="trapezoid")),
    "drag_turning": Form("drag", True, drag_turning),
    "drag_quadratic": Form("drag", True, drag_quadratic),
    "mass_settling": Form("payload_mass", True, mass_settling),
}
"""Other laws than the catalogue's, by names of their own."""

NAMES: Mapping[str, Form] = {**PLAIN, **FORMS}
"""Everything that can be hidden."""

ANSWERS: Mapping[str, str] = {name: form.cause for name, form in NAMES.items()}
"""Cause of the catalogue that answers, by name."""


def draw_hidden(rng: np.random.Generator, name: str, size: float, setting: Setting) -> Hidden:
    """One of ``NAMES`` of a size, at a place drawn at random.

    Raises:
        ValueError: there is no such name.
    """
    if name not in NAMES:
        raise ValueError(f"{name!r} cannot be hidden; what can: {', '.join(NAMES)}")
    form = NAMES[name]
    drawn = form.draw(rng, size, setting)
    robot, joint = drawn.robot, drawn.joint
    return Hidden(
        name, form.cause, form.other, drawn.effect, None if robot is None else robot + 1,
        None if joint is None else joint + 1, drawn.known, drawn.parameters,
    )  # fmt: skip
