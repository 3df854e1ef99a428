"""Effects on geometry: links, bases and grasps that deviate from the design, move or yield.

Compliance is implemented as slides or hinges held by soft ``joint`` equalities (see ``mocobot_sim.scene.soft``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from estimator.arrays import Array
from mocobot_sim.effects.base import Effect, precise
from mocobot_sim.scene.as_built import AsBuilt, deviate_geometry
from mocobot_sim.scene.models import base_height_m
from mocobot_sim.scene.soft import STIFF, spring_parameters
from mocobot_sim.trial.actors import Stage

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from mocobot_sim.scene.scene import TeamScene

AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
# Mass and inertia of the pad of a grasp. They are subtracted from the flange, so that the gimbal's totals stay.
PAD_MASS_KG = 0.03
PAD_INERTIA_KGM2 = 2e-5
# Armatures of the slides and hinges. The stiffness of MuJoCo's constraints scales with inertia, so the weld of a
# lighter pad would add compliance. Without armature, two slides along one axis make the mass matrix singular.
SPRUNG_ARMATURE_KG = 1.0
LOOSE_ARMATURE_KG = 0.1
HINGE_ARMATURE_KGM2 = 0.01
# Armature and damping of slides with a prescribed motion. Chosen: forces of the arm change their velocity by less than
# 1e-9 m/s, and they reach their velocity within 10 ms.
ARMATURE_KG = 1e9
DAMPING_NS_PER_M = 1e11
# Solver tolerance with such slides: the stopping rule scales with the mean inertia, which they raise by a factor 1e8.
TOLERANCE = 1e-20
LARGEST_FORCE_N = 400.0
"""Upper bound on the force at a grasp [N]. Chosen."""
IMPACT = [0.002, 1.0]
"""``solref`` of the limits of a loose grasp. It has the shortest time constant possible with steps of 1 ms."""


def add_slides(body: Any, kind: str, axes: str, **attributes: Any) -> list[Any]:
    """Add slide joints named ``{kind}_{axis}`` along the body's own axes."""
    return [
        body.add("joint", name=f"{kind}_{axis}", type="slide", axis=AXES[axis], group=3, **attributes)
        for axis in axes
    ]


def add_springs(
    scene: TeamScene, joints: list[Any], label: str, compliance_m_per_N: float, relaxation_s: float
) -> TeamScene:
    """Hold joints at zero by springs, as soft equality rows named ``{label}_{joint}``; see ``SoftRow``."""
    for joint in joints:
        name = f"{label}_{joint.name}"
        scene.root.equality.add("joint", name=name, joint1=joint)
        scene = scene.sprung(name, compliance_m_per_N, relaxation_s)
    return scene


def grasp_body(scene: TeamScene, robot: int) -> Any:
    """The body that takes the slides between one robot's flange and the payload.

    For robot 1 it is the payload, a child of the flange. For every other robot it is a light pad on the flange, added
    here, to which the weld of the grasp moves.
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


def widened(scene: TeamScene, robot: int, slack_m: float, slack_rad: float = 0.0) -> TeamScene:
    """Return the scene with a larger allowed gap and angle at one grasp."""
    wider: dict[str, Any] = {}
    for name, slack in (("grasp_slack_m", slack_m), ("grasp_slack_rad", slack_rad)):
        if slack:
            values = np.array(getattr(scene, name) or (0.0,) * scene.robots)
            values[robot - 1] += slack
            wider[name] = tuple(values.tolist())
    return replace(scene, **wider)


def base_slides(scene: TeamScene, robot: int, kind: str, **attributes: Any) -> list[Any]:
    """Add horizontal slides under one robot's chassis, along x and y of its {b} without base tilt."""
    chassis = scene.root.find("body", f"omnid{robot}/chassis")
    slides = add_slides(chassis, kind, "xy", **attributes)
    level_slides(chassis)
    return slides


def level_slides(chassis: Any) -> None:
    """Turn the slides under a tilted chassis back to horizontal."""
    if chassis.quat is not None:
        from scipy.spatial.transform import Rotation

        level = Rotation.from_quat(chassis.quat, scalar_first=True).inv()
        for slide in chassis.joint:
            slide.axis = level.apply(AXES[slide.name[-1]])


def robot_mass_kg(scene: TeamScene, robot: int) -> float:
    """Mass of one robot without the payload [kg]."""
    chassis = scene.root.find("body", f"omnid{robot}/chassis")
    bodies = [chassis, *chassis.find_all("body")]
    own = (body.inertial for body in bodies if "payload" not in body.full_identifier)
    return float(sum(inertial.mass for inertial in own if inertial is not None))


