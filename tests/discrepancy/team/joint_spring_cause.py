"""The trace of that spring: the torque sensor reads what the hose takes besides what the link gets."""

from discrepancy.team.causes.base import ReadingError, one_joint
from estimator.arm.delta import inverse_kinematics
from estimator.arm.unit import design_of


class JointSpring(ReadingError):
    """The torque reading grows with the joint's own angle."""

    family = "joint_spring"
    parameters = ("stiffness_Nm_per_rad",)
    tolerances = (5e-3,)
    adjusted = True
    positive = ("stiffness_Nm_per_rad",)
    separate = "A run with the hose off."

    def sentence(self, n):
        return f"a hose pulls the {self.at} back with {n('stiffness_Nm_per_rad', 'N m/rad')}"

    def errors(self, signals, robot, joint, shape, arm):
        design = design_of(arm)
        home = inverse_kinematics([0.0, 0.0, design.home_height_m], design)[0]
        # All driven joints stand at the same angle at home.
        return [{"tau": one_joint(signals.phi[:, robot, joint] - home, joint)}]
