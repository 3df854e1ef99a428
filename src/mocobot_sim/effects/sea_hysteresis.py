"""A spring with friction inside."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from mocobot_sim.effects.base import Effect
from mocobot_sim.effects.friction import STICK
from mocobot_sim.effects.solver import precise
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.trial.actors import Actor, Reader, Stage


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

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """The slider behind its spring."""
        return (Slider(self),) if self.friction_Nm and self.presliding_Nm else ()

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """No sensor misreads."""
        return ()

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.friction_Nm and not self.presliding_Nm:
            precise(scene)
            spring = scene.root.find("joint", f"omnid{self.robot}/spring{self.joint}")
            spring.set_attributes(frictionloss=self.friction_Nm, **STICK)
        return scene


class Slider:
    """Follows the spring's deflection by a spring of its own, until that pulls with the friction's limit.

    Args:
        effect: with its sizes.
    """

    def __init__(self, effect: SeaHysteresis) -> None:
        self._at = effect.robot - 1, effect.joint - 1
        self._limit_Nm = effect.friction_Nm
        self._yield_rad = effect.presliding_Nm / omnid_design().sea_stiffness_Nm_per_rad

    def start(self, stage: Stage) -> None:
        """Find the spring, unloaded by the slider."""
        self._data = stage.data
        self._qpos, self._dof = int(stage.index.spring_qpos[self._at]), int(stage.index.spring_dof[self._at])
        self._last_rad, self._bent = float(self._data.qpos[self._qpos]), 0.0

    def act(self, tick: int) -> None:
        """Add the torque that the slider's spring holds back with."""
        now_rad = float(self._data.qpos[self._qpos])
        self._bent = max(-1.0, min(1.0, self._bent + (now_rad - self._last_rad) / self._yield_rad))
        self._last_rad = now_rad
        self._data.qfrc_applied[self._dof] -= self._limit_Nm * self._bent
