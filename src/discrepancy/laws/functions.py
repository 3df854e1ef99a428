"""The dictionary: functions of one signal, in the field's terms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter, lfilter_zi

from discrepancy import rules
from discrepancy.causes.play import played
from estimator.arrays import Array

Numbers = Mapping[str, float]


@dataclass(frozen=True)
class Function:
    """One function of a signal, with numbers inside, such as a knee.

    Attributes:
        name: as in the JSON and in the simulator's effect ``law``.
        numbers: names of what is inside, in order.
        of: values at a rate [Hz]: signal (Q,), rate, numbers -> columns (Q, k), one amplitude each.
        formula: in words and symbols; ``a`` is the amplitude, in braces are the signal ``x`` and the numbers.
        fitted: which of the numbers the data determine, with the share by which to change them for slopes.
        least: of numbers that mean something else, or nothing, where they are less.
    """

    name: str
    numbers: tuple[str, ...]
    of: Callable[[Array, float, Numbers], Array]
    formula: str
    fitted: Mapping[str, float]
    least: Mapping[str, float] = field(default_factory=dict)

    def within(self, numbers: Numbers) -> dict[str, float]:
        """The numbers, none less than it may be."""
        return {name: max(value, self.least.get(name, value)) for name, value in numbers.items()}


def _plain(of: Callable[[Array], Array]) -> Callable[[Array, float, Numbers], Array]:
    return lambda x, rate_hz, numbers: of(x)[:, None]


def _above(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    return np.maximum(x - numbers["knee"], 0.0)[:, None]


def _below(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    return np.minimum(x - numbers["knee"], 0.0)[:, None]


def _beyond(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    knee = numbers["knee"]
    return (np.maximum(x - knee, 0.0) + np.minimum(x + knee, 0.0))[:, None]


def _sign(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    return np.clip(x / numbers["slow"], -1.0, 1.0)[:, None]


def _sine(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    turned = numbers["times"] * x
    return np.stack([np.sin(turned), np.cos(turned)], axis=1)


def _hum(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    turned = 2.0 * np.pi * numbers["frequency_hz"] * x
    return np.stack([np.sin(turned), np.cos(turned)], axis=1)


def _warming(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    return -np.expm1(-x / numbers["time_s"])[:, None]


def _play(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    """How far a play of a half width stays behind, over that: within [-1, 1]."""
    return (played(x, numbers["half_width"]) - x)[:, None] / numbers["half_width"]


def _lag(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    """A first-order lag minus the signal, over its time constant: minus the rate where that is short."""
    time = numbers["time_s"]
    share = -np.expm1(-1.0 / (rate_hz * time))
    b, a = [share], [1.0, share - 1.0]
    late, _ = lfilter(b, a, x, zi=lfilter_zi(b, a) * x[0])
    return (late - x)[:, None] / time


def _second_order(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    """y'' + 2 zeta omega y' + omega^2 y = omega^2 x, by the bilinear transform prewarped at omega."""
    omega, zeta = 2.0 * np.pi * numbers["frequency_hz"], numbers["damping"]
    k = omega / np.tan(omega / (2.0 * rate_hz))
    top = omega**2
    a = np.array(
        [
            k**2 + 2.0 * zeta * omega * k + top,
            2.0 * top - 2.0 * k**2,
            k**2 - 2.0 * zeta * omega * k + top,
        ]
    )
    b = top * np.array([1.0, 2.0, 1.0])
    b, a = b / a[0], a / a[0]
    return np.asarray(lfilter(b, a, x, zi=lfilter_zi(b, a) * x[0])[0])[:, None]


def _spline(x: Array, rate_hz: float, numbers: Numbers) -> Array:
    """Hats over equal steps, the outer ones held: straight lines between knots."""
    knots = numbers["low"] + numbers["step"] * np.arange(rules.LAW_KNOTS)
    at = np.clip(x, knots[0], knots[-1])
    return np.maximum(1.0 - np.abs(at[:, None] - knots) / numbers["step"], 0.0)


FUNCTIONS: dict[str, Function] = {
    function.name: function
    for function in (
        Function("constant", (), _plain(np.ones_like), "a", {}),
        Function("linear", (), _plain(lambda x: x), "a {x}", {}),
        Function("square", (), _plain(np.square), "a {x}^2", {}),
        Function("cube", (), _plain(lambda x: x**3), "a {x}^3", {}),
        Function("absolute", (), _plain(np.abs), "a |{x}|", {}),
        Function("signed_square", (), _plain(lambda x: x * np.abs(x)), "a {x} |{x}|", {}),
        Function("sign", ("slow",), _sign, "a sign({x})", {}),
        Function("above", ("knee",), _above, "a max({x} - {knee}, 0)", {}),
        Function("below", ("knee",), _below, "a min({x} - {knee}, 0)", {}),
        Function("beyond", ("knee",), _beyond, "a {x} beyond +-{knee}", {}),
        Function("sine", ("times",), _sine, "a sin({times} {x} + {phase})", {}),
        Function("hum", ("frequency_hz",), _hum, "a sin(2 pi {frequency_hz} {x} + {phase})", {"frequency_hz": 2e-4}),
        Function(
            "warming", ("time_s",), _warming, "a (1 - exp(-{x} / {time_s}))", {"time_s": 0.02},
            {"time_s": rules.LAW_WARMING_S[0]},
        ),
        Function("play", ("half_width",), _play, "play of {x}, half width {half_width}, amplitude a", {}),
        Function("lag", ("time_s",), _lag, "a times how far {x} lags with {time_s}, over that", {"time_s": 0.05}),
        Function(
            "second_order", ("frequency_hz", "damping"), _second_order,
            "a times what follows {x} at {frequency_hz}, damping ratio {damping}",
            {"frequency_hz": 0.02, "damping": 0.05},
        ),
        Function("spline", ("low", "step"), _spline, "a curve of {x}", {}),
    )
}  # fmt: skip
"""By name."""


def knots_of(low: float, high: float) -> dict[str, float]:
    """Numbers of a spline over a range."""
    return {"low": low, "step": (high - low) / (rules.LAW_KNOTS - 1)}
