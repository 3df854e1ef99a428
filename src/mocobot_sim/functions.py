"""Functions of one signal for laws (``effects.law``, ``serial.effects``), evaluated sample by sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from estimator.errors import InputError

Step = Callable[[float], float]
"""Function that maps the next sample of the signal to the next value; it can have a state."""
Names = Callable[[str], object]
"""Function whose result is true for valid names."""


@dataclass(frozen=True)
class Inside:
    """Parameters of a function."""

    number: float  # first parameter; ``NEEDS`` gives its meaning
    second: float  # second parameter
    phase_rad: float  # phase of a sine
    dt: float  # time between samples [s]


def _plain(of: Callable[[float, Inside], float]) -> Callable[[Inside], Step]:
    return lambda inside: lambda x: of(x, inside)


class _Play:
    def __init__(self, inside: Inside) -> None:
        self._width, self._at = inside.number, math.nan

    def __call__(self, x: float) -> float:
        if math.isnan(self._at):
            self._at = x
        self._at += max(0.0, x - self._width - self._at) - max(0.0, self._at - x - self._width)
        return (self._at - x) / self._width


class _Lag:
    def __init__(self, inside: Inside) -> None:
        self._time, self._late = inside.number, math.nan
        self._share = 1.0 - math.exp(-inside.dt / inside.number)

    def __call__(self, x: float) -> float:
        if math.isnan(self._late):
            self._late = x
        self._late += self._share * (x - self._late)
        return (self._late - x) / self._time


class _SecondOrder:
    """Low-pass filter y'' = omega^2 (x - y) - 2 zeta omega y', integrated by semi-implicit Euler steps."""

    def __init__(self, inside: Inside) -> None:
        self._omega, self._zeta, self._dt = 2.0 * math.pi * inside.number, inside.second, inside.dt
        self._y, self._rate = math.nan, 0.0

    def __call__(self, x: float) -> float:
        if math.isnan(self._y):
            self._y = x
        pull = self._omega**2 * (x - self._y) - 2.0 * self._zeta * self._omega * self._rate
        self._rate += self._dt * pull
        self._y += self._dt * self._rate
        return self._y


FUNCTIONS: Mapping[str, Callable[[Inside], Step]] = {
    "constant": _plain(lambda x, i: 1.0),
    "linear": _plain(lambda x, i: x),
    "square": _plain(lambda x, i: x * x),
    "cube": _plain(lambda x, i: x * x * x),
    "absolute": _plain(lambda x, i: abs(x)),
    "signed_square": _plain(lambda x, i: x * abs(x)),
    "sign": _plain(lambda x, i: min(1.0, max(-1.0, x / i.number))),
    "above": _plain(lambda x, i: max(x - i.number, 0.0)),
    "below": _plain(lambda x, i: min(x - i.number, 0.0)),
    "beyond": _plain(lambda x, i: math.copysign(max(abs(x) - i.number, 0.0), x)),
    "sine": _plain(lambda x, i: math.sin(i.number * x + i.phase_rad)),
    "hum": _plain(lambda x, i: math.sin(2.0 * math.pi * i.number * x + i.phase_rad)),
    "warming": _plain(lambda x, i: 1.0 - math.exp(-x / i.number)),
    "play": _Play,
    "lag": _Lag,
    "second_order": _SecondOrder,
    "hat": _plain(lambda x, i: max(0.0, 1.0 - abs(x - i.number) / i.second)),
    "first_hat": _plain(lambda x, i: min(1.0, max(0.0, 1.0 - (x - i.number) / i.second))),
    "last_hat": _plain(lambda x, i: min(1.0, max(0.0, 1.0 + (x - i.number) / i.second))),
}
"""Functions by name. A piecewise linear curve is a sum of hats, one at each knot."""

NEEDS: Mapping[str, str] = {
    "sign": "slow, above 0", "sine": "times", "hum": "frequency_hz", "warming": "time_s, above 0",
    "play": "half_width, above 0", "lag": "time_s, above 0", "second_order": "frequency_hz, above 0",
    "hat": "centre", "first_hat": "centre", "last_hat": "centre",
}  # fmt: skip
"""Meaning of ``number`` for the functions that need it."""
POSITIVE = ("sign", "warming", "play", "lag", "second_order")
"""Functions whose ``number`` must be above 0."""
WIDE = ("hat", "first_hat", "last_hat", "second_order")
"""Functions whose ``second`` (a width or a damping ratio) must be above 0."""


def check_law(law: Any, is_target: Names, targets: str, is_signal: Names, signals: str) -> None:
    """Check the names and parameters of a law.

    Args:
        law: object with ``target``, ``function``, ``of``, ``times``, ``number`` and ``second``.
        is_target, is_signal: whether a name is a valid target or signal.
        targets, signals: examples of valid names for the error message.

    Raises:
        InputError: a name is unknown, or a parameter is not allowed for the function.
    """
    names = (
        ("target", is_target, targets), ("function", FUNCTIONS.__contains__, ", ".join(FUNCTIONS)),
        ("of", is_signal, signals), ("times", lambda name: not name or is_signal(name), signals),
    )  # fmt: skip
    for field, known, words in names:
        value = getattr(law, field)
        if not known(value):
            raise InputError(f"law: {field} is {value!r:.60}; it must be one of {words}")
    if law.function in POSITIVE and law.number <= 0.0:
        what = NEEDS[law.function].replace(",", " and must be")
        raise InputError(f"law: number is {law.number!r}; of {law.function} it is {what}")
    if law.function in WIDE and law.second <= 0.0:
        raise InputError(f"law: second is {law.second!r}; with {law.function} it must be above 0")
