"""What gives way to a force: a spring beside a damper, as Kelvin and Voigt have it, and the mass that moves along."""

from typing import ClassVar, cast

import numpy as np
from scipy.signal import cont2discrete, lfilter

from discrepancy import rules
from discrepancy.causes.base import Shape
from discrepancy.team.causes.base import Cause
from estimator.arrays import Array


class Yielding(Cause):
    """Compliance times the force, behind a lag of first order: compliance times damping is its time constant.

    A mass that moves along lags as well. Where a shape has ``inertia_s2``, compliance times that mass, the lag is of
    second order.
    """

    family = "compliance"
    parameters = ("compliance_m_per_N",)
    tolerances = (1e-7,)
    positive = ("compliance_m_per_N",)
    shapes = tuple({"relaxation_s": time_s} for time_s in rules.RELAXATIONS_S)
    determined: ClassVar = {"relaxation_s": 0.1}
    inexact = ("relaxation_s", "inertia_s2")

    def finer(self, shape):
        times_s = [shape["relaxation_s"] * share for share in rules.RELAXATION_FINER]
        least_s, most_s = rules.RELAXATION_RANGE_S
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
