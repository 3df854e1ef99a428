"""A slider behind a spring: dry friction that gives way before it slips (Prandtl's element)."""

from typing import Literal

from mocobot_sim.trial.actors import Stage

Where = Literal["driven", "spring", "gimbal"]


class Slider:
    """Follows a joint by a spring of its own, until that pulls with the friction's limit.

    Args:
        where: in a spring, past that of a driven joint, or in a gimbal axis.
        robot, joint: from 1.
        limit_Nm: of the friction.
        yield_rad: way from no torque to the limit.
    """

    def __init__(self, where: Where, robot: int, joint: int, limit_Nm: float, yield_rad: float) -> None:
        self._where, self._at = where, (robot - 1, joint - 1)
        self._limit_Nm, self._yield_rad = limit_Nm, yield_rad

    def start(self, stage: Stage) -> None:
        """Find the joint, with the slider's spring unloaded."""
        index, at, self._data = stage.index, self._at, stage.data
        parts = {
            "driven": ((index.motor_qpos, index.motor_dof), (index.spring_qpos, index.spring_dof)),
            "spring": ((index.spring_qpos, index.spring_dof),),
            "gimbal": ((index.gimbal_qpos, index.gimbal_dof),),
        }[self._where]
        self._qpos, self._dofs = [int(q[at]) for q, _ in parts], [int(dof[at]) for _, dof in parts]
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
