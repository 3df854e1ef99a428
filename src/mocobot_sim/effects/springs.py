"""Springs and friction of driven joints and gimbals.

MuJoCo's own attributes act: ``stiffness``, ``frictionloss``, soft equalities as dampers (``mocobot_sim.scene.soft``).
Friction that gives way before it slips is a slider that the trial moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from mocobot_sim.effects.base import Effect, precise
from mocobot_sim.scene.models import GIMBAL_AXES, omnid_design
from mocobot_sim.scene.soft import STICK
from mocobot_sim.trial.actors import Stage

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


class Slider:
    """Dry friction that gives way before it slips (Prandtl's element): an actor of a trial.

    A slider follows a joint, counted from 1, by a spring of its own until that pulls with the friction's limit, after a
    way of ``yield_rad``. It acts in a spring, past that of a driven joint, or in a gimbal axis.
    """

    def __init__(
        self,
        where: Literal["driven", "spring", "gimbal"],
        robot: int,
        joint: int,
        limit_Nm: float,
        yield_rad: float,
    ) -> None:
        self._parts, self._at = ("motor", "spring") if where == "driven" else (where,), (robot - 1, joint - 1)
        self._limit_Nm, self._yield_rad = limit_Nm, yield_rad

    def start(self, stage: Stage) -> None:
        """Find the joint, with the slider's spring unloaded."""
        index, at, self._data = stage.index, self._at, stage.data
        self._qpos = [int(getattr(index, f"{part}_qpos")[at]) for part in self._parts]
        self._dofs = [int(getattr(index, f"{part}_dof")[at]) for part in self._parts]
        self._last_rad, self._bent = self._angle(), 0.0

    def act(self, tick: int) -> None:
        """Add the torque that the slider's spring holds back with."""
        now_rad = self._angle()
        self._bent = max(-1.0, min(1.0, self._bent + (now_rad - self._last_rad) / self._yield_rad))
        self._last_rad = now_rad
        for dof in self._dofs:
            self._data.qfrc_applied[dof] -= self._limit_Nm * self._bent

    def _angle(self) -> float:
        return sum(float(self._data.qpos[k]) for k in self._qpos)


def linear_stiffness(scene: TeamScene, robot: int, joint: int) -> float:
    """Linear part of one spring as built [N m/rad]."""
    unit = scene.units[robot - 1]
    return float(omnid_design().sea_stiffness_Nm_per_rad * (1.0 + unit.stiffness_ratio[joint - 1]))


@dataclass(frozen=True)
class SeaScale(Effect):
    """True stiffness is greater than built so far by ``scale`` times the design: the spring joint's ``stiffness``.

    The reading is the design stiffness times the deflection, so it is low by 1 / (1 + scale).
    """

    as_built: ClassVar = {"scale": "stiffness_ratio"}
    ranges: ClassVar = {"scale": (-0.9, 10.0)}
    robot: int
    joint: int
    scale: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        spring = scene.root.find("joint", f"omnid{self.robot}/spring{self.joint}")
        cubic = [] if spring.stiffness is None else list(np.atleast_1d(spring.stiffness)[1:])
        spring.stiffness = [linear_stiffness(scene, self.robot, self.joint), *cubic]
        return scene


@dataclass(frozen=True)
class SeaHardening(Effect):
    """Spring torque -(k d + k3 d^3) at a deflection d: polynomial ``stiffness`` of the spring joint, k3 [N m/rad^3].

    The reading is the design stiffness times the deflection, as of any spring.
    """

    ranges: ClassVar = {"cubic_Nm_per_rad3": (-500.0, 1e6)}
    robot: int
    joint: int
    cubic_Nm_per_rad3: float

    def _edit(self, scene: TeamScene) -> TeamScene:
        spring = scene.root.find("joint", f"omnid{self.robot}/spring{self.joint}")
        spring.stiffness = [linear_stiffness(scene, self.robot, self.joint), 0.0, self.cubic_Nm_per_rad3]
        return scene


@dataclass(frozen=True)
class SeaHysteresis(Effect):
    """Coulomb friction ``friction_Nm`` beside the spring: ``frictionloss`` of the spring joint [N m].

    The link feels spring plus friction; the reading is the deflection's alone. With ``presliding_Nm`` the slider sits
    behind a spring of its own and gives way before it slips, by the deflection at which the spring reads that torque.
    """

    ranges: ClassVar = {"friction_Nm": (0.0, 20.0), "presliding_Nm": (0.0, 20.0)}
    robot: int
    joint: int
    friction_Nm: float
    presliding_Nm: float = 0.0

    def actors(self, trial_number: int | None) -> Sequence[Slider]:
        """The slider behind its spring."""
        if not (self.friction_Nm and self.presliding_Nm):
            return ()
        yield_rad = self.presliding_Nm / omnid_design().sea_stiffness_Nm_per_rad
        return (Slider("spring", self.robot, self.joint, self.friction_Nm, yield_rad),)

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.friction_Nm and not self.presliding_Nm:
            precise(scene)
            spring = scene.root.find("joint", f"omnid{self.robot}/spring{self.joint}")
            spring.set_attributes(frictionloss=self.friction_Nm, **STICK)
        return scene


@dataclass(frozen=True)
class JointFriction(Effect):
    """Coulomb [N m] and viscous [N m s/rad] friction between a driven link and the chassis, past its spring.

    A fixed tendon of motor plus spring (so its length is phi) with ``frictionloss``, and a soft ``tendon`` equality
    (see ``mocobot_sim.scene.soft``) as its damper. The sensor does not feel it. With
    ``presliding_rad`` dry friction is a slider behind a spring of its own, which slips after that way.
    """

    where: ClassVar[Literal["driven", "gimbal"]] = "driven"
    ranges: ClassVar = {
        "coulomb_Nm": (0.0, 20.0),
        "viscous_Nms_per_rad": (0.0, 100.0),
        "presliding_rad": (0.0, 1.0),
    }
    robot: int
    joint: int
    coulomb_Nm: float = 0.0
    viscous_Nms_per_rad: float = 0.0
    presliding_rad: float = 0.0

    def actors(self, trial_number: int | None) -> Sequence[Slider]:
        """The slider behind its spring."""
        if not (self.coulomb_Nm and self.presliding_rad):
            return ()
        return (Slider(self.where, self.robot, self.joint, self.coulomb_Nm, self.presliding_rad),)

    def _edit(self, scene: TeamScene) -> TeamScene:
        if not (self.coulomb_Nm or self.viscous_Nms_per_rad):
            return scene
        precise(scene)
        root, name = scene.root, f"friction{self.robot}_{self.joint}"
        tendon = root.tendon.add("fixed", name=name)
        for part in ("motor", "spring"):
            joint = root.find("joint", f"omnid{self.robot}/{part}{self.joint}")
            tendon.add("joint", joint=joint, coef=1.0)
        if self.coulomb_Nm and not self.presliding_rad:
            tendon.set_attributes(frictionloss=self.coulomb_Nm, **STICK)
        if self.viscous_Nms_per_rad:
            root.equality.add("tendon", name=name, tendon1=tendon)
            scene = scene.damped(name, self.viscous_Nms_per_rad)
        return scene


@dataclass(frozen=True)
class GimbalFriction(JointFriction):
    """Coulomb [N m] and viscous [N m s/rad] friction of one gimbal joint (joints 1, 2, 3 are z, y, x).

    ``frictionloss`` of ``rows`` fixed tendons along the joint, and a soft ``joint`` equality (see
    ``mocobot_sim.scene.soft``) as its damper: damping of the joint itself would pull the welds open. With
    ``presliding_rad`` dry friction is a slider behind a spring of its own, which slips after that way.

    Attributes:
        rows: The gimbal is light, so one row would creep (see ``STICK``): stiction would fade within ten seconds.
            Rows side by side share the torque, and creep by as much less.
    """

    rows: ClassVar[int] = 8
    where: ClassVar[Literal["driven", "gimbal"]] = "gimbal"
    ranges: ClassVar = {
        "coulomb_Nm": (0.0, 5.0),
        "viscous_Nms_per_rad": (0.0, 10.0),
        "presliding_rad": (0.0, 1.0),
    }

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.coulomb_Nm or self.viscous_Nms_per_rad:
            precise(scene)
        axis = GIMBAL_AXES[self.joint - 1]
        joint = scene.root.find("joint", f"omnid{self.robot}/gimbal_{axis}")
        for k in range(self.rows if self.coulomb_Nm and not self.presliding_rad else 0):
            tendon = scene.root.tendon.add(
                "fixed", name=f"friction{self.robot}_gimbal_{axis}{k + 1}",
                frictionloss=self.coulomb_Nm / self.rows, **STICK,
            )  # fmt: skip
            tendon.add("joint", joint=joint, coef=1.0)
        if self.viscous_Nms_per_rad:
            name = f"damping{self.robot}_gimbal_{axis}"
            scene.root.equality.add("joint", name=name, joint1=joint)
            scene = scene.damped(name, self.viscous_Nms_per_rad)
        return scene
