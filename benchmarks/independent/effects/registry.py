"""Everything that can be hidden: its name, the catalogue's cause that answers, and how one of a size is drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from independent.effects import draw_payload, draw_robot
from independent.effects.draw_robot import Drawn, Setting
from independent.effects.effect import Hidden

__all__ = ["ANSWERS", "FORMS", "NAMES", "PLAIN", "Form", "Setting", "draw_hidden"]

Draw = Callable[[np.random.Generator, float, Setting], Drawn]


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
        "phi_zero": draw_robot.phi_zero,
        "theta_zero": draw_robot.theta_zero,
        "link_length": draw_robot.link_length,
        "base_tilt": draw_robot.base_tilt,
        "base_creep": draw_robot.base_creep,
        "base_compliance": draw_robot.base_compliance,
        "grasp_flex": draw_robot.grasp_flex,
        "grasp_play": draw_robot.grasp_play,
        "sea_scale": draw_robot.sea_scale,
        "sea_bias": draw_robot.sea_bias,
        "sea_hardening": draw_robot.sea_hardening,
        "sea_hysteresis": draw_robot.sea_hysteresis,
        "joint_friction": draw_robot.joint_friction,
        "gimbal_friction": draw_robot.gimbal_friction,
        "torque_skew": draw_robot.torque_skew,
        "torque_lag": draw_robot.torque_lag,
        "sensor_lag": draw_robot.sensor_lag,
        "clock_delay": draw_robot.clock_delay,
        "tether": draw_payload.tether,
        "payload_tether": draw_payload.payload_tether,
        "push": draw_payload.push,
        "drag": draw_payload.drag,
        "slosh": draw_payload.slosh,
        "payload_mass": draw_payload.payload_mass,
    }.items()
}
"""The catalogue's own laws, by cause."""

FORMS: Mapping[str, Form] = {
    "grasp_relaxing": Form("grasp_flex", True, draw_robot.grasp_relaxing),
    "grasp_anisotropic": Form("grasp_flex", True, draw_robot.grasp_anisotropic),
    "spring_progressive": Form("sea_hardening", True, draw_robot.spring_progressive),
    "spring_dahl": Form("sea_hysteresis", True, draw_robot.spring_dahl),
    "bias_settling": Form("sea_bias", True, draw_robot.bias_settling),
    "driven_tanh": Form("joint_friction", True, draw_robot.driven_tanh),
    "driven_stribeck": Form("joint_friction", True, draw_robot.driven_stribeck),
    "gimbal_dahl": Form("gimbal_friction", True, draw_robot.gimbal_dahl),
    "torque_second_order": Form("torque_lag", True, draw_robot.torque_second_order),
    "tether_slack": Form("tether", True, draw_payload.tether_slack),
    "payload_tether_slack": Form("payload_tether", True, draw_payload.payload_tether_slack),
    "push_half_sine": Form("push", True, draw_payload.push_half_sine),
    "push_trapezoid": Form("push", True, draw_payload.push_trapezoid),
    "drag_turning": Form("drag", True, draw_payload.drag_turning),
    "drag_quadratic": Form("drag", True, draw_payload.drag_quadratic),
    "mass_settling": Form("payload_mass", True, draw_payload.mass_settling),
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
