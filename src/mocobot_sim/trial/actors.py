"""What acts in a trial besides the arms (bases, hands, effects that MJCF lacks), and sensors that misread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from estimator.arrays import Array
from mocobot_sim.control.control import TeamController
from mocobot_sim.scene.models import omnid_design

if TYPE_CHECKING:
    import mujoco

    from mocobot_sim.scene.team_index import TeamIndex


@dataclass(frozen=True)
class Stage:
    """A trial that is about to begin, at rest."""

    model: mujoco.MjModel  # the trial's
    data: mujoco.MjData  # the trial's
    index: TeamIndex  # addresses in the model
    controller: TeamController  # of the arms
    rate_hz: float  # control rate [Hz]
    ticks: int  # control ticks per logged sample
    duration: int  # control ticks of the whole trial
    shared: dict[str, object] = field(
        default_factory=dict
    )  # by name, what several actors keep of the trial together


class Actor(Protocol):
    """Somebody or something that acts at the control rate.

    Every tick, before the arms' controller, ``qpos`` and ``qvel`` are those of this instant; whatever MuJoCo derives
    from them (poses of bodies and sites, contacts, forces) is of the instant one time step before.
    """

    def start(self, stage: Stage) -> None:
        """Get ready; called once."""

    def act(self, tick: int) -> None:
        """Write ``ctrl`` of what it drives; add to ``xfrc_applied`` of the payload or ``qfrc_applied`` (both zero)."""


class Reader(Protocol):
    """A sensor that misreads: it changes what the robots' controllers and logs see."""

    def start(self, stage: Stage) -> None:
        """Get ready; called once."""

    def read(self, tick: int, seen: Array) -> None:
        """Change, in place, the positions that the sensors see.

        Args:
            tick: of the control.
            seen: ``qpos`` of this instant, and what readers before this one made of it, shape (nq,). The driven angle
                is motor plus spring, the torque minus the design stiffness times the spring.
        """


class RobotReadings:
    """Readings of one robot, to be looked at and changed: a reader's view of ``seen``."""

    def __init__(self, stage: Stage, robot: int) -> None:
        index, i = stage.index, robot - 1
        self._motor, self._spring = index.motor_qpos[i].tolist(), index.spring_qpos[i].tolist()
        self._gimbal, self._stiffness = index.gimbal_qpos[i].tolist(), omnid_design().sea_stiffness_Nm_per_rad

    def tau(self, seen: Array, joint: int) -> float:
        """Torque reading [N m]; joints count from 1."""
        return -self._stiffness * float(seen[self._spring[joint - 1]])

    def set_tau(self, seen: Array, joint: int, value: float) -> None:
        """Change it, and leave the angle's reading as it is."""
        spring, motor = self._spring[joint - 1], self._motor[joint - 1]
        before = float(seen[spring])
        seen[spring] = -value / self._stiffness
        seen[motor] += before - seen[spring]

    def phi(self, seen: Array, joint: int) -> float:
        """Driven angle minus that at home [rad]."""
        return float(seen[self._motor[joint - 1]] + seen[self._spring[joint - 1]])

    def add_phi(self, seen: Array, joint: int, error: float) -> None:
        """Add to the reading of a driven angle [rad]."""
        seen[self._motor[joint - 1]] += error

    def theta(self, seen: Array, joint: int) -> float:
        """Gimbal angle [rad]; joints 1, 2, 3 are z, y, x."""
        return float(seen[self._gimbal[joint - 1]])

    def add_theta(self, seen: Array, joint: int, error: float) -> None:
        """Add to the reading of a gimbal angle [rad]."""
        seen[self._gimbal[joint - 1]] += error


class Misreading:
    """Readings of one robot, wrong.

    Args:
        robot: from 1.
        change: gets the readings, what is seen, and the time [s]; it changes them.
        ready: gets the step [s] before the first one, for what has a memory.
    """

    def __init__(
        self,
        robot: int,
        change: Callable[[RobotReadings, Array, float], None],
        ready: Callable[[float], None] = lambda _: None,
    ) -> None:
        self._robot, self._change, self._ready = robot, change, ready

    def start(self, stage: Stage) -> None:
        self._dt = 1.0 / stage.rate_hz
        self._readings = RobotReadings(stage, self._robot)
        self._ready(self._dt)

    def read(self, tick: int, seen: Array) -> None:
        self._change(self._readings, seen, tick * self._dt)
