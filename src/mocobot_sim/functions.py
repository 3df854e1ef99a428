"""Functions of one signal, one value after the other, as a trial runs: what formulas at a place are made of."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from estimator.errors import InputError

Step = Callable[[float], float]
"""The next value of the function from the next value of the signal."""
Names = Callable[[str], object]
"""Whether a name is known."""


@dataclass(frozen=True)
class Inside:
    """Numbers inside a function."""

    number: float  # its first and its second number
    second: float  # its first and its second number
    phase_rad: float  # of a sine
    dt: float  # time from one value to the next [s]


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
    """Semi-implicit Euler steps of y'' = omega^2 (x - y) - 2 zeta omega y'."""

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
"""By name; a curve is a sum of hats, one at each knot."""

NEEDS: Mapping[str, str] = {
    "sign": "slow, above 0", "sine": "times", "hum": "frequency_hz", "warming": "time_s, above 0",
    "play": "half_width, above 0", "lag": "time_s, above 0", "second_order": "frequency_hz, above 0",
    "hat": "centre", "first_hat": "centre", "last_hat": "centre",
}  # fmt: skip
"""What ``number`` is, of functions that cannot do without."""
POSITIVE = ("sign", "warming", "play", "lag", "second_order")
"""Functions whose ``number`` must be above 0."""
WIDE = ("hat", "first_hat", "last_hat", "second_order")
"""Functions whose ``second``, a width or a damping ratio, must be above 0."""


def check_law(law: Any, is_target: Names, targets: str, is_signal: Names, signals: str) -> None:
    """Refuse a formula with a name that is not known, or numbers that its function cannot have inside.

    Args:
        law: with ``target``, ``function``, ``of``, ``times``, ``number`` and ``second``.
        is_target, is_signal: whether a name is one.
        targets, signals: what such names look like, in words.

    Raises:
        InputError: it has.
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
