"""What sensors and logs of a robot say wrongly: zeros, scales, lags, late clocks."""

import numpy as np
from scipy.interpolate import CubicSpline

from discrepancy.team.causes.base import ReadingError, one_joint, one_robot
from estimator.arm.unit import ArmUnit, design_of


class Late(ReadingError):
    """A robot's readings are those of ``delay_s`` ago.

    Attributes:
        readings: which of them.
    """

    parameters = ("delay_s",)
    at = "robot"
    readings = ("tau",)

    def errors(self, signals, robot, joint, shape, arm):
        rates = {x: signals.with_rates(getattr(signals, x)[:, robot])[1] for x in self.readings}
        return [{x: -rate for x, rate in rates.items()}]

    def undo(self, signals, trial, robot, joint, values, shape):
        time = np.arange(len(signals.time)) / signals.rate_hz
        at = np.clip(time + values[0], 0.0, time[-1])  # held at the ends
        late = {}
        for name in self.readings:
            x = getattr(signals, name)[:, robot]
            shifted = CubicSpline(time, x)(at)
            # The last piece meets the last sample but for rounding, and what is held is the sample.
            shifted[at >= time[-1]] = x[-1]
            late[name] = one_robot(x - shifted, trial.robots, robot)
        return signals.minus(**late)


class PhiZero(ReadingError):
    """phi reads too much by a constant."""

    title = "encoder zero of {driven joint}"
    family = "arm_geometry"
    parameters = ("zero_rad",)
    tolerances = (1e-4,)
    separate = "Poses spread over the whole workspace separate a zero from a wrong length."

    def sentence(self, n):
        much = n.either("zero_rad", "too much", "too little")
        return f"the encoder of the driven joint reads {n('zero_rad', 'mrad', 1e3)} {much}"

    def errors(self, signals, robot, joint, shape, arm):
        return [{"phi": np.eye(3)[joint]}]


class ThetaZero(ReadingError):
    """theta reads too much by a constant; joints 1, 2, 3 are z, y, x."""

    title = "encoder zero of {gimbal axis}"
    family = "gimbal_zero"
    parameters = ("zero_rad",)
    tolerances = (1e-4,)
    at = "gimbal joint"
    joints = (1, 2)  # no recording shows the last one's
    separate = (
        "The zero of the last gimbal axis is part of the grasp frame; only a known grasp would show it."
    )

    def sentence(self, n):
        much = n.either("zero_rad", "too much", "too little")
        return f"the encoder of the gimbal joint reads {n('zero_rad', 'mrad', 1e3)} {much}"

    def errors(self, signals, robot, joint, shape, arm):
        return [{"theta": np.eye(3)[joint]}]


class SeaScale(ReadingError):
    """The spring is stiffer than believed by a factor 1 + scale, so the reading is low by it.

    A scale common to all springs cannot be told from the payload's mass; a single one can.
    """

    title = "spring stiffness of {driven joint}"
    family = "sea_torque"
    parameters = ("scale",)
    tolerances = (1e-3,)
    adjusted = True
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        stiffer, small = n.either("scale", "stiffer", "softer"), n.either("scale", "too small", "too large")
        return f"the spring is {n('scale', '%', 1e2)} {stiffer} than assumed, so the torque is read {small}"

    def errors(self, signals, robot, joint, shape, arm):
        return [{"tau": one_joint(-signals.tau[:, robot, joint] / _stiffness(arm, joint), joint)}]


class SeaBias(ReadingError):
    """tau reads too much by a constant."""

    title = "torque zero of {driven joint}"
    family = "sea_torque"
    parameters = ("bias_Nm",)
    tolerances = (3e-3,)
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        return (
            f"the torque sensor reads {n('bias_Nm', 'N m')} {n.either('bias_Nm', 'too much', 'too little')}"
        )

    def errors(self, signals, robot, joint, shape, arm):
        return [{"tau": _stiffness(arm, joint) * np.eye(3)[joint]}]


def _stiffness(arm, joint):
    """How stiff a spring is over what its readings assume."""
    return 1.0 + (arm.of("stiffness_ratio")[joint] if isinstance(arm, ArmUnit) else 0.0)


class SeaHardening(ReadingError):
    """Torque k d + k3 d^3 of deflection d, read as k d."""

    title = "hardening of the spring of {driven joint}"
    family = "sea_torque"
    parameters = ("cubic_Nm_per_rad3",)
    tolerances = (3.0,)
    adjusted = True
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        hardens = n.either("cubic_Nm_per_rad3", "hardens", "softens")
        return f"the spring {hardens} with its deflection, by {n('cubic_Nm_per_rad3', 'N m/rad^3')} (cubic)"

    def errors(self, signals, robot, joint, shape, arm):
        deflection = signals.tau[:, robot, joint] / design_of(arm).sea_stiffness_Nm_per_rad
        return [{"tau": one_joint(-(deflection**3), joint)}]


class TorqueSkew(Late):
    """All torques of a robot are those of ``delay_s`` ago; only the log is late, the controller is not."""

    title = "late torque log of {robot}"
    family = "dissipation"
    tolerances = (1e-4,)
    separate = "The commands separate a late log from a lag inside the sensor, which the controller sees too."

    def sentence(self, n):
        return f"the torques are logged {n('delay_s', 'ms', 1e3, signed=True)} later than the angles"


class TorqueLag(ReadingError):
    """All torques of a robot lag by a first-order filter, which the controller sees as well."""

    title = "lag of the torque sensors of {robot}"
    family = "dissipation"
    parameters = ("time_constant_s",)
    tolerances = (1e-4,)
    at = "robot"
    positive = ("time_constant_s",)
    separate = "The commands separate a lag inside the sensor from a late log."

    def sentence(self, n):
        return f"the torque sensor follows with a time constant of {n('time_constant_s', 'ms', 1e3, signed=True)}"

    def errors(self, signals, robot, joint, shape, arm):
        # truth = reading + T d(reading)/dt
        return [{"tau": -signals.with_rates(signals.tau[:, robot])[1]}]


class SensorLag(ReadingError):
    """One torque lags by a first-order filter, which the controller sees as well."""

    title = "lag of the torque sensor in {driven joint}"
    family = "dissipation"
    parameters = ("time_constant_s",)
    tolerances = (1e-4,)
    positive = ("time_constant_s",)
    separate = "The commands separate a lag inside the sensor from a late log."

    def sentence(self, n):
        return f"the torque sensor follows with a time constant of {n('time_constant_s', 'ms', 1e3, signed=True)}"

    def errors(self, signals, robot, joint, shape, arm):
        # truth = reading + T d(reading)/dt
        return [{"tau": -one_joint(signals.with_rates(signals.tau[:, robot, joint])[1], joint)}]


class ClockDelay(Late):
    """Everything a robot logs is that of ``delay_s`` ago.

    All robots' clocks late by as much is nothing: what else is off in the model is made of the same readings, and
    late, too. Taken one by one they would shift the residual against that. So a column is what one robot's delay adds
    less what a delay of all does, an N-th of it each.
    """

    title = "clock delay of {robot}"
    family = "clock"
    tolerances = (1e-5,)
    readings = ("phi", "theta", "tau")
    by_clocks = True
    separate = "Fast motion of all robots at once."

    def sentence(self, n):
        return f"all that it logs is {n('delay_s', 'ms', 1e3)} {n.either('delay_s', 'late', 'early')}"

    def columns(self, trial, robot, joint, shape):
        each = [super(ClockDelay, self).columns(trial, i, joint, shape) for i in range(trial.robots)]
        return each[robot] - np.mean(each, axis=0)
