"""Readings of a robot that are wrong while a trial runs: what a ``Reader`` changes."""

from collections.abc import Callable

from estimator.arrays import Array
from mocobot_sim.scene.design import omnid_design
from mocobot_sim.trial.actors import Stage


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
        """Find the robot's joints."""
        self._dt = 1.0 / stage.rate_hz
        self._readings = RobotReadings(stage, self._robot)
        self._ready(self._dt)

    def read(self, tick: int, seen: Array) -> None:
        """Change what is seen."""
        self._change(self._readings, seen, tick * self._dt)
