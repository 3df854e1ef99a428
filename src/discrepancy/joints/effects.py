"""Convert findings to physical values and to effects of the simulator."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.evidence.findings import Finding, Member
from discrepancy.evidence.posterior import Group
from discrepancy.joints.causes import CAUSES, OTHERS, WORDS, parameter_name, titled
from discrepancy.joints.link_prior import central
from discrepancy.joints.mechanics import Tree, horizontal
from discrepancy.joints.model import SerialModel
from discrepancy.joints.mount import angle_between, gravity_at, ways
from discrepancy.joints.problem import JointProblem
from estimator.arrays import Array
from mocobot_sim.serial.effects import RobotEffect

NAMES: Mapping[str, tuple[str, ...]] = {cause.name: tuple(cause.parameters) for cause in (*CAUSES, *OTHERS)}
ROBOTS = (
    "payload",
    "link_length",
    "link_com",
    "link_mass",
    "link_inertia",
    "gravity_direction",
    "push",
    "soft_stand",
)
GRAVITY = ("x_m_per_s2", "y_m_per_s2", "z_m_per_s2")
"""Parameters of a base that is mounted another way than in the model: gravity in the base's frame."""
LEAST_KG = 1e-3
"""Least payload mass with a defined centre of mass [kg]."""


def physical(
    problem: JointProblem, group: Group, x: Array, covariance: Array
) -> tuple[dict[str, float], dict[str, float]]:
    """Values and standard errors of a group's parameters in physical units, by name.

    Args:
        problem: the problem of the group.
        group: a cause at a place, or at the place of one member.
        x, covariance: values of its columns and their covariance, shapes (k,) and (k, k).
    """
    names = NAMES[group.cause] if group.cause != "gravity_direction" or problem.mount is None else GRAVITY
    if group.cause == "link_mass" and len(x) > 1:
        names = (*names, *NAMES["link_com"], "inertia_share")
    change = _change(problem, group)
    if change is not None:
        value = change(x)
        size = np.sqrt(np.diag(covariance))
        J = np.column_stack([
            (change(x + e) - change(x - e)) / (2.0 * step)
            for e, step in ((1e-4 * s * np.eye(len(x))[k], 1e-4 * s) for k, s in enumerate(size + 1e-12))
        ])  # fmt: skip
        x, covariance = value, J @ covariance @ J.T
    joints = problem.model.joints
    slide = (
        group.cause not in ROBOTS
        and group.place in joints
        and problem.model.slides[joints.index(group.place)]
    )
    names = tuple(parameter_name(n, slide=bool(slide)) for n in names)
    se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return dict(zip(names, map(float, x), strict=True)), dict(zip(names, map(float, se), strict=True))


def _change(problem: JointProblem, group: Group) -> Callable[[Array], Array] | None:
    tree = Tree.of(problem.model.model)
    if group.cause == "link_mass":
        mass = float(tree.mass[problem.model.model.body(group.place).id])
        return lambda x: np.append(x[0] * mass, x[1:])
    if group.cause == "payload":
        return load_of
    if group.cause == "soft_stand":
        numbers = np.array([x for _, x in group.shape])[: len(NAMES[group.cause])]
        return lambda x: numbers * np.exp(x[1 : 1 + len(numbers)] / max(x[0], 0.1)) / max(x[0], 0.1)
    if group.cause == "gravity_direction":
        along = axes_of_tilt(tree.gravity) @ horizontal(tree.gravity).T
        if problem.mount is None:
            return lambda x: along @ x
        g, mount = tree.gravity, problem.mount
        return lambda x: gravity_at(g, mount, dict(zip(ways(g, mount), x, strict=True)))
    return None


def axes_of_tilt(gravity: Array) -> Array:
    """Two horizontal unit vectors: the one nearest to x (to y if x is vertical), and up times it, shape (2, 3)."""
    up = -gravity / np.linalg.norm(gravity)
    axis = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    first = axis - up * (axis @ up)
    first /= np.linalg.norm(first)
    return np.asarray(np.stack([first, np.cross(up, first)]), dtype=float)


def load_of(moments: Array) -> Array:
    """Mass, centre of mass and central inertia (xx, yy, zz, xy, xz, yz) from ten parameters about the link frame."""
    m = moments[0] if abs(moments[0]) > LEAST_KG else LEAST_KG
    return np.append(moments[0], central(np.append(m, moments[1:]))[1:])


