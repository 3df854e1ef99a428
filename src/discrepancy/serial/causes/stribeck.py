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
        fades = (share * typical for share in rules.STRIBECK_SHARES)
        return [
            {"fade_per_s": fade, "typical_per_s": typical}
            for fade in fades
            if fade <= slowest_fading(typical)
        ]

    def finer(self, shape):
        typical = shape["typical_per_s"]
        low, high = rules.STRIBECK_RANGE[0] * typical, slowest_fading(typical)
        near = (factor * shape["fade_per_s"] for factor in (0.8, 1.25))
        return [dict(shape) | {"fade_per_s": fade} for fade in near if low <= fade <= high]


def slowest_fading(typical: float) -> float:
    """Speed over which such friction may fade at most; what goes on to higher ones is Coulomb friction [rad/s or m/s].

    Args:
        typical: speed of the joint while it moves.
    """
    # Rounding must not cost the last of the shares.
    return max(rules.STRIBECK_RANGE[1] * typical, rules.STRIBECK_PER_S) * (1.0 + 1e-9)
