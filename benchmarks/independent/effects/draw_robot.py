"""Effects in robots and their joints: places and parameters of a given size."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from estimator.arm.design import OmnidDesign
from independent.as_built import ROBOTS, limit_factor
from independent.effects.effect import Effect, Numbers
from independent.effects.joints import (
    DahlSpring,
    Friction,
    ProgressiveSpring,
    RelaxingGrasp,
    SecondOrderLag,
    Wander,
)
from independent.payload import Payload
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


def phi_zero(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A driven encoder's zero."""
    return _number(rng, size * setting.limit("phi_zero", "phi_zero"), "phi_zero", "zero_rad", signed=True)


def theta_zero(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A gimbal encoder's zero; that of the last axis cannot be told from the grasp."""
    value = size * setting.limit("theta_zero", "theta_zero")
    return _number(rng, value, "theta_zero", "zero_rad", signed=True, joints=2)


def link_length(rng: Rng, size: float, setting: Setting) -> Drawn:
    """One of the three lengths of a leg."""
    quantity = ("proximal", "rod", "base_radius")[rng.integers(3)]
    value = size * setting.limit("link_length", quantity)
    return _number(rng, value, quantity, f"{quantity}_m", signed=True)


def base_tilt(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A base that leans in any direction."""
    names = ("roll_rad", "pitch_rad")
    return _heading(rng, size * setting.limit("base_tilt", "base_tilt"), "base_tilt", names)


def base_creep(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A base that slides slowly in any direction, in every trial from its start."""
    names = ("x_mps", "y_mps")
    return _heading(rng, size * setting.limit("base_creep", "base_creep"), "base_creep", names)


def base_compliance(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A base that gives way to the arm's horizontal reaction."""
    value = size * setting.limit("base_compliance", "base_compliance")
    return _number(rng, value, "base_compliance", "compliance_m_per_N", joints=0)


def grasp_flex(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A grasp that gives way to its force."""
    value = size * setting.limit("grasp_flex", "grasp_flex")
    return _number(rng, value, "grasp_flex", "compliance_m_per_N", joints=0)


def grasp_play(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A loose grasp."""
    return _number(rng, size * setting.limit("grasp_play", "grasp_play"), "grasp_play", "play_m", joints=0)


def sea_scale(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A spring of another stiffness; only stiffer where a softer one would hardly be a spring."""
    value = size * setting.limit("sea_scale", "sea_scale")
    return _number(rng, value, "sea_scale", "scale", signed=value < 0.3)


def sea_bias(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A torque zero."""
    return _number(rng, size * setting.limit("sea_bias", "sea_bias"), "sea_bias", "bias_Nm", signed=True)


def sea_hardening(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A spring with a cubic part."""
    value = size * setting.limit("sea_hardening", "sea_hardening")
    return _number(rng, value, "sea_hardening", "cubic_Nm_per_rad3")


def sea_hysteresis(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A dry slider beside a spring."""
    value = size * setting.limit("sea_hysteresis", "sea_hysteresis")
    return _number(rng, value, "sea_hysteresis", "friction_Nm")


def joint_friction(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Dry friction in a driven joint, with up to as much viscous friction at 1 rad/s."""
    return _friction(rng, size * setting.limit("joint_friction", "joint_coulomb"), "joint")


def gimbal_friction(rng: Rng, size: float, setting: Setting) -> Drawn:
    """The same about a gimbal axis."""
    return _friction(rng, size * setting.limit("gimbal_friction", "gimbal_coulomb"), "gimbal")


def torque_skew(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Torques that are older than the angles."""
    value = size * setting.limit("torque_skew", "torque_skew")
    return _number(rng, value, "torque_skew", "delay_s", joints=0)


def torque_lag(rng: Rng, size: float, setting: Setting) -> Drawn:
    """Torque sensors behind a first-order lag."""
    value = size * setting.limit("torque_lag", "torque_lag")
    return _number(rng, value, "torque_lag", "time_constant_s", joints=0)


def sensor_lag(rng: Rng, size: float, setting: Setting) -> Drawn:
    """One such sensor."""
    return _number(rng, size * setting.limit("sensor_lag"), "sensor_lag", "time_constant_s")


def clock_delay(rng: Rng, size: float, setting: Setting) -> Drawn:
    """A robot whose log is late."""
    value = size * setting.limit("clock_delay", "clock_delay")
    return _number(rng, value, "clock_delay", "delay_s", joints=0)


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
