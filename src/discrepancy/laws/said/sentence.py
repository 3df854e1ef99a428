"""A law in one sentence."""

from __future__ import annotations

from collections.abc import Mapping

from discrepancy.causes.numbers import number
from discrepancy.causes.units import SMALL, fitting
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.said.guess import guess
from discrepancy.laws.said.units import units_of
from discrepancy.laws.variable import Variable


def sentence(candidate: LawCandidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
    """Place, formula with its numbers, signal and, as a guess, what it may be.

    Args:
        candidate: the law.
        values, se: of ``numbers.report``.
    """
    term, place = candidate.term, candidate.at
    what = candidate.where_it_is
    lead = f"{what[:1].upper()}{what[1:]}"
    if _is_share(candidate):
        share = number(values["amplitude"], se.get("amplitude"), "%", 100.0)
        said = f"{lead} contains {share} of the {term.of.words}"
    elif term.function == "spline":
        sizes = [x for name, x in values.items() if name.startswith("at_knot")]
        unit, scale = fitting(place.unit, max(map(abs, sizes)))
        rubs = "" if term.times is None else f" times the {_words(term.times)}"
        said = (
            f"{lead} is off by a curve of the {_words(term.of)}{rubs}, from {scale * min(sizes):.3g} to "
            f"{scale * max(sizes):.3g} {unit}"
        )
    else:
        said = f"{lead} is off by {_formula(candidate, values, se)}{_where(candidate)}"
    because = guess(candidate, values)
    return f"{said}. A guess: {because}." if because else f"{said}."


def _is_share(candidate: LawCandidate) -> bool:
    """Whether the amplitude is a pure number: a reading that takes in another of its kind; vectors have several."""
    term, place = candidate.term, candidate.at
    alike = term.of.unit == place.unit and len(place.axes) == 1 and not term.of.parts
    return alike and term.function == "linear" and term.times is None


def _formula(candidate: LawCandidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
    if candidate.term.of.parts:
        return _by_vector(candidate, values, se)
    ends = [f"_{axis.replace(' ', '_')}" if axis else "" for axis in candidate.at.axes]
    sizes = [_amplitude(candidate, values, se, end) for end in ends]
    if len(ends) == 1:
        phase = _phase(values, ends[0])
        return f"{sizes[0]} {_inside(candidate, phase, se)}".strip()
    # Of a vector only the components that can be seen; together when they share a phase.
    told = [f"{axis} {size}" for axis, size in zip(candidate.at.axes, sizes, strict=True)]
    strongest = max(ends, key=lambda end: abs(values[f"amplitude{end}"]))
    inside = _inside(candidate, _phase(values, strongest), se)
    return f"({', '.join(told)}) {inside}".strip()


def _by_vector(candidate: LawCandidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
    """The largest error and its direction, of the signal in its own, and how much there is across."""
    along, by = (
        ", ".join(f"{values[f'{name}_{axis}']:.2f}" for axis in axes)
        for name, axes in (("along", candidate.at.axes), ("by", candidate.term.of.axes))
    )
    inside = _inside(candidate, "", se, f"{candidate.term.of.symbol} along ({by})")
    across = 100.0 * abs(values["beside"]) / (abs(values["amplitude"]) or 1.0)
    return f"{_amplitude(candidate, values, se, '')} along ({along}) {inside}, across by {across:.0f} % of it"


def _amplitude(
    candidate: LawCandidate, values: Mapping[str, float], se: Mapping[str, float], end: str
) -> str:
    unit = units_of(candidate, [f"amplitude{end}"])[f"amplitude{end}"]
    top = fitting(unit, abs(values[f"amplitude{end}"])) if unit in SMALL else (unit, 1.0)
    return number(values[f"amplitude{end}"], se.get(f"amplitude{end}"), top[0], top[1])


def _phase(values: Mapping[str, float], end: str) -> str:
    phase = values.get(f"phase_rad{end}")
    return "" if phase is None else f"{'+' if phase >= 0 else '-'} {abs(phase):.2f}"


def _inside(candidate: LawCandidate, phase: str, se: Mapping[str, float], of: str = "") -> str:
    term = candidate.term
    x, n = of or term.of.symbol, dict(term.numbers)
    number_ = {name: number(value, se.get(name), "") for name, value in n.items()}
    text = {
        "constant": "", "linear": x, "square": f"{x}^2", "cube": f"{x}^3", "absolute": f"|{x}|",
        "signed_square": f"{x} |{x}|", "sign": f"sign({x})",
        "above": f"max({x} - {n.get('knee', 0.0):.3g}, 0)", "below": f"min({x} - {n.get('knee', 0.0):.3g}, 0)",
        "beyond": f"({x} beyond +-{n.get('knee', 0.0):.3g})",
        "sine": f"sin({n.get('times', 0.0):.3g} {x} {phase})",
        "hum": f"sin(2 pi {number_.get('frequency_hz')} Hz t {phase})",
        "warming": f"(1 - exp(-t / {number_.get('time_s')} s))",
        "play": f"times play({x}), from -1 to 1, of half width {n.get('half_width', 0.0):.2g}",
        "lag": f"times the lag of {x} by {number_.get('time_s')} s",
        "second_order": (
            f"times what follows {x} at {number_.get('frequency_hz')} Hz with damping ratio {number_.get('damping')}"
        ),
    }[term.function]  # fmt: skip
    return text if term.times is None else f"{text} {term.times.symbol}"


def _where(candidate: LawCandidate) -> str:
    """What the symbols are."""
    term = candidate.term
    each = [v for v in (term.of, term.times) if v is not None and v.kind != "time"]
    told = ", ".join(f"{v.symbol} the {_words(v)}" for v in each)
    return f", {told}" if told and term.function != "constant" else ""


def _words(variable: Variable) -> str:
    if variable.kind in ("time", "direction"):
        return variable.words
    return f"{variable.words} [{variable.unit}]"
