"""Zero of a torque reading."""

import numpy as np

from discrepancy.team.causes.base import ReadingError


class SeaBias(ReadingError):
    """tau reads too much by a constant."""

    title = "torque zero of {driven joint}"
    family = "sea_torque"
    parameters = ("bias_Nm",)
    tolerances = (3e-3,)
    separate = "Loads of both signs on the joint (a known added weight) separate bias, scale and hardening."

    def sentence(self, n):
        return (
            f"the torque sensor reads {n('bias_Nm', 'N m')} {n.either('bias_Nm', 'too much', 'too little')}"
        )

    def errors(self, signals, robot, joint, shape, design):
        return [{"tau": np.eye(3)[joint]}]
