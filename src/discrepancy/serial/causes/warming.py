"""Friction that fades while the joint runs warm."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint, direction


class Warming(Cause):
    """A joint rubs more when a log begins than later: its grease warms up and is worked through.

    What fades goes with a power of the speed, 1 (viscous) or 0 (Coulomb), and is counted from its mean over the longest
    log, so that ``friction`` means the same with and without it. Every log begins equally cold.
    """

    title = "fading friction in {joint}"
    family = "warming"
    dry = True
    parameters = ("more_Nm",)
    scales = (1.0,)
    positive = parameters
    reversible = True
    separate = "The same motion again and again until the joint is warm."

    def normal(self, tree, at):
        named = [float(tree.coulomb[at]), float(tree.viscous[at])]
        return [rules.JOINT_SHARE * named[0] if all(named) else 0.0]

    def sentence(self, n):
        kind = "viscous" if n.values["exponent"] else "dry"
        return (
            f"when a log begins {kind} friction is {n('more_Nm', 'N m')} {n.either('more_Nm', 'more', 'less')} at "
            f"{n('typical_per_s', 'rad/s')} than once the joint is warm, fading over {n('over_s', 's')}"
        )

    def columns(self, signals, at, shape):
        over = shape["over_s"]
        # Time counts from the log's first sample.
        mean = over / shape["until_s"] * -np.expm1(-shape["until_s"] / over)
        left = np.exp(-signals.time / over) - mean
        power = (np.abs(signals.dq[:, at]) / shape["typical_per_s"]) ** shape["exponent"]
        return at_joint(signals, at, direction(signals, at, float(signals.slow[at])) * power * left)

    def shapes(self, hints, at):
        return [
            {
                "exponent": exponent,
                "over_s": share * hints.longest_s,
                "typical_per_s": float(hints.typical[at]),
                "until_s": hints.longest_s,
            }
            for exponent in (1.0, 0.0)
            for share in rules.WARMING_SHARES
        ]

    def finer(self, shape):
        low, high = (edge * shape["until_s"] for edge in rules.WARMING_RANGE)
        near = (factor * shape["over_s"] for factor in (0.7, 1.4))
        return [dict(shape) | {"over_s": over} for over in near if low <= over <= high]
