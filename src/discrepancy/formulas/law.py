"""An unlisted law: an error that is a function of a signal, given by a formula or a curve."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discrepancy.formulas.formula import Formula, Piece
from discrepancy.numbers import SMALL, fitting
from estimator.arrays import Array

TRACE_S = 0.3
"""Time between points of a trace [s]."""

OFF_BY = " is off by "
"""Text between place and formula in a sentence."""
INSIDE = {"time_s": "s", "at_s": "s", "frequency_hz": "Hz", "times": "rad"}
"""Units of inner parameters; others have the signal's unit, and ``times`` has this unit per signal unit."""


@dataclass(frozen=True)
class Of:
    """A signal.

    Attributes:
        name: identifier in JSON and in the simulator.
        words, symbol, unit: for display.
    """

    name: str
    words: str
    symbol: str
    unit: str


@dataclass(frozen=True, eq=False)
class Law:
    """An error at a place that is a function of one signal, optionally times another signal.

    Attributes:
        place: identifier of the place in JSON; ``robot`` and ``joint`` count from 1, or None.
        target: the simulator's name of the quantity to which the error is added.
        unit: unit of the error.
        of, times: argument of the function, and the signal that multiplies it.
        formula: the function.
        traces: for each trial ``time_s``, ``signal``, and by component ``error``, ``se`` and ``law``.
    """

    place: str
    robot: int | None
    joint: int | None
    target: str
    unit: str
    of: Of
    times: Of | None
    formula: Formula
    traces: Sequence[Mapping[str, Any]] = ()

    @property
    def numbers(self) -> tuple[dict[str, float], dict[str, float]]:
        """Parameters by name, and their standard errors."""
        known = self.formula.parameters
        errors = {name: se for name, (_, se) in known.items() if se is not None}
        return {name: value for name, (value, _) in known.items()}, errors

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain JSON values; ``discrepancy.result.json`` documents the keys."""
        text = self.formula.text(self.of.symbol)
        return {
            "place": self.place, "unit": self.unit, "targets": [self.target], "function": self.formula.function,
            "of": self.of.name, "times": self.times and self.times.name, "numbers": self.formula.numbers,
            "formula": f"({text}) {self.times.symbol}" if self.times else text,
            "units": {name: self._unit_of(name) for name in self.formula.parameters}, "traces": list(self.traces),
        }  # fmt: skip

    def sentence(self, lead: str) -> str:
        """A sentence with the formula and its numbers; ``lead`` is the place in words."""
        formula, said = self.formula, self.of.words
        signals = [
            s for s in (self.of, self.times) if s and s.name != "time" and formula.function != "constant"
        ]
        where = "".join(f", {s.symbol} the {s.words} [{s.unit}]" for s in signals)
        if formula.function == "spline":
            sizes = [value for name, (value, _) in formula.parameters.items() if name.startswith("at_knot")]
            unit, scale = fitting(self._amplitude(0), max(map(abs, sizes)))
            by = f" times the {self.times.words}" if self.times else ""
            ends = f"{scale * min(sizes):.3g} to {scale * max(sizes):.3g}"
            return f"{lead}{OFF_BY}a curve of the {said}{by}, from {ends} {unit}".strip()
        unit, scale = self._shown
        text = formula.text(
            self.of.symbol,
            unit=lambda power: self._amplitude(power, unit if scale != 1.0 else ""),
            scale=scale,
        )
        return f"{lead}{OFF_BY}{f'({text}) {self.times.symbol}' if self.times else text}{where}"

    def pieces(self) -> Iterator[Piece]:
        """Split the law into functions with one amplitude each, in the form that simulators take."""
        for piece in self.formula.pieces():
            times = self.times.name if self.times else ""
            yield {"target": self.target, "of": self.of.name, "times": times} | piece

    @property
    def _shown(self) -> tuple[str, float]:
        """Readable unit of the error for its amplitudes, and the factor to it."""
        sizes = [
            abs(x) for name, (x, _) in self.formula.parameters.items() if name.startswith(("ampl", "offset"))
        ]
        power = max((shape.power for shape, _ in self.formula.terms), default=0)
        alone = self.unit in SMALL and self.unit not in (
            power and self.of.unit,
            self.times and self.times.unit,
        )
        return fitting(self.unit, max(sizes)) if alone else (self.unit, 1.0)

    def _unit_of(self, name: str) -> str:
        """Unit of a parameter; empty for a pure number."""
        stem, _, end = name.rpartition("_")
        which, stem = (int(end) - 1, stem) if end.isdigit() and stem != "at_knot" else (0, name)
        if stem == "times":
            return "" if self.of.unit == "rad" else f"rad/{_grouped(self.of.unit)}"
        if stem.startswith(("amplitude", "at_knot", "offset")):
            terms = self.formula.terms
            return self._amplitude(terms[which][0].power if stem == "amplitude" and terms else 0)
        return "rad" if stem.startswith("phase") else INSIDE.get(stem, self.of.unit)

    def _amplitude(self, power: int, unit: str = "") -> str:
        """Unit of an amplitude that multiplies a power of the signal."""
        above, below = unit or self.unit, [self.of.unit] * power + ([self.times.unit] if self.times else [])
        if self.unit in below and not unit:
            below.remove(self.unit)
            above = "1"
        below = [one for one in below if one not in ("1", "")]
        if not below:
            return "" if above == "1" else above
        powers = [
            f"{_grouped(u)}^{below.count(u)}" if below.count(u) > 1 else _grouped(u)
            for u in dict.fromkeys(below)
        ]
        together = " ".join(powers)
        return f"{above}/{together}" if len(powers) == 1 else f"{above}/({together})"


def traces(
    time: Sequence[Array],
    x: Array,
    times: Array,
    curve: Array,
    se: Array,
    formula: Formula,
    *,
    shift: bool = True,
) -> list[dict[str, Any]]:
    """Sample the curve and the formula of a law every ``TRACE_S``.

    Args:
        time: sample times of each trial [s].
        x: signal in all trials, concatenated, shape (Q,).
        times: signal that multiplies the function, shape (Q,).
        curve, se: the free curve and its standard error, shape (Q,).
        formula: the formula of the law.
        shift: whether to subtract the formula's mean, because the curve has no constant.
    """
    own = formula.at(x)
    series = x, times * curve, np.abs(times) * se, times * (own - float(np.mean(own)) * shift)
    edges, out = np.cumsum([len(t) for t in time])[:-1], []
    for t, *parts in zip(time, *(np.split(each, edges) for each in series), strict=True):
        step = TRACE_S * (len(t) - 1) / max(float(t[-1] - t[0]), 1e-9)
        few = np.arange(0, len(t), max(1, round(step)))
        signal, error, spread, law = (part[few].tolist() for part in parts)
        out.append(
            {"time_s": t[few].tolist(), "signal": signal, "error": [error], "se": [spread], "law": [law]}
        )
    return out


def _grouped(unit: str) -> str:
    """Put a unit into parentheses unless it is one symbol."""
    return unit if unit.isalpha() else f"({unit})"
