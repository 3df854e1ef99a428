"""Three slides, and where they go: between a flange and its grasp, or under a base."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
# Taken from the flange, so that the gimbal's mass and inertia stay what they are.
PAD_MASS_KG = 0.03
PAD_INERTIA_KGM2 = 2e-5
# Inertia of the slides' own, tiny, motion. A weld on a lighter pad would be softer (MuJoCo's constraints are as stiff
# as the bodies are heavy) and add to the compliance; and two slides along one axis would make the mass matrix singular.
SPRUNG_ARMATURE_KG = 1.0
LOOSE_ARMATURE_KG = 0.1


def add_slides(body: Any, kind: str, axes: str, **attributes: Any) -> list[Any]:
    """Add slide joints ``{kind}_{axis}`` along a body's own axes."""
    return [
        body.add("joint", name=f"{kind}_{axis}", type="slide", axis=AXES[axis], group=3, **attributes)
        for axis in axes
    ]


def add_springs(
    scene: TeamScene, joints: list[Any], label: str, compliance_m_per_N: float, relaxation_s: float
) -> TeamScene:
    """Hold slides at zero by springs, as soft equality rows named ``{label}_{joint}``; arguments as of ``SoftRow``."""
    for joint in joints:
        name = f"{label}_{joint.name}"
        scene.root.equality.add("joint", name=name, joint1=joint)
        scene = scene.sprung(name, compliance_m_per_N, relaxation_s)
    return scene


def grasp_body(scene: TeamScene, robot: int) -> Any:
    """The body whose slides lie between one robot's flange and the payload.

    Robot 1's flange has the payload as its child: the payload itself. The others' welds are moved from the flange to a
    light pad on it.
    """
    if robot == 1:
        return scene.root.find("body", "omnid1/payload/payload")
    name = f"omnid{robot}"
    pad = scene.root.find("body", f"{name}/pad")
    if pad is not None:
        return pad
    flange = scene.root.find("body", f"{name}/flange")
    flange.inertial.mass = flange.inertial.mass - PAD_MASS_KG
    flange.inertial.diaginertia = flange.inertial.diaginertia - PAD_INERTIA_KGM2
    pad = flange.add("body", name="pad")
    pad.add("inertial", pos=[0.0, 0.0, 0.0], mass=PAD_MASS_KG, diaginertia=[PAD_INERTIA_KGM2] * 3)
    site = pad.add("site", name="pad", group=4, size=[0.006])
    scene.root.find("equality", f"grasp{robot}").site1 = site
    return pad


def widened(scene: TeamScene, robot: int, slack_m: float) -> TeamScene:
    """A scene whose trials allow one grasp to open further."""
    slack = np.array(scene.grasp_slack_m or (0.0,) * scene.robots)
    slack[robot - 1] += slack_m
    return replace(scene, grasp_slack_m=tuple(slack.tolist()))


def base_slides(scene: TeamScene, robot: int, kind: str, **attributes: Any) -> list[Any]:
    """Horizontal slides under one robot's chassis, along x and y of its {b} without any tilt."""
    chassis = scene.root.find("body", f"omnid{robot}/chassis")
    slides = add_slides(chassis, kind, "xy", **attributes)
    level_slides(chassis)
    return slides


def robot_mass_kg(scene: TeamScene, robot: int) -> float:
    """Mass of one robot, without payload."""
    chassis = scene.root.find("body", f"omnid{robot}/chassis")
    bodies = [chassis, *chassis.find_all("body")]
    own = (body.inertial for body in bodies if "payload" not in body.full_identifier)
    return float(sum(inertial.mass for inertial in own if inertial is not None))


def level_slides(chassis: Any) -> None:
    """Turn the slides under a chassis so that they stay horizontal when it is tilted."""
    if chassis.quat is not None:
        from scipy.spatial.transform import Rotation

        level = Rotation.from_quat(chassis.quat, scalar_first=True).inv()
        for slide in chassis.joint:
            slide.axis = level.apply(AXES[slide.name[-1]])
