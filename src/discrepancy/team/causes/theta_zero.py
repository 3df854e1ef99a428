"""Zero of a gimbal encoder."""

import numpy as np

from discrepancy.team.causes.base import Cause, one_robot, stack


class ThetaZero(Cause):
    """theta reads too much by a constant; joints 1, 2, 3 are z, y, x."""

    name = "theta_zero"
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

    def columns(self, trial, robot, joint, shape):
        return stack([trial.of_signals(robot, theta=np.eye(3)[joint])])

    def undo(self, signals, trial, robot, joint, values, shape):
        error = np.tile(values[0] * np.eye(3)[joint], (len(signals.time), 1))
        return signals.minus(theta=one_robot(error, trial.robots, robot))
