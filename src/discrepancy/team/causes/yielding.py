"""What gives way to a force: a spring beside a damper, as Kelvin and Voigt have it, and the mass that moves along."""

from typing import ClassVar, cast

import numpy as np
from scipy.signal import cont2discrete, lfilter

from discrepancy.causes.base import Shape
from discrepancy.team import constants
from discrepancy.team.causes.base import Cause
from estimator.arrays import Array

RELAXATION_RANGE_S = (0.001, 0.5)
"""Derived: a shorter one shifts a motion of 1 Hz by less than 0.6 % of itself; after a longer one, a base creeps."""

RELAXATION_FINER = (0.5, 0.7, 0.85, 1.2, 1.4, 2.0)
"""Shares of such a time that are tried next. Chosen."""


class Yielding(Cause):
    """Compliance times the force, behind a lag of first order: compliance times damping is its time constant.

    A mass that moves along lags as well. Where a shape has ``inertia_s2``, compliance times that mass, the lag is of
    second order.
    """

    family = "compliance"
    parameters = ("compliance_m_per_N",)
    tolerances = (1e-7,)
    positive = ("compliance_m_per_N",)
    shapes = tuple({"relaxation_s": time_s} for time_s in constants.RELAXATIONS_S)
    determined: ClassVar = {"relaxation_s": 0.1}

    def finer(self, shape):
        times_s = [shape["relaxation_s"] * share for share in RELAXATION_FINER]
        least_s, most_s = RELAXATION_RANGE_S
        return [{"relaxation_s": time_s} for time_s in times_s if least_s <= time_s <= most_s]

    def physical(self, values, context):
        return {"compliance_m_per_N": float(values[0]), **context.shape}


def lagging(force: Array, rate_hz: float, shape: Shape) -> Array:
    """A force (Q, 3) behind the lag, linear between samples, at rest before them."""
    below = [shape["relaxation_s"], 1.0]
    if inertia_s2 := shape.get("inertia_s2"):
        below.insert(0, inertia_s2)
    filtered = cast("tuple[Array, Array, float]", cont2discrete(([1.0], below), 1.0 / rate_hz, method="foh"))
    start = force[:1]
    return np.asarray(start + lfilter(np.ravel(filtered[0]), filtered[1], force - start, axis=0), dtype=float)
