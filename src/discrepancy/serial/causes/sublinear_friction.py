"""Friction that grows with the speed, but more slowly the faster it is."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint, direction
from estimator.arrays import Array


class SublinearFriction(Cause):
    """Friction over speed is no straight line: it goes as a power of the speed below one, as grease does.

    Below the speed ``thins_per_s`` it is viscous, as of what thins by shear alone (Carreau, "Rheological equations from
    molecular network theories", 1972): u (u^2 + w^2)^((n - 1) / 2), with both speeds over the typical one.

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
            + (f"; it is viscous below {n('thins_per_s', 'rad/s')}" if n.values["thins_per_s"] else "")
        )

    def columns(self, signals, at, shape):
        slow, typical, e = float(signals.slow[at]), shape["typical_per_s"], shape["exponent"]
        u, w = np.abs(signals.dq[:, at]) / typical, shape["thins_per_s"] / typical
        constant, slope = line_of(e, w)
        return at_joint(
            signals, at, direction(signals, at, slow) * (thinning(u, e, w) - constant - slope * u)
        )

    def shapes(self, hints, at):
        typical = float(hints.typical[at])
        # Of a drive that tells no torque rows are too slow for that: how a gear sticks would pass for it.
        shares = (0.0,) if hints.unscaled[at] else rules.THINS_SHARES
        return [
            {"exponent": e, "thins_per_s": share * typical, "typical_per_s": typical}
            for share in shares
            for e in rules.EXPONENTS
        ]

    def finer(self, shape):
        near = (shape["exponent"] + off for off in (-0.1, 0.1))
        low, high = min(rules.EXPONENTS), max(rules.EXPONENTS)
        found = [dict(shape) | {"exponent": e} for e in near if low - 1e-9 <= e <= high + 1e-9]
        factors = rules.THINS_FINER if shape["thins_per_s"] else ()
        return found + [dict(shape) | {"thins_per_s": shape["thins_per_s"] * factor} for factor in factors]


def thinning(u: Array, exponent: float, thins: float) -> Array:
    """Friction over the speed, both over what is typical; ``thins`` is the speed below which it is viscous."""
    if not thins:
        return np.asarray(u**exponent)
    return np.asarray(u * (u**2 + thins**2) ** (0.5 * (exponent - 1.0)))


def line_of(exponent: float, thins: float) -> tuple[float, float]:
    """Constant and slope of the straight line nearest to that on 0 to 2 in the mean square."""
    if thins:
        nodes, weights = np.polynomial.legendre.leggauss(rules.LINE_NODES)
        u = 1.0 + nodes
        each = weights * thinning(u, exponent, thins)
        first, second = float(each.sum()), float(each @ u)
    else:
        first, second = 2.0 ** (exponent + 1.0) / (exponent + 1.0), 2.0 ** (exponent + 2.0) / (exponent + 2.0)
    constant, slope = np.linalg.solve([[2.0, 2.0], [2.0, 8.0 / 3.0]], [first, second])
    return float(constant), float(slope)
