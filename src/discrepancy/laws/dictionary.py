"""Which formulas are tried at a place."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from discrepancy import rules
from discrepancy.laws.functions import knots_of
from discrepancy.laws.place import Place
from discrepancy.laws.term import Term
from discrepancy.laws.variable import TIME, Kind, Variable
from estimator.arrays import Array

PLAIN: dict[Kind, tuple[str, ...]] = {
    "time": ("linear", "square"),
    "angle": ("linear", "square", "cube", "absolute"),
    "travel": ("linear", "square", "cube", "absolute"),
    "rate": ("linear", "signed_square", "absolute"),
    "acceleration": ("linear",),
    "torque": ("linear", "square", "cube", "absolute"),
    "position": ("linear", "square"),
    "velocity": ("linear", "signed_square", "absolute"),
    "tilt": ("linear",),
    "direction": (),
    "vector": ("linear",),
}
"""Functions without a number inside, by kind of signal."""


def terms_at(place: Place, variables: Sequence[Variable], spread: Callable[[Variable], Array]) -> list[Term]:
    """Every formula that is tried at a place.

    Args:
        place: where.
        variables: all signals.
        spread: values of a signal in all trials, shape (Q,), for knees and widths.
    """
    out = [Term("constant", TIME)] if not place.offset else []
    out += of_time()
    for variable in place.own:
        if not variable.parts:
            out += of_own(variable, spread(variable))
        elif not place.units:  # otherwise its components are not one vector
            out += of_vector(variable)
    torques = [v for v in place.own if v.kind == "torque"]
    for torque in torques:
        out += [Term("warming", TIME, {"time_s": t}, torque) for t in rules.LAW_WARMING_S]
        out += [Term("linear", TIME, {}, torque)]
        for other in place.own:
            if other.kind == "rate":
                out += [Term("sign", other, {"slow": other.slow}, torque)]
            elif other.kind in ("angle", "travel"):
                out.append(Term("linear", other, {}, torque))
    for direction in (v for v in place.own if v.kind == "direction"):
        out += rubbing(direction, place.own, spread)
    apart = {v.name for v in (*place.own, *place.without, TIME)}
    out += [Term("linear", v) for v in variables if v.name not in apart]
    return out


def rubbing(direction: Variable, own: Sequence[Variable], spread: Callable[[Variable], Array]) -> list[Term]:
    """Dry friction that changes with time, with where the joint stands, or with what it carries."""
    out = [Term(term.function, TIME, term.numbers, direction) for term in of_time()]
    for variable in own:
        if variable.kind in ("angle", "travel"):
            skip = ("play",)
        elif variable.kind == "torque":
            skip = ("play", "lag", "beyond")
        else:
            continue
        each = (t for t in of_own(variable, spread(variable)) if t.function not in skip)
        out += [Term(t.function, variable, t.numbers, direction) for t in each]
    return out


def of_time() -> list[Term]:
    """Functions of time; frequencies come from what is left."""
    slow = [Term("warming", TIME, {"time_s": time}) for time in rules.LAW_WARMING_S]
    return [*(Term(name, TIME) for name in PLAIN["time"]), *slow]


def of_own(variable: Variable, values: Array) -> list[Term]:
    """Functions of a signal of the place itself.

    Args:
        variable: the signal.
        values: in all trials, shape (Q,).
    """
    out = [Term(name, variable) for name in PLAIN[variable.kind]]
    low, *inner, high = np.quantile(values, rules.LAW_QUANTILES).tolist()
    sigma = float(np.std(values))
    if variable.kind in ("angle", "travel", "torque"):
        out += [Term(side, variable, {"knee": knee}) for knee in inner for side in ("above", "below")]
        out += [Term("play", variable, {"half_width": sigma * w}) for w in rules.LAW_PLAY_SHARES]
    if variable.kind == "torque":
        sizes = np.quantile(np.abs(values), rules.LAW_QUANTILES[1:-1]).tolist()
        out += [Term("beyond", variable, {"knee": knee}) for knee in sizes]
        out += [Term("lag", variable, {"time_s": time}) for time in rules.LAW_LAG_S]
    if variable.kind in ("angle", "travel"):
        out += [
            Term("sine", variable, {"times": variable.wave * k}) for k in range(1, rules.LAW_MOST_TIMES + 1)
        ]
    if variable.kind == "rate":
        out += [Term(side, variable, {"knee": 0.0}) for side in ("above", "below")]
        out.append(Term("sign", variable, {"slow": variable.slow}))
    if variable.kind in ("acceleration", "tilt"):
        out += on_springs(variable)
    if high > low and variable.kind != "direction":
        out.append(Term("spline", variable, knots_of(low, high)))
    return out


def of_vector(variable: Variable) -> list[Term]:
    """Functions of all components of a signal, in whatever direction each of them acts."""
    plain = [Term(name, variable) for name in PLAIN["vector"]]
    return plain + (on_springs(variable) if variable.parts[0].kind == "acceleration" else [])


def on_springs(variable: Variable) -> list[Term]:
    """What follows a signal on springs."""
    return [
        Term("second_order", variable, {"frequency_hz": f, "damping": zeta})
        for f in rules.LAW_RESONANCE_HZ
        for zeta in rules.LAW_DAMPING
    ]


def hums(frequencies_hz: Iterable[float]) -> list[Term]:
    """Sines of time."""
    return [Term("hum", TIME, {"frequency_hz": float(f)}) for f in frequencies_hz]


def nearby(term: Term, *, finer: bool) -> list[Term]:
    """The formula with other numbers inside; ``finer`` ones around its own."""
    step = 1.15 if finer else 1.6
    if term.function == "sine":
        times, wave = term.numbers["times"], term.of.wave
        # What comes again with a turn does so a whole number of times in it; along a way it need not.
        steps = (-2.0, -1.0, 1.0, 2.0) if not finer else (-0.2, 0.2) if term.of.kind == "travel" else ()
        moved = (times + d * wave for d in steps)
        return [replace(term, numbers={"times": t}) for t in moved if t >= wave]
    if term.function == "hum":
        f, width = term.numbers["frequency_hz"], rules.LAW_HUM_STEP_HZ / (8.0 if finer else 2.0)
        return [replace(term, numbers={"frequency_hz": f + d}) for d in (-width, width) if f + d > 0]
    if term.function == "spline" or not term.numbers:
        return []
    out = []
    for name, value in term.numbers.items():
        for factor in (1.0 / step, step):
            out.append(replace(term, numbers={**term.numbers, name: value * factor}))
    return out
