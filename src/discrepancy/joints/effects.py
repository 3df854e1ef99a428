"""Findings as effects of the simulator, and the model with them in it, to take away."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.evidence.findings import Finding
from discrepancy.evidence.member import Member
from discrepancy.joints.causes import WORDS
from discrepancy.joints.findings import JointVerdict
from discrepancy.joints.model import SerialModel, load_spec
from discrepancy.joints.said import titled
from discrepancy.joints.values import axes_of_tilt
from mocobot_sim.model_check import check_named
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import write_extended as write

LINKS = ("link_mass", "link_com", "link_inertia", "payload")
LATE = ("gravity_compensation",)
"""What acts on all masses, and so goes into a model after them."""


def effects_of(finding: Finding, model: SerialModel) -> list[RobotEffect]:
    """A finding as the simulator's effects, one a member; one without numbers of what no table lists.

    Args:
        finding: with values in physical units.
        model: that it is about.
    """
    members = () if finding.law else finding.members
    members = members or (Member(finding.place, finding.joint, {}, {}),)
    effects = [_effect(finding, member, model) for member in members]
    return [part for effect in effects for part in _parts(effect)]


def all_effects(findings: Iterable[Finding], model: SerialModel) -> list[tuple[Finding, RobotEffect]]:
    """Effects in the order in which they go into a model, each with its finding."""
    pairs = [(finding, effect) for finding in findings for effect in effects_of(finding, model)]
    return sorted(pairs, key=lambda pair: pair[1].cause in LATE)


def write_extended(verdict: JointVerdict, folder: Path) -> None:
    """Write the model with the findings in it into a new folder.

    Raises:
        InputError: the folder cannot be written, MuJoCo refuses the model, or files in it are not its own.
    """
    effects = [effect for _, effect in all_effects(verdict.findings, verdict.model)]
    spec = load_spec(verdict.model.path)
    check_named(verdict.model.path, assets=False)
    write(spec, effects, folder, verdict.trials, reference=bool(verdict.reference))


def label(finding: Finding) -> str:
    """The cause and its place in words."""
    return titled(WORDS[finding.cause].title, finding.place)


def _parts(effect: RobotEffect) -> Iterator[RobotEffect]:
    """An effect; a link's mass that comes with its centre and its inertia as the three."""
    numbers = effect.parameters
    if effect.cause != "link_mass" or "x_m" not in numbers:
        yield effect
        return
    yield replace(effect, parameters={"excess_kg": numbers["excess_kg"]})
    yield replace(effect, cause="link_com", parameters={f"{x}_m": numbers[f"{x}_m"] for x in "xyz"})
    yield replace(effect, cause="link_inertia", parameters={"share": numbers["inertia_share"]})


def _effect(finding: Finding, member: Member, model: SerialModel) -> RobotEffect:
    # Shares of what is typical are told beside what they amount to.
    numbers = {name: x for name, x in finding.shape.items() if name != "share"} | dict(member.values)
    if finding.event is not None:
        numbers |= {"start_s": finding.event.start_s, "duration_s": finding.event.duration_s}
    if finding.cause == "torque_scale":
        numbers = {"bend": 0.0} | numbers
    if finding.cause == "gravity_direction":
        gravity = np.array(model.model.opt.gravity)
        way = np.array([numbers["tilt_1_rad"], numbers["tilt_2_rad"]]) @ axes_of_tilt(gravity)
        turned = Rotation.from_rotvec(-way).apply(gravity)
        numbers |= dict(zip(("x_m_per_s2", "y_m_per_s2", "z_m_per_s2"), map(float, turned), strict=True))
    joint, body = member.joint, ""
    if finding.cause in LINKS:  # a link may have the name of a joint that moves another one
        moved = member.place in model.bodies
        joint, body = (model.bodies.index(member.place) + 1, "") if moved else (None, member.place)
    return RobotEffect(finding.cause, joint, finding.partner, numbers, body)
