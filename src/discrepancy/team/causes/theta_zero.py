"""Zero of a gimbal encoder."""

import numpy as np

from discrepancy.team.causes.base import ReadingError


class ThetaZero(ReadingError):
    """theta reads too much by a constant; joints 1, 2, 3 are z, y, x."""

    title = "encoder zero of {gimbal axis}"
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

    def errors(self, signals, robot, joint, shape, design):
        return [{"theta": np.eye(3)[joint]}]
