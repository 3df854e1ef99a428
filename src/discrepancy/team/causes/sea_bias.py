"""Zero of a torque reading."""

import numpy as np

from discrepancy.team.causes.base import Cause, one_robot, stack


class SeaBias(Cause):
    """tau reads too much by a constant."""

    name = "sea_bias"
    family = "sea_torque"
    parameters = ("bias_Nm",)
    tolerances = (3e-3,)
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        return (
            f"the torque sensor reads {n('bias_Nm', 'N m')} {n.either('bias_Nm', 'too much', 'too little')}"
        )

    def columns(self, trial, robot, joint, shape):
        return stack([trial.of_signals(robot, tau=np.eye(3)[joint])])

    def undo(self, signals, trial, robot, joint, values, shape):
        error = np.tile(values[0] * np.eye(3)[joint], (len(signals.time), 1))
        return signals.minus(tau=one_robot(error, trial.robots, robot))
