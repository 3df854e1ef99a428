"""Zero of a driven joint's encoder."""

import numpy as np

from discrepancy.team.causes.base import ReadingError


class PhiZero(ReadingError):
    """phi reads too much by a constant."""

    title = "encoder zero of {driven joint}"
    family = "arm_geometry"
    parameters = ("zero_rad",)
    tolerances = (1e-4,)
    separate = "Poses spread over the whole workspace separate a zero from a wrong length."

    def sentence(self, n):
        much = n.either("zero_rad", "too much", "too little")
        return f"the encoder of the driven joint reads {n('zero_rad', 'mrad', 1e3)} {much}"

    def errors(self, signals, robot, joint, shape, design):
        return [{"phi": np.eye(3)[joint]}]
