"""Coulomb and viscous friction of a driven joint, between spring and link."""

from discrepancy.team.causes.base import Cause, one_joint, one_robot, stack
from discrepancy.team.causes.hysteresis import stop_operator
from discrepancy.team.noise import SMOOTH_HZ
from estimator.filtering import differentiate, low_pass


class JointFriction(Cause):
    """The link gets less than the spring gives while it moves; ``width_rad`` is the travel that turns it over."""

    name = "joint_friction"
    family = "dissipation"
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad")
    shapes = ({"width_rad": 5e-4}, {"width_rad": 2e-3}, {"width_rad": 1e-4})
    separate = "An arm-only run (payload released) shows friction of the joint alone."

    def columns(self, trial, robot, joint, shape):  # noqa: D102
        errors = _errors(trial.signals, robot, joint, shape)
        return stack([trial.of_signals(robot, tau=one_joint(error, joint)) for error in errors])

    def undo(self, signals, trial, robot, joint, values, shape):  # noqa: D102
        coulomb, viscous = _errors(signals, robot, joint, shape)
        error = one_joint(values[0] * coulomb + values[1] * viscous, joint)
        return signals.minus(tau=one_robot(error, trial.robots, robot))


def _errors(signals, robot, joint, shape):
    phi = low_pass(signals.phi[:, robot, joint], signals.rate_hz, SMOOTH_HZ)
    return stop_operator(phi, shape["width_rad"]), differentiate(phi, signals.rate_hz)
