"""Coulomb and viscous friction of a driven joint, between spring and link."""

from discrepancy.team.causes.base import Cause, one_joint, one_robot, stack
from discrepancy.team.causes.sliding import rests, sliding


class JointFriction(Cause):
    """The link gets less than the spring gives while it moves; below ``slow_rad_per_s`` it rests."""

    name = "joint_friction"
    family = "dissipation"
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad")
    tolerances = (2e-3, 2e-3)
    clipped = ("coulomb_Nm", "viscous_Nms_per_rad")
    shapes = ({"slow_rad_per_s": 1e-3}, {"slow_rad_per_s": 4e-3})
    positive = ("coulomb_Nm",)
    separate = "An arm-only run (payload released) shows friction of the joint alone."

    def sentence(self, n):
        return (
            f"the {self.at} rubs with {n('coulomb_Nm', 'N m')} (Coulomb, while it moves) and "
            f"{n('viscous_Nms_per_rad', 'N m s/rad')} (viscous)"
        )

    def columns(self, trial, robot, joint, shape):
        errors = _errors(trial.signals, robot, joint, shape)
        return stack([trial.of_signals(robot, tau=one_joint(error, joint)) for error in errors])

    def undo(self, signals, trial, robot, joint, values, shape):
        coulomb, viscous = _errors(signals, robot, joint, shape)
        error = one_joint(values[0] * coulomb + values[1] * viscous, joint)
        return signals.minus(tau=one_robot(error, trial.robots, robot))

    def unknowns(self, trial, robot, joint, shape):
        phi, rate = trial.signals.phi[:, robot, joint], trial.signals.rate_hz
        return [
            trial.of_signals(robot, tau=one_joint(rest, joint))
            for rest in rests(phi, rate, shape["slow_rad_per_s"])
        ]


def _errors(signals, robot, joint, shape):
    return sliding(signals.phi[:, robot, joint], signals.rate_hz, shape["slow_rad_per_s"])
