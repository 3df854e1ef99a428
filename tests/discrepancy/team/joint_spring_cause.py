"""The trace of that spring: the torque sensor reads what the hose takes besides what the link gets."""

from discrepancy.team.causes.base import Cause, one_joint, one_robot, stack
from discrepancy.team.linear.slots import PHI
from estimator.arm.delta import inverse_kinematics


class JointSpring(Cause):
    """The torque reading grows with the joint's own angle."""

    name = "joint_spring"
    family = "joint_spring"
    parameters = ("stiffness_Nm_per_rad",)
    tolerances = (5e-3,)
    positive = ("stiffness_Nm_per_rad",)
    separate = "A run with the hose off."

    def sentence(self, n):
        return f"a hose pulls the {self.at} back with {n('stiffness_Nm_per_rad', 'N m/rad')}"

    def columns(self, trial, robot, joint, shape):
        turned = _from_home(trial.s[:, robot, PHI][:, joint], trial.design)
        return stack([trial.of_signals(robot, tau=one_joint(turned, joint))])

    def undo(self, signals, trial, robot, joint, values, shape):
        error = one_joint(values[0] * _from_home(signals.phi[:, robot, joint], trial.design), joint)
        return signals.minus(tau=one_robot(error, trial.robots, robot))


def _from_home(phi, design):
    """All driven joints stand at the same angle at home."""
    return phi - inverse_kinematics([0.0, 0.0, design.home_height_m], design)[0]
