"""Dry friction at low speed is another than in fast motion."""

import numpy as np

from discrepancy.rules import serial as rules
from discrepancy.serial.causes.base import Cause, at_joint, direction


class Stribeck(Cause):
    """Dry friction differs near standstill, by ``excess_Nm`` that fades with exp(-|v| / ``fade_per_s``)."""

    title = "Stribeck friction in {joint}"
    family = "low_speed_friction"
    dry = True
    parameters = ("excess_Nm",)
    scales = (1.0,)
    positive = parameters
    reversible = True
    separate = "Steady motions at low speeds."

    def sentence(self, n):
        more = n.either("excess_Nm", "larger", "smaller")
        return (
            f"near standstill dry friction is {n('excess_Nm', 'N m')} {more} than in fast motion, fading over "
            f"{n('fade_per_s', 'rad/s')}"
        )

    def columns(self, signals, at, shape):
        slow = float(signals.slow[at])
        fade = np.exp(-np.abs(signals.dq[:, at]) / shape["fade_per_s"])
        return at_joint(signals, at, direction(signals, at, slow) * fade)

    def shapes(self, hints, at):
        typical = float(hints.typical[at])
        return [{"fade_per_s": share * typical, "typical_per_s": typical} for share in rules.STRIBECK_SHARES]

    def finer(self, shape):
        typical = shape["typical_per_s"]
        low, high = (edge * typical for edge in rules.STRIBECK_RANGE)
        near = (factor * shape["fade_per_s"] for factor in (0.8, 1.25))
        return [dict(shape) | {"fade_per_s": fade} for fade in near if low <= fade <= high]
