"""Interfaces of what acts in a trial besides the arms (bases, hands, some effects), and of faulty sensors."""

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
    """Context of a trial, handed to actors and readers before the first tick."""

    model: mujoco.MjModel  # model of the trial
    data: mujoco.MjData  # data of the trial, at rest
    index: TeamIndex  # addresses in the model
    controller: TeamController  # controller of the arms
    rate_hz: float  # control rate [Hz]
    ticks: int  # control ticks per logged sample
    duration: int  # control ticks of the whole trial
    # objects that several actors of the trial share, by name
    shared: dict[str, object] = field(default_factory=dict)


class Actor(Protocol):
    """Something that applies forces or drives actuators at the control rate.

    Actors run before the arms' controller. ``qpos`` and ``qvel`` are those of the current instant. All quantities that
    MuJoCo derives from them (poses of bodies and sites, contacts, forces) are one time step old.
    """

    def start(self, stage: Stage) -> None:
        """Prepare for a trial; called once before the first tick."""

    def act(self, tick: int) -> None:
        """Write ``ctrl`` of its own actuators; add to ``xfrc_applied`` of the payload or to ``qfrc_applied``.

        Both force arrays are set to zero before the first actor of each tick.
        """


class Reader(Protocol):
    """A faulty sensor: it changes the readings that controllers and logs use."""

    def start(self, stage: Stage) -> None:
        """Prepare for a trial; called once before the first tick."""

    def read(self, tick: int, seen: Array) -> None:
        """Change in place the positions from which readings are computed.

        Args:
            tick: control tick.
            seen: ``qpos`` of this instant, as changed by earlier readers, shape (nq,). The driven angle is motor plus
                spring coordinate; the torque is minus the design stiffness times the spring coordinate.
        """


class RobotReadings:
    """Access to the readings of one robot in the array ``seen`` of a reader; joints count from 1."""

    def __init__(self, stage: Stage, robot: int) -> None:
        index, i = stage.index, robot - 1
        self._motor, self._spring = index.motor_qpos[i].tolist(), index.spring_qpos[i].tolist()
        self._gimbal, self._stiffness = index.gimbal_qpos[i].tolist(), omnid_design().sea_stiffness_Nm_per_rad

    def tau(self, seen: Array, joint: int) -> float:
        """Torque reading [N m]; joints count from 1."""
        return -self._stiffness * float(seen[self._spring[joint - 1]])

    def set_tau(self, seen: Array, joint: int, value: float) -> None:
        """Set the torque reading [N m] without changing the reading of the driven angle."""
        spring, motor = self._spring[joint - 1], self._motor[joint - 1]
        before = float(seen[spring])
        seen[spring] = -value / self._stiffness
        seen[motor] += before - seen[spring]

    def phi(self, seen: Array, joint: int) -> float:
        """Driven angle minus its value at home [rad]."""
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
    """Reader that changes the readings of one robot by a function.

    Args:
        robot: number of the robot, from 1.
        change: called every tick with the readings, the array ``seen`` and the time [s]; changes ``seen`` in place.
        ready: called once before the first tick with the control period [s], to initialise filters.
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
