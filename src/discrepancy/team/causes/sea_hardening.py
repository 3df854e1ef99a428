"""A spring that grows stiffer with deflection."""

from discrepancy.team.causes.base import Cause, one_joint, one_robot, stack
from discrepancy.team.linear.slots import TAU


class SeaHardening(Cause):
    """Torque k d + k3 d^3 of deflection d, read as k d."""

    name = "sea_hardening"
    family = "sea_torque"
    parameters = ("cubic_Nm_per_rad3",)
    tolerances = (3.0,)
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        hardens = n.either("cubic_Nm_per_rad3", "hardens", "softens")
        return f"the spring {hardens} with its deflection, by {n('cubic_Nm_per_rad3', 'N m/rad^3')} (cubic)"

    def columns(self, trial, robot, joint, shape):
        return stack(
            [trial.of_signals(robot, tau=one_joint(_error(trial.s[:, robot, TAU][:, joint], trial), joint))]
        )

    def undo(self, signals, trial, robot, joint, values, shape):
        error = one_joint(values[0] * _error(signals.tau[:, robot, joint], trial), joint)
        return signals.minus(tau=one_robot(error, trial.robots, robot))


def _error(tau, trial):
    return -((tau / trial.design.sea_stiffness_Nm_per_rad) ** 3)
