"""Zero of a driven joint's encoder."""

import numpy as np

from discrepancy.team.causes.base import Cause, one_robot, stack


class PhiZero(Cause):
    """phi reads too much by a constant."""

    name = "phi_zero"
    family = "arm_geometry"
    parameters = ("zero_rad",)
    tolerances = (1e-4,)
    separate = "Poses spread over the whole workspace separate a zero from a wrong length."

    def sentence(self, n):
        much = n.either("zero_rad", "too much", "too little")
        return f"the encoder of the driven joint reads {n('zero_rad', 'mrad', 1e3)} {much}"

    def columns(self, trial, robot, joint, shape):
        return stack([trial.of_signals(robot, phi=np.eye(3)[joint])])

    def undo(self, signals, trial, robot, joint, values, shape):
        error = np.tile(values[0] * np.eye(3)[joint], (len(signals.time), 1))
        return signals.minus(phi=one_robot(error, trial.robots, robot))