@dataclass(frozen=True)
class LinkLength(Effect):
    """Deviation of one leg's proximal length, rod length and base radius, true minus design [m].

    Implemented by moving bodies and sites.
    """

    as_built: ClassVar = {
        "proximal_m": "proximal_length_m", "rod_m": "rod_length_m", "base_radius_m": "base_radius_m"
    }  # fmt: skip
    ranges: ClassVar = dict.fromkeys(as_built, (-0.05, 0.05))
    robot: int
    joint: int
    proximal_m: float = 0.0
    rod_m: float = 0.0
    base_radius_m: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        leg = np.arange(3) == self.joint - 1
        change = AsBuilt(**{name: getattr(self, own) * leg for own, name in self.as_built.items()})
        deviate_geometry(scene.root.find("body", f"omnid{self.robot}/chassis").root, change)
        return scene


@dataclass(frozen=True)
class BaseTilt(Effect):
    """A base tilted about its floor mount by the rotation vector (roll, pitch, 0) in its untilted axes [rad].

    Implemented as the ``quat`` of the chassis body.
    """

    ranges: ClassVar = {"roll_rad": (-0.2, 0.2), "pitch_rad": (-0.2, 0.2)}
    robot: int
    roll_rad: float = 0.0
    pitch_rad: float = 0.0

    @property
    def tilt(self) -> Rotation:
        """Orientation of the tilted axes in the untilted ones."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_rotvec([self.roll_rad, self.pitch_rad, 0.0])

    def base_shift(self) -> Array:
        """Displacement of {b}, which lies above the floor mount, the centre of the tilt [m], shape (3,)."""
        height = np.array([0.0, 0.0, base_height_m()])
        return np.asarray(self.tilt.apply(height) - height)

    def _edit(self, scene: TeamScene) -> TeamScene:
        chassis = scene.root.find("body", f"omnid{self.robot}/chassis")
        chassis.quat = self.tilt.as_quat(scalar_first=True)
        level_slides(chassis)
        return scene


@dataclass(frozen=True)
class BaseCreep(Effect):
    """A base that moves at a constant velocity from ``start_s`` on, along x and y of its {b} [m/s].

    Implemented as two slides under the chassis with very large ``armature`` and ``damping``. A spring of 1 N/m with a
    distant ``springref`` pulls each slide with a constant force, damping times velocity. MJCF has no time, so if
    ``start_s`` is above zero, the trial applies the force instead (``qfrc_applied``).
    """

    ranges: ClassVar = {"x_mps": (-1e-3, 1e-3), "y_mps": (-1e-3, 1e-3), "start_s": (0.0, 1e9)}
    robot: int
    x_mps: float = 0.0
    y_mps: float = 0.0
    start_s: float = 0.0

    def actors(self, trial_number: int | None) -> Sequence[_LateCreep]:
        """The actor that pulls the base, if the motion starts after the trial."""
        return [_LateCreep(self)] if self.start_s else []

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene, TOLERANCE)
        slides = base_slides(
            scene, self.robot, "creep", armature=ARMATURE_KG, damping=DAMPING_NS_PER_M, stiffness=1.0
        )
        if not self.start_s:
            for slide, velocity in zip(slides, (self.x_mps, self.y_mps), strict=True):
                slide.springref = DAMPING_NS_PER_M * velocity
        return scene


class _LateCreep:
    """Actor that moves the slides of a creeping base at their velocity from a time on."""

    def __init__(self, creep: BaseCreep) -> None:
        self._creep = creep

    def start(self, stage: Stage) -> None:
        creep, self._dt = self._creep, 1.0 / stage.rate_hz
        joints = [stage.model.joint(f"omnid{creep.robot}/creep_{axis}") for axis in "xy"]
        self._data, self._dofs = stage.data, [int(joint.dofadr[0]) for joint in joints]
        self._force = DAMPING_NS_PER_M * np.array([creep.x_mps, creep.y_mps])

    def act(self, tick: int) -> None:
        if tick * self._dt >= self._creep.start_s - 1e-9:
            self._data.qfrc_applied[self._dofs] += self._force


@dataclass(frozen=True)
class BaseCompliance(Effect):
    """A base on horizontal springs with equal compliance in x and y, ``compliance_m_per_N`` [m/N].

    Implemented as two slides under the chassis, held by soft ``joint`` equalities (see ``mocobot_sim.scene.soft``).
    They follow the force with the time constant ``relaxation_s`` [s]. Below 5 ms they are critically damped, and their
    mass sets the response. ``mass_kg`` [kg] is the mass that moves; what exceeds the robot's mass is added to the
    slides as armature.
    """

    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-2), "relaxation_s": (0.0, 10.0), "mass_kg": (0.0, 1e4)}
    inherent: ClassVar = {"relaxation_s": 0.005, "mass_kg": 35.0}
    robot: int
    compliance_m_per_N: float
    relaxation_s: float = 0.0
    mass_kg: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not self.compliance_m_per_N:
            return scene
        precise(scene)
        armature = max(self.mass_kg - robot_mass_kg(scene, self.robot), SPRUNG_ARMATURE_KG)
        slides = base_slides(scene, self.robot, "compliance", armature=armature)
        return add_springs(scene, slides, f"base{self.robot}", self.compliance_m_per_N, self.relaxation_s)


@dataclass(frozen=True)
class GraspFlex(Effect):
    """A compliant grasp: springs of ``compliance_m_per_N`` between flange and payload, isotropic [m/N].

    Implemented as three slides held by soft ``joint`` equalities (see ``mocobot_sim.scene.soft``), on the payload
    (robot 1) or on a pad between flange and weld (other robots). They follow the force with the time constant
    ``relaxation_s`` [s]. Below 5 ms they are critically damped, and their mass sets the response.

    The grasp may also turn, by ``turning_rad_per_N`` per newton of force across the z axis of {i} [rad/N]. Three hinges
    with the same kind of springs turn it about a point ``offset_m`` [m] along z from the gimbal's centre. The gimbal
    transmits no moment, so with an offset of zero the grasp does not turn.
    """

    on_payload = True
    ranges: ClassVar = {
        "compliance_m_per_N": (0.0, 1e-3), "relaxation_s": (0.0, 10.0), "turning_rad_per_N": (0.0, 0.01),
        "offset_m": (-0.5, 0.5),
    }  # fmt: skip
    inherent: ClassVar = {"relaxation_s": 0.005}
    robot: int
    compliance_m_per_N: float
    relaxation_s: float = 0.0
    turning_rad_per_N: float = 0.0
    offset_m: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        label, slack_rad = f"grasp{self.robot}", 0.0
        if self.compliance_m_per_N:
            precise(scene)
            slides = add_slides(grasp_body(scene, self.robot), "flex", "xyz", armature=SPRUNG_ARMATURE_KG)
            scene = add_springs(scene, slides, label, self.compliance_m_per_N, self.relaxation_s)
        if self.turning_rad_per_N and self.offset_m:
            precise(scene)
            body = grasp_body(scene, self.robot)
            hinges = [
                body.add(
                    "joint", name=f"flex_about_{axis}", type="hinge", pos=[0.0, 0.0, self.offset_m], axis=along,
                    group=3, armature=HINGE_ARMATURE_KGM2,
                )
                for axis, along in AXES.items()
            ]  # fmt: skip
            by_moment = self.turning_rad_per_N / abs(self.offset_m)
            scene = add_springs(scene, hinges, label, by_moment, self.relaxation_s)
            slack_rad = LARGEST_FORCE_N * self.turning_rad_per_N
        way = self.compliance_m_per_N + self.turning_rad_per_N * abs(self.offset_m)
        return widened(scene, self.robot, LARGEST_FORCE_N * way, slack_rad)


@dataclass(frozen=True)
class GraspPlay(Effect):
    """A loose grasp: it moves freely within +-``play_m`` along each axis of {i} [m] and cannot turn.

    Implemented as three slides with ``range`` limits, on the payload (robot 1) or on a pad between flange and weld
    (other robots). The limits are stiff, or have the compliance ``contact_m_per_N`` [m/N] with critical damping.
    """

    on_payload = True
    ranges: ClassVar = {"play_m": (0.0, 5e-3), "contact_m_per_N": (0.0, 1e-4)}
    robot: int
    play_m: float
    contact_m_per_N: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not self.play_m:
            return scene
        precise(scene)
        slides = add_slides(
            grasp_body(scene, self.robot), "play", "xyz", range=[-self.play_m, self.play_m], limited=True,
            armature=LOOSE_ARMATURE_KG, solreflimit=IMPACT, solimplimit=STIFF["solimp"],
        )  # fmt: skip
        if self.contact_m_per_N:
            model = scene.compile()
            for slide in slides:
                dof = model.joint(slide.full_identifier).dofadr[0]
                slide.solreflimit, slide.solimplimit = spring_parameters(
                    self.contact_m_per_N, float(model.dof_invweight0[dof])
                )
        # Largest gap: the corner of the box (1.75 > sqrt(3)) plus the compression of the limits.
        soft = 40e-6 + 1.75 * LARGEST_FORCE_N * self.contact_m_per_N
        return widened(scene, self.robot, 1.75 * self.play_m + soft)
