"""Effects on springs and friction of driven joints and gimbals.

They use MuJoCo's ``stiffness`` and ``frictionloss``, and soft equalities as dampers (``mocobot_sim.scene.soft``).
Friction with presliding is an actor of the trial (``Slider``).
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
    """Coulomb friction with presliding (Prandtl's element: spring and slider in series); an actor of a trial.

    The torque grows linearly with the displacement up to ``limit_Nm``, reached after ``yield_rad``; then the element
    slips. It acts on the total angle of a driven joint ("driven"), on its spring alone, or on a gimbal axis. Robots and
    joints count from 1.
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
        """Look up the joint; the element starts unloaded."""
        index, at, self._data = stage.index, self._at, stage.data
        self._qpos = [int(getattr(index, f"{part}_qpos")[at]) for part in self._parts]
        self._dofs = [int(getattr(index, f"{part}_dof")[at]) for part in self._parts]
        self._last_rad, self._bent = self._angle(), 0.0

    def act(self, tick: int) -> None:
        """Update the element and add its torque."""
        now_rad = self._angle()
        self._bent = max(-1.0, min(1.0, self._bent + (now_rad - self._last_rad) / self._yield_rad))
        self._last_rad = now_rad
        for dof in self._dofs:
            self._data.qfrc_applied[dof] -= self._limit_Nm * self._bent

    def _angle(self) -> float:
        return sum(float(self._data.qpos[k]) for k in self._qpos)


def linear_stiffness(scene: TeamScene, robot: int, joint: int) -> float:
    """Linear stiffness of one spring as built [N m/rad]."""
    unit = scene.units[robot - 1]
    return float(omnid_design().sea_stiffness_Nm_per_rad * (1.0 + unit.stiffness_ratio[joint - 1]))


@dataclass(frozen=True)
class SeaScale(Effect):
    """A spring whose stiffness deviates from the design by the relative amount ``scale``.

    Implemented as the ``stiffness`` of the spring joint; several deviations add up. The torque reading is the design
    stiffness times the deflection, so it is the true torque divided by (1 + scale).
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
    """A hardening spring: torque -(k d + k3 d^3) at the deflection d, with k3 in N m/rad^3.

    Implemented as the polynomial ``stiffness`` of the spring joint. The torque reading remains the design stiffness
    times the deflection.
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
    """Coulomb friction ``friction_Nm`` in parallel with the spring [N m].

    Implemented as ``frictionloss`` of the spring joint. Spring and friction both act on the link; the torque reading
    has the spring's part only. With ``presliding_Nm`` above zero, the friction yields elastically before it slips. It
    slips after the deflection at which the torque reading would change by ``presliding_Nm``.
    """

    ranges: ClassVar = {"friction_Nm": (0.0, 20.0), "presliding_Nm": (0.0, 20.0)}
    robot: int
    joint: int
    friction_Nm: float
    presliding_Nm: float = 0.0

    def actors(self, trial_number: int | None) -> Sequence[Slider]:
        """The presliding element, if there is Coulomb friction with presliding."""
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
    """Coulomb [N m] and viscous [N m s/rad] friction between a driven link and the chassis.

    It acts on the link side of the spring, so the torque sensor does not measure it. Implemented as ``frictionloss`` of
    a fixed tendon along motor and spring, whose length is phi, with a soft ``tendon`` equality as the damper (see
    ``mocobot_sim.scene.soft``). With ``presliding_rad`` above zero, the Coulomb friction yields elastically and slips
    after that angle.
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
        """The presliding element, if there is Coulomb friction with presliding."""
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

    Implemented as ``frictionloss`` of several fixed tendons along the joint, with a soft ``joint`` equality as the
    damper (see ``mocobot_sim.scene.soft``). Damping of the joint itself would open the welds. With ``presliding_rad``
    above zero, the Coulomb friction yields elastically and slips after that angle.

    Attributes:
        rows: number of parallel friction tendons. One row would creep on the light gimbal (see ``STICK``), so that
            stiction fades within ten seconds; several rows share the torque and creep less.
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
