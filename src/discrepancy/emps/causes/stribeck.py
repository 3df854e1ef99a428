"""Dry friction at low speed is another than in fast motion."""

import numpy as np

from discrepancy import rules
from discrepancy.emps.causes.base import Cause, filtered, force
from discrepancy.emps.causes.sliding import direction


class Stribeck(Cause):
    """Dry friction differs near standstill, by ``excess_N`` that fades with exp(-|v| / ``speed_mps``)."""

    title = "Stribeck friction"
    family = "low_speed_friction"
    parameters = ("excess_N",)
    scales = (1.0,)
    separate = "Steady motions at low speeds."

    def sentence(self, n):
        return (
            f"near standstill dry friction is {n('excess_N', 'N')} {n.either('excess_N', 'larger', 'smaller')} than in "
            f"fast motion, fading over {n('speed_mps', 'mm/s', 1e3)}"
        )

    def columns(self, signals, shape):
        fade = np.exp(-np.abs(signals.v) / shape["speed_mps"])
        return force(filtered(signals, direction(signals, rules.SLOW_MPS) * fade))

    def shapes(self, hints):
        return [{"speed_mps": speed} for speed in rules.STRIBECK_MPS]

    def finer(self, shape):
        near = (factor * shape["speed_mps"] for factor in (0.7, 0.85, 1.2, 1.4))
        # Slower than that it is how dry friction fades, faster it is viscous friction by another name.
        least, most = min(rules.STRIBECK_MPS), max(rules.STRIBECK_MPS)
        return [{"speed_mps": speed} for speed in near if least <= speed <= most]
