"""Grasps and bases that give way in other forms: slowly, in rotation too, or with a soft contact behind the play."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from mocobot_sim.effects.base import precise
from mocobot_sim.effects.geometry import (
    LOOSE_ARMATURE_KG,
    SPRUNG_ARMATURE_KG,
    add_slides,
    add_springs,
    base_slides,
    grasp_body,
    widened,
)
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.soft import spring_parameters
from mocobot_sim.trial.actors import Actor, Stage
from sealed.forms.base import Form, Place
from sealed.ground import Ground

LARGEST_FORCE_N = 400.0
LARGEST_MOMENT_NM = 60.0
TURNING_ARMATURE_KGM2 = 0.01
CONTACT_DAMPING_NS_PER_M = 20.0


@dataclass(frozen=True)
class SlowBaseCompliance(Form):
    """A base on springs beside dampers (Kelvin and Voigt): it follows its load in tens of milliseconds."""

    answer = "base_compliance"
    size, size_is_known = "compliance_m_per_N", True
    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-2), "relaxation_s": (0.02, 10.0)}
    robot: int
    compliance_m_per_N: float
    relaxation_s: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"relaxation_s": float(rng.uniform(0.03, 0.15))}

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        slides = base_slides(scene, self.robot, "slow", armature=SPRUNG_ARMATURE_KG)
        return add_springs(scene, slides, f"slowbase{self.robot}", self.compliance_m_per_N, self.relaxation_s)


@dataclass(frozen=True)
class SlowGrasp(Form):
    """A grasp on springs beside dampers."""

    answer = "grasp_flex"
    size, size_is_known = "compliance_m_per_N", True
    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-3), "relaxation_s": (0.02, 10.0)}
    on_payload = True
    robot: int
    compliance_m_per_N: float
    relaxation_s: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"relaxation_s": float(rng.uniform(0.03, 0.15))}

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        slides = add_slides(grasp_body(scene, self.robot), "slow", "xyz", armature=SPRUNG_ARMATURE_KG)
        scene = add_springs(
            scene, slides, f"slowgrasp{self.robot}", self.compliance_m_per_N, self.relaxation_s
        )
        return widened(scene, self.robot, LARGEST_FORCE_N * self.compliance_m_per_N)


@dataclass(frozen=True)
class TurningGrasp(Form):
    """A grasp that gives way to forces and to moments, about a point beside the gimbal's centre.

    The gimbal passes no moment, so a grasp that turned about its centre would not turn at all.
    """

    answer = "grasp_flex"
    size, size_is_known = "compliance_m_per_N", True
    ranges: ClassVar = {"compliance_m_per_N": (0.0, 1e-3), "reach_m": (0.0, 10.0), "offset_m": (-1.0, 1.0)}
    on_payload = True
    robot: int
    compliance_m_per_N: float
    reach_m: float
    """Compliance in rotation is that in translation over the square of this."""
    offset_m: float
    """From the gimbal's centre to where it turns, along z of {i}."""

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        reach, offset = rng.uniform(0.04, 0.1), rng.choice([-1.0, 1.0]) * rng.uniform(0.03, 0.08)
        return {"reach_m": float(reach), "offset_m": float(offset)}

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        body, turn = grasp_body(scene, self.robot), self.compliance_m_per_N / self.reach_m**2
        slides = add_slides(body, "yield", "xyz", armature=SPRUNG_ARMATURE_KG)
        hinges = [
            body.add(
                "joint",
                pos=[0.0, 0.0, self.offset_m],
                name=f"turn_{axis}",
                type="hinge",
                axis=along,
                armature=TURNING_ARMATURE_KGM2,
                group=3,
            )
            for axis, along in zip("xyz", np.eye(3).tolist(), strict=True)
        ]
        scene = add_springs(scene, slides, f"yield{self.robot}", self.compliance_m_per_N, 0.0)
        scene = add_springs(scene, hinges, f"turn{self.robot}", turn, 0.0)
        slack = np.array(scene.grasp_slack_rad or (0.0,) * scene.robots)
        slack[self.robot - 1] += LARGEST_MOMENT_NM * turn
        scene = replace(scene, grasp_slack_rad=tuple(slack.tolist()))
        way = self.compliance_m_per_N + abs(self.offset_m) ** 2 * turn
        return widened(scene, self.robot, LARGEST_FORCE_N * way)


@dataclass(frozen=True)
class SoftPlay(Form):
    """A loose grasp, damped while it travels, with a contact behind the gap that gives way."""

    answer = "grasp_play"
    size, size_is_known = "play_m", True
    ranges: ClassVar = {
        "play_m": (0.0, 5e-3),
        "contact_m_per_N": (1e-9, 1e-4),
        "damping_Ns_per_m": (0.0, 50.0),
    }
    on_payload = True
    robot: int
    play_m: float
    contact_m_per_N: float
    damping_Ns_per_m: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {
            "contact_m_per_N": float(rng.uniform(0.5e-7, 3e-7)),
            "damping_Ns_per_m": float(rng.choice([0.0, rng.uniform(1.0, CONTACT_DAMPING_NS_PER_M)])),
        }

    def _edit(self, scene: TeamScene) -> TeamScene:
        precise(scene)
        slides = add_slides(
            grasp_body(scene, self.robot), "gap", "xyz", range=[-self.play_m, self.play_m], limited=True,
            armature=LOOSE_ARMATURE_KG,
        )  # fmt: skip
        model = scene.compile()
        for slide in slides:
            at = model.joint(slide.full_identifier).dofadr[0]
            solref, solimp = spring_parameters(self.contact_m_per_N, float(model.dof_invweight0[at]))
            slide.solreflimit, slide.solimplimit = solref, solimp
        return widened(scene, self.robot, 1.75 * self.play_m + 40e-6 + LARGEST_FORCE_N * self.contact_m_per_N)

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        return [_Dashpots(self.robot, self.damping_Ns_per_m)] if self.damping_Ns_per_m else []


class _Dashpots:
    """Dampers in the three directions of a loose grasp."""

    def __init__(self, robot: int, damping: float) -> None:
        self._body, self._damping = f"omnid{robot}/gap" if robot > 1 else "omnid1/payload/gap", damping

    def start(self, stage: Stage) -> None:
        self._data = stage.data
        self._dofs = [int(stage.model.joint(f"{self._body}_{axis}").dofadr[0]) for axis in "xyz"]

    def act(self, tick: int) -> None:
        self._data.qfrc_applied[self._dofs] -= self._damping * self._data.qvel[self._dofs]
