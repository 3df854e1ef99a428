"""Friction that grows with the speed, but more slowly the faster it is."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint, direction


class SublinearFriction(Cause):
    """Friction over speed is no straight line: it goes as a power of the speed below one, as grease does.

    What a straight line up to twice the typical speed can say is taken out, so that the numbers of ``friction`` mean
    the same with and without it.
    """

    title = "sublinear friction in {joint}"
    family = "sublinear_friction"
    dry = True
    parameters = ("bend_Nm",)
    scales = (1.0,)
    positive = parameters
    reversible = True
    separate = "Steady motions at several speeds: friction over speed bends."

    def sentence(self, n):
        down = n.either("bend_Nm", "down", "up")
        return (
            f"friction over speed bends {down}: its straight line and {n('bend_Nm', 'N m')} times the speed over "
            f"{n('typical_per_s', 'rad/s')} to the power of {n.values['exponent']:.2g}, less that one's own line"
        )

    def columns(self, signals, at, shape):
        slow = float(signals.slow[at])
        u, e = np.abs(signals.dq[:, at]) / shape["typical_per_s"], shape["exponent"]
        constant, slope = line_of_power(e)
        return at_joint(signals, at, direction(signals, at, slow) * (u**e - constant - slope * u))

    def shapes(self, hints, at):
        typical = float(hints.typical[at])
        return [{"exponent": e, "typical_per_s": typical} for e in rules.EXPONENTS]

    def finer(self, shape):
        near = (shape["exponent"] + off for off in (-0.1, 0.1))
        low, high = min(rules.EXPONENTS), max(rules.EXPONENTS)
        return [dict(shape) | {"exponent": e} for e in near if low - 1e-9 <= e <= high + 1e-9]


def line_of_power(exponent: float) -> tuple[float, float]:
    """Constant and slope of the straight line nearest to u^e on 0 to 2 in the mean square."""
    first, second = 2.0 ** (exponent + 1.0) / (exponent + 1.0), 2.0 ** (exponent + 2.0) / (exponent + 2.0)
    constant, slope = np.linalg.solve([[2.0, 2.0], [2.0, 8.0 / 3.0]], [first, second])
    return float(constant), float(slope)
