"""Laws in words."""

import numpy as np
import pytest

from discrepancy.laws.candidate import candidate_of
from discrepancy.laws.dictionary import terms_at
from discrepancy.laws.said.numbers import report
from discrepancy.laws.said.sentence import sentence
from discrepancy.laws.term import Term
from discrepancy.team.laws.places import places_of
from discrepancy.team.laws.variables import payload_variable, variables_of


def said(place, term):
    law = candidate_of(place, term, 1.0, 1)
    count = len(law.parameters)
    every = count + len(term.law.fitted)
    return sentence(law, *report(law, np.linspace(0.5, 1.0, count), 0.01 * np.eye(every)))


@pytest.mark.parametrize("place", places_of(2), ids=lambda place: f"{place.name} {place.robot} {place.joint}")
def test_every_law_that_is_tried_can_be_said(place):
    """Of a vector's components none is the amplitude: a base displaced by a share of where the payload is."""
    every = variables_of(2)
    terms = terms_at(place, every, lambda variable: np.linspace(-1.0, 1.0, 50))
    for term in {(t.function, t.variables): t for t in terms}.values():
        assert said(place, term).endswith(".")


def test_a_displacement_by_a_displacement_has_three_shares():
    place = next(one for one in places_of(1) if one.name == "base position")
    words = said(place, Term("linear", payload_variable("payload_position", "y")))
    assert "contains" not in words
    assert all(f"{axis} {size}" in words for axis, size in (("x", "0.5"), ("y", "0.75"), ("z", "1")))


def test_a_reading_that_takes_in_another_says_the_share():
    tau = [place for place in places_of(1) if place.name == "tau reading"]
    other = next(v for v in variables_of(1) if v.name == "tau_1_2")
    assert "contains 50" in said(tau[0], Term("linear", other))
