"""Torques that are logged later than the angles."""

from discrepancy.team.causes.base import Cause, one_robot, stack
from discrepancy.team.causes.shift import advanced
from discrepancy.team.linear.signals import with_rates


class TorqueSkew(Cause):
    """All torques of a robot are those of ``delay_s`` ago; only the log is late, the controller is not."""

    name = "torque_skew"
    family = "dissipation"
    parameters = ("delay_s",)
    tolerances = (1e-4,)
    at = "robot"
    separate = "The commands separate a late log from a lag inside the sensor, which the controller sees too."

    def sentence(self, n):
        return f"the torques are logged {n('delay_s', 'ms', 1e3, signed=True)} later than the angles"

    def columns(self, trial, robot, joint, shape):
        rate = with_rates(trial.signals.tau[:, robot], trial.signals.rate_hz)[1]
        return stack([trial.of_signals(robot, tau=-rate)])

    def undo(self, signals, trial, robot, joint, values, shape):
        tau = signals.tau[:, robot]
        error = tau - advanced(tau, signals.rate_hz, values[0])
        return signals.minus(tau=one_robot(error, trial.robots, robot))
