"""Units of a law's numbers: what stands before the function, times the function's own unit, is that of the place."""

from fractions import Fraction

import numpy as np
import pytest

from discrepancy.laws.candidate import candidate_of
from discrepancy.laws.dictionary import of_own, of_time, terms_at
from discrepancy.laws.said.numbers import physical
from discrepancy.laws.said.units import units_of
from discrepancy.laws.term import Term
from discrepancy.team.laws.variable import TIME
from discrepancy.team.laws.places import places_of
from discrepancy.team.laws.variables import joint_variable, payload_variable, variables_of

BASE = {
    "N": {"N": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "kg": {"kg": 1},
    "1": {},
    "": {},
    "Hz": {"s": -1},
}


def dimension(unit):
    """Powers of the base units in such as ``N m/((rad/s) s)``: a parser of its own."""
    top, depth, parts = [""], 0, []
    for sign in unit:
        depth += (sign == "(") - (sign == ")")
        if depth == 0 and sign in " /":
            parts.append(top.pop())
            top.append("/" if sign == "/" else "")
        else:
            top[0] += sign
    parts.append(top.pop())
    out = {}
    for part in parts:
        sign, body, power = -1 if part.startswith("/") else 1, part.lstrip("/"), Fraction(1)
        if "^" in body.rsplit(")", 1)[-1]:
            body, number = body.rsplit("^", 1)
            power = Fraction(number)
        inner = dimension(body[1:-1]) if body.startswith("(") else BASE[body]
        for name, own in inner.items():
            out[name] = out.get(name, 0) + sign * power * own
    return {name: power for name, power in out.items() if power}


def test_the_parser():
    assert dimension("N m/((rad/s) s)") == {"N": 1, "m": 1, "rad": -1}
    assert dimension("1/(N m)^2") == {"N": -2, "m": -2}
    assert dimension("") == dimension("s Hz") == {}


def times(*units):
    out = {}
    for unit, power in units:
        for name, own in dimension(unit).items():
            out[name] = out.get(name, 0) + power * own
    return {name: power for name, power in out.items() if power}


OWN = {"linear": 1, "absolute": 1, "above": 1, "below": 1, "beyond": 1, "square": 2, "signed_square": 2, "cube": 3,
       "lag": 1, "second_order": 1}  # fmt: skip


@pytest.mark.parametrize("place", places_of(1), ids=lambda place: f"{place.name} {place.joint or ''}")
def test_amplitude_times_function_is_an_error_of_the_place(place):
    terms = terms_at(place, variables_of(1), lambda variable: np.linspace(-1.0, 1.0, 50))
    for term in {(t.function, t.variables): t for t in terms}.values():
        law = candidate_of(place, term, 1.0, 1)
        amplitudes = [1.0] * len(law.parameters)
        units = units_of(law, physical(law, np.array(amplitudes), term.numbers))
        for k, axis in enumerate(place.axes):
            end = f"_{axis.replace(' ', '_')}" if axis and not term.of.parts else ""
            error = place.units[k] if place.units else place.unit
            first = units.get(f"amplitude{end}", units.get(f"at_knot_1{end}"))
            function = [(term.of.unit, OWN.get(term.function, 0)), ("s", -1 if term.function == "lag" else 0)]
            function += [] if term.times is None else [(term.times.unit, 1)]
            assert times((first, 1), *function) == dimension(error), (term, first)
            if f"offset{end}" in units:
                assert units[f"offset{end}"] == error


def test_moments_are_not_forces():
    force = next(place for place in places_of(1) if place.name == "force on payload")
    law = candidate_of(force, Term("linear", TIME), 1.0, 1)
    units = units_of(law, ["amplitude_force_z", "amplitude_moment_x"])
    assert units == {"amplitude_force_z": "N/s", "amplitude_moment_x": "N m/s"}


def test_numbers_inside():
    torque = next(place for place in places_of(1) if place.name == "tau reading")
    tau = joint_variable("tau", 1, 1)
    for term in [*of_own(tau, np.linspace(-1.0, 1.0, 50)), *of_time()]:
        law = candidate_of(torque, term, 1.0, 1)
        units = units_of(law, term.numbers)
        assert all(
            units[name] == "N m" for name in term.numbers if name in ("knee", "half_width", "low", "step")
        )
        assert units.get("time_s", "s") == "s"
    up = payload_variable("payload_up", "x")
    law = candidate_of(torque, Term("second_order", up, {"frequency_hz": 1.0, "damping": 0.1}), 1.0, 1)
    assert units_of(law, ["amplitude", "frequency_hz", "damping"]) == {
        "amplitude": "N m", "frequency_hz": "Hz", "damping": "",
    }  # fmt: skip