def absolute(problem: JointProblem, group: Group) -> dict[str, Any]:
    """Shape parameters of a cause, with the physical values that a simulation needs."""
    shape: dict[str, Any] = {} if group.cause == "soft_stand" else dict(group.shape)
    if group.cause == "gravity_direction" and problem.mount is not None:
        shape["turned_deg"] = np.degrees(angle_between(problem.model.model.opt.gravity, problem.mount))
    if group.place not in problem.model.joints:
        return shape
    j = problem.model.joints.index(group.place)
    span, slide = problem.joints[j][0].span, bool(problem.model.slides[j])
    speed, length = ("m_per_s", "m") if slide else ("rad_per_s", "rad")
    if group.cause == "stribeck":
        shape[f"fade_{speed}"] = shape["share"] * span.speed
    elif group.cause == "sublinear_friction":
        shape[f"thins_{speed}"] = shape["share"] * span.speed
    elif group.cause == "warming":
        shape["over_s"] = shape["share"] * span.until_s
    elif group.cause == "spring":
        shape[f"middle_{length}"] = span.middle
    elif group.cause == "torque_scale":
        asked = np.concatenate([s.asked for s in problem.joints[j]])
        shape["typical_load_N" if slide else "typical_load_Nm"] = float(np.sqrt(np.mean(asked**2)))
    return shape


LINKS = ("link_mass", "link_com", "link_inertia", "payload")
LATE = ("gravity_compensation",)
"""Causes that act on all masses, to be applied after those that change masses."""


def effects_of(finding: Finding, model: SerialModel) -> list[RobotEffect]:
    """Convert a finding to effects of the simulator, one for each member; an unlisted law gets no parameters.

    Args:
        finding: with values in physical units.
        model: the diagnosed model.
    """
    members = () if finding.law else finding.members
    members = members or (Member(finding.place, finding.joint, {}, {}),)
    effects = [_effect(finding, member, model) for member in members]
    return [part for effect in effects for part in _parts(effect)]


def all_effects(findings: Iterable[Finding], model: SerialModel) -> list[tuple[Finding, RobotEffect]]:
    """Effects of all findings with their findings, in the order in which they are applied to a model."""
    pairs = [(finding, effect) for finding in findings for effect in effects_of(finding, model)]
    return sorted(pairs, key=lambda pair: pair[1].cause in LATE)


def numbered(effects: Iterable[RobotEffect], model: SerialModel) -> list[RobotEffect]:
    """Number the joints of effects among all joints of the MJCF, where some may follow others."""
    of = {k: int(j) + 1 for k, j in enumerate(model.coupling.own, start=1)}
    return [replace(e, joint=of.get(e.joint or 0), partner=of.get(e.partner or 0)) for e in effects]


def label(finding: Finding) -> str:
    """A cause with its place in words."""
    return titled(WORDS[finding.cause].title, finding.place)


def _parts(effect: RobotEffect) -> Iterator[RobotEffect]:
    """Split a link mass with centre and inertia into its three effects; others stay as they are."""
    numbers = effect.parameters
    if effect.cause != "link_mass" or "x_m" not in numbers:
        yield effect
        return
    yield replace(effect, parameters={"excess_kg": numbers["excess_kg"]})
    yield replace(effect, cause="link_com", parameters={f"{x}_m": numbers[f"{x}_m"] for x in "xyz"})
    yield replace(effect, cause="link_inertia", parameters={"share": numbers["inertia_share"]})


def _effect(finding: Finding, member: Member, model: SerialModel) -> RobotEffect:
    # ``share`` is relative; its physical value is a parameter of its own.
    numbers = {name: x for name, x in finding.shape.items() if name != "share"} | dict(member.values)
    if finding.event is not None:
        numbers |= {"start_s": finding.event.start_s, "duration_s": finding.event.duration_s}
    if finding.cause == "torque_scale":
        numbers = {"bend": 0.0} | numbers
    if "tilt_1_rad" in numbers:
        gravity = np.array(model.model.opt.gravity)
        way = np.array([numbers["tilt_1_rad"], numbers["tilt_2_rad"]]) @ axes_of_tilt(gravity)
        turned = Rotation.from_rotvec(-way).apply(gravity)
        numbers |= dict(zip(GRAVITY, map(float, turned), strict=True))
    joint, body = member.joint, ""
    if finding.cause in LINKS:  # a link may have the name of another link's joint
        moved = member.place in model.bodies
        joint, body = (model.bodies.index(member.place) + 1, "") if moved else (None, member.place)
    return RobotEffect(finding.cause, joint, finding.partner, numbers, body)
