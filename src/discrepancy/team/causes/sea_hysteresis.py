"""Dry friction inside a spring."""

from discrepancy.team.causes.base import Cause, one_joint, one_robot, stack
from discrepancy.team.causes.hysteresis import stop_operator
from discrepancy.team.noise import SMOOTH_HZ
from estimator.filtering import low_pass


class SeaHysteresis(Cause):
    """Friction parallel to the spring: the link gets more than the deflection tells while the torque grows.

    ``width_Nm`` is how far the torque turns back before the friction has turned over.
    """

    name = "sea_hysteresis"
    family = "dissipation"
    parameters = ("friction_Nm",)
    shapes = ({"width_Nm": 0.05}, {"width_Nm": 0.15}, {"width_Nm": 0.5})
    separate = (
        "Motion with load reversals at rest separates friction in the spring from friction in the joint."
    )

    def columns(self, trial, robot, joint, shape):  # noqa: D102
        return stack(
            [trial.of_signals(robot, tau=one_joint(_error(trial.signals, robot, joint, shape), joint))]
        )

    def undo(self, signals, trial, robot, joint, values, shape):  # noqa: D102
        error = one_joint(values[0] * _error(signals, robot, joint, shape), joint)
        return signals.minus(tau=one_robot(error, trial.robots, robot))


def _error(signals, robot, joint, shape):
    tau = low_pass(signals.tau[:, robot, joint], signals.rate_hz, SMOOTH_HZ)
    return -stop_operator(tau, shape["width_Nm"])
