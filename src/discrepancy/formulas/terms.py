"""Terms that formulas are made of: functions of a signal, with numbers inside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.arrays import Array

KNOTS, TRIED = 8, 40
"""Knots of a curve that is told as such; values of a number inside a term that are tried."""
STEP_S = 0.05
"""In which a step is told to rise."""
SIGN_SHARES = (0.03, 0.06, 0.12, 0.25, 0.5)
"""Of the spread of a signal, up to which its sign fades; the first is what the terms of a curve tell from a jump."""
Numbers = Sequence[float]


@dataclass(frozen=True)
class Shape:
    """A term: amplitudes times a function of the signal.

    Attributes:
        name: as in the JSON and in ``mocobot_sim.functions``, but for ``spline`` and ``step``.
        of: signal (Q,) and numbers inside -> (Q, k), one amplitude each.
        text: ``a`` is the amplitude, ``x`` the signal, ``n`` the number inside, ``p`` a phase.
        power: of the signal in the amplitude's unit.
        width: how many amplitudes.
        inside: names of the numbers inside.
        tried: values for them, by the signal.
        fitted: whether data tell the number inside beside these.
    """

    name: str
    of: Callable[[Array, Numbers], Array]
    text: str
    power: int = 0
    width: int = 1
    inside: tuple[str, ...] = ()
    tried: Callable[[Array], Sequence[Numbers]] = lambda x: [()]
    fitted: bool = False


def _plain(name: str, of: Callable[[Array], Array], text: str, power: int) -> Shape:
    return Shape(name, lambda x, n: of(x)[:, None], text, power)


def _knee(
    name: str, of: Callable[[Array, float], Array], text: str, at: Callable[[Array], Sequence[float]]
) -> Shape:
    """A function with a knee somewhere; ``at``: where it is tried, where it is not fixed."""
    return Shape(
        name, lambda x, n: of(x, n[0])[:, None], text, 1, 1, ("knee",), lambda x: [(k,) for k in at(x)], True
    )


def _wave(x: Array, n: Numbers) -> Array:
    return np.stack([np.sin(n[0] * x), np.cos(n[0] * x)], axis=1)


def _hats(x: Array, n: Numbers) -> Array:
    knots = n[0] + n[1] * np.arange(KNOTS)
    return np.maximum(1.0 - np.abs(np.clip(x, knots[0], knots[-1])[:, None] - knots) / n[1], 0.0)


def _within(x: Array) -> list[float]:
    """Values within most of those of a signal."""
    return [float(q) for q in np.quantile(x, np.linspace(0.03, 0.97, TRIED))]


def _beyond(x: Array, knee: float) -> Array:
    return np.asarray(np.copysign(np.maximum(np.abs(x) - knee, 0.0), x))


ABOVE = _knee("above", lambda x, k: np.maximum(x - k, 0.0), "{a} max({x} - {n}, 0)", _within)
BELOW = _knee("below", lambda x, k: np.minimum(x - k, 0.0), "{a} min({x} - {n}, 0)", _within)
PLAIN = (
    _plain("linear", lambda x: x, "{a} {x}", 1),
    _plain("square", np.square, "{a} {x}^2", 2),
    _plain("cube", lambda x: x**3, "{a} {x}^3", 3),
)
SIGNED = (
    Shape("sign", lambda x, n: np.clip(x / n[0], -1.0, 1.0)[:, None], "{a} sign({x})", 0, 1, ("slow",),
          lambda x: [(share * float(np.std(x)),) for share in SIGN_SHARES]),
    replace(ABOVE, text="{a} max({x}, 0)", tried=lambda x: [(0.0,)], fitted=False),
    replace(BELOW, text="{a} min({x}, 0)", tried=lambda x: [(0.0,)], fitted=False),
    _plain("absolute", np.abs, "{a} |{x}|", 1),
    _plain("signed_square", lambda x: x * np.abs(x), "{a} {x} |{x}|", 2),
    _knee("beyond", _beyond, "{a} ({x} beyond +-{n})", lambda x: _within(np.abs(x))),
)  # fmt: skip
"""Of a signal of both signs."""
OF_TIME = (
    Shape("warming", lambda x, n: -np.expm1(-x / n[0])[:, None], "{a} (1 - exp(-{x} / {n} s))", 0, 1, ("time_s",),
          lambda x: [(float(t),) for t in np.max(x) * np.geomspace(0.05, 2.0, TRIED)], fitted=True),
    Shape("step", lambda x, n: np.clip(1.0 + (x - n[0]) / STEP_S, 0.0, 1.0)[:, None], "{a} from {n} s on", 0, 1,
          ("at_s",), lambda x: [(t,) for t in _within(x)]),
)  # fmt: skip
SINE = Shape("sine", _wave, "{a} sin({n} {x} {p})", 0, 2, ("times",), fitted=True)
TURNING = replace(SINE, fitted=False)
"""A sine that comes again with a turn."""
HUM = Shape(
    "hum", lambda x, n: _wave(2.0 * np.pi * x, n), "{a} sin(2 pi {n} Hz {x} {p})", 0, 2, ("frequency_hz",)
)
SPLINE = Shape("spline", _hats, "a curve of {x}", 0, KNOTS, ("low", "step"))
