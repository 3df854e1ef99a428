"""Units of a law's parameters, put together from those of its place and signals."""

from __future__ import annotations

from collections.abc import Iterable

from discrepancy.laws.candidate import LawCandidate

POWERS = {
    "linear": 1, "absolute": 1, "above": 1, "below": 1, "beyond": 1, "square": 2, "signed_square": 2, "cube": 3,
    "lag": 1, "second_order": 1,
}  # fmt: skip
"""Of the signal, in functions that grow with it; others have an amplitude in the place's unit."""
INSIDE = {"time_s": "s", "frequency_hz": "Hz", "times": "", "damping": ""}
"""Of numbers inside a function; others have the signal's."""


def units_of(candidate: LawCandidate, names: Iterable[str]) -> dict[str, str]:
    """Unit of every parameter of ``numbers.physical``, by name; a pure number has an empty one."""
    return {name: _unit(candidate, name) for name in names}


def _unit(candidate: LawCandidate, name: str) -> str:
    if name in INSIDE:
        return INSIDE[name]
    if name in candidate.term.numbers:
        return candidate.term.of.unit
    if name.startswith("phase_rad"):
        return "rad"
    place = candidate.at
    if candidate.term.of.parts:
        known = {"along": "", "by": "", "lever": "m"}
        return known.get(name.partition("_")[0], amplitude(place.unit, candidate))
    ends = [axis.replace(" ", "_") for axis in place.axes]
    own = next((k for k, end in enumerate(ends) if end and name.endswith(f"_{end}")), 0)
    unit = place.units[own] if place.units else place.unit
    return amplitude(unit, candidate) if name.startswith("amplitude") else unit


def amplitude(unit: str, candidate: LawCandidate) -> str:
    """Unit of what multiplies the function, from that of the error."""
    term = candidate.term
    power = POWERS.get(term.function, 0)
    of = term.of.unit
    if of == unit and term.times is None and power:
        if term.function == "lag":
            return "s"
        return {1: "", 2: f"1/{_grouped(of)}"}.get(power, f"1/{_grouped(of)}^{power - 1}")
    below = [f"{_grouped(of)}^{power}" if power > 1 else of] if power else []
    below += ["s^-1"] if term.function == "lag" else []
    if term.times is not None and term.times.unit == unit:
        return f"1/({' '.join(below)})" if below else ""
    below += [] if term.times is None else [term.times.unit]
    below = [one for one in below if one not in ("1", "")]
    if len(below) == 1:
        return f"{unit}/{_grouped(below[0])}"
    return f"{unit}/({' '.join(below)})" if below else unit


def _grouped(unit: str) -> str:
    """In parentheses unless it is one symbol, or one with a power."""
    return unit if unit.isalpha() else f"({unit})"
