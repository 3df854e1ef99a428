"""Dry friction inside a spring."""

from discrepancy.team.causes.base import Cause, one_joint, one_robot, stack
from discrepancy.team.causes.sliding import rests, sliding


class SeaHysteresis(Cause):
    """Friction parallel to the spring: the link gets more than the deflection tells while the torque grows.

    Torque that changes more slowly than ``slow_Nm_per_s`` counts as at rest.
    """

    name = "sea_hysteresis"
    family = "dissipation"
    parameters = ("friction_Nm",)
    tolerances = (2e-3,)
    shapes = ({"slow_Nm_per_s": 0.2}, {"slow_Nm_per_s": 0.6})
    positive = ("friction_Nm",)
    separate = (
        "Motion with load reversals at rest separates friction in the spring from friction in the joint."
    )

    def sentence(self, n):
        return f"the spring rubs inside, with {n('friction_Nm', 'N m')}"

    def columns(self, trial, robot, joint, shape):
        return stack(
            [trial.of_signals(robot, tau=one_joint(_error(trial.signals, robot, joint, shape), joint))]
        )

    def undo(self, signals, trial, robot, joint, values, shape):
        error = one_joint(values[0] * _error(signals, robot, joint, shape), joint)
        return signals.minus(tau=one_robot(error, trial.robots, robot))

    def unknowns(self, trial, robot, joint, shape):
        tau, rate = trial.signals.tau[:, robot, joint], trial.signals.rate_hz
        return [
            trial.of_signals(robot, tau=one_joint(rest, joint))
            for rest in rests(tau, rate, shape["slow_Nm_per_s"])
        ]


def _error(signals, robot, joint, shape):
    return -sliding(signals.tau[:, robot, joint], signals.rate_hz, shape["slow_Nm_per_s"])[0]
