"""A constant force on the axis, or an offset of the drive's current."""

import numpy as np

from discrepancy.emps.causes.base import Cause, force


class ForceOffset(Cause):
    """A constant force resists the motion forwards and helps it backwards."""

    title = "constant force"
    family = "constant_force"
    parameters = ("resisting_N",)
    scales = (1.0,)
    separate = (
        "Rest: raise the voltage slowly from zero in each direction and see where the axis breaks loose; a constant "
        "force shifts both, friction that differs does not push."
    )

    def sentence(self, n):
        resists = n.either("resisting_N", "resists", "helps")
        return f"a constant force of {n('resisting_N', 'N')} {resists} forward motion"

    def columns(self, signals, shape):
        return force(np.ones(len(signals.x)))
