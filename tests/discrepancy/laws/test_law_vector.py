"""A law by all components of a signal: a load that slides on a spring, in whatever direction, is one."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import chirp

from discrepancy.laws.candidate import candidate_of
from discrepancy.laws.dictionary import terms_at
from discrepancy.laws.said.numbers import physical, report
from discrepancy.laws.said.pieces import pieces_of
from discrepancy.laws.said.sentence import sentence
from discrepancy.laws.said.trace import traces_of
from discrepancy.laws.term import Term
from discrepancy.laws.where import Located
from discrepancy.team.laws.places import places_of
from discrepancy.team.laws.variables import payload_felt, variables_of
from mocobot_sim.laws.functions import FUNCTIONS, Inside

RATE_HZ, LOAD_KG, SPRING_HZ, DAMPING = 100.0, 0.45, 1.3, 0.7
ALONG = np.array([0.6, -0.7, np.sqrt(1.0 - 0.36 - 0.49)])
POINT = np.array([0.3, 0.5, -0.1])
CENTRE = next(place for place in places_of(1) if place.name == "payload centre")
INSIDE = {"frequency_hz": SPRING_HZ, "damping": DAMPING}


@pytest.fixture(scope="module")
def signals():
    """At rest before, then shaken and turned up to 3 Hz; at the origin of {1}, by name."""
    t = np.arange(0.0, 12.0, 1.0 / RATE_HZ)
    shaken = chirp(t[:, None] + [0.0, 0.4, 0.9, 1.7, 2.6, 3.1], 0.2, 12.0, 3.0) * [
        0.7,
        0.4,
        0.2,
        0.8,
        0.5,
        0.6,
    ]
    both = np.array([0.3, -0.2, 9.8, 0.0, 0.0, 0.0]) + np.minimum(t, 1.0)[:, None] * shaken
    names = [f"payload_{kind}_{axis}" for kind in ("felt", "turn") for axis in "xyz"]
    return dict(zip(names, both.T, strict=True))


@pytest.fixture(scope="module")
def law():
    return candidate_of(CENTRE, Term("second_order", payload_felt(), INSIDE), 1.0, 1)


@pytest.fixture(scope="module")
def columns(law, signals):
    return law.term.values(lambda variable: signals[variable.name], RATE_HZ)


@pytest.fixture(scope="module")
def shifted(signals):
    """First moment of the load on its spring, integrated: it falls back behind what is felt where it sits."""
    felt, turn = (
        np.stack([signals[f"payload_{kind}_{axis}"] for axis in "xyz"], axis=1) for kind in ("felt", "turn")
    )
    time, omega = np.arange(len(felt)) / RATE_HZ, 2.0 * np.pi * SPRING_HZ
    drive = -(felt + np.cross(turn, POINT)) @ ALONG

    def rate(t, x):
        return [x[1], np.interp(t, time, drive) - 2.0 * DAMPING * omega * x[1] - omega**2 * x[0]]

    solved = solve_ivp(
        rate, (0.0, time[-1]), [drive[0] / omega**2, 0.0], t_eval=time, rtol=1e-8, max_step=0.02
    )
    return LOAD_KG * solved.y[0][:, None] * ALONG


@pytest.fixture(scope="module")
def values(columns, shifted):
    """As they come out of least squares over the three components of the error."""
    return np.linalg.lstsq(columns, shifted, rcond=None)[0].ravel()


def test_a_load_on_a_spring_is_such_a_law(columns, shifted, values):
    np.testing.assert_allclose(columns @ values.reshape(-1, 3), shifted, atol=2e-3 * np.abs(shifted).max())


def test_its_numbers_are_direction_size_and_place_of_the_load(law, values):
    names = [p.name for p in law.parameters]
    assert names[:2] == ["amplitude_by_payload_felt_x_x", "amplitude_by_payload_felt_x_y"]
    assert names[-1] == "amplitude_by_payload_turn_z_z"
    found = physical(law, values, law.term.numbers)
    assert found["amplitude"] == pytest.approx(LOAD_KG / (2.0 * np.pi * SPRING_HZ) ** 2, rel=0.01)
    assert found["beside"] == pytest.approx(0.0, abs=0.01 * found["amplitude"])
    by = np.array([found[f"by_{axis}"] for axis in "xyz"])
    np.testing.assert_allclose(by, -ALONG, atol=0.01)  # the largest component is positive
    np.testing.assert_allclose([found[f"along_{axis}"] for axis in "xyz"], -by, atol=0.01)
    across = POINT - ALONG * (ALONG @ POINT)  # along its way it may sit anywhere
    np.testing.assert_allclose([found[f"lever_{axis}"] for axis in "xyz"], across, atol=0.01)
    assert {name: found[name] for name in INSIDE} == INSIDE


def test_it_is_said(law, values):
    covariance = 1e-10 * np.eye(len(values) + len(law.term.law.fitted))
    said = sentence(law, *report(law, values, covariance))
    assert "along (0.60, -0.70, 0.39) times what follows f along (-0.60, 0.70, -0.39)" in said
    assert "a load on a spring in the payload, of 0.45 kg" in said
    assert "across by 0 % of it" in said


def test_its_errors_are_those_of_many_noisy_ones(law, values):
    """Of amplitude, directions and place, by Monte Carlo."""
    rng, count = np.random.default_rng(5), len(values)
    root = 2e-5 * rng.standard_normal((count, count))
    padded = np.zeros((count + len(law.term.law.fitted),) * 2)
    padded[:count, :count] = root @ root.T
    se = report(law, values, padded)[1]
    drawn = [physical(law, values + root @ rng.standard_normal(count), law.term.numbers) for _ in range(4000)]
    for name in ("amplitude", "along_x", "along_z", "by_y", "lever_x"):
        assert np.std([one[name] for one in drawn]) == pytest.approx(se[name], rel=0.08)


def test_the_simulator_adds_up_the_same(law, signals, columns, values):
    added = {target: 0.0 for target in CENTRE.targets}
    for piece in pieces_of(law, values):
        step = FUNCTIONS[piece.function](Inside(piece.number, piece.second, piece.phase_rad, 1.0 / RATE_HZ))
        parts = (part.split("*") for part in piece.of.split(" + "))
        of = sum(float(factor) * signals[name] for factor, name in parts)
        added[piece.target] += piece.amplitude * np.array([step(x) for x in of])
    assert len(pieces_of(law, values)) == 3, "one direction of the error, of one sum of signals"
    wanted = columns @ values.reshape(-1, 3)
    simulated = np.stack(list(added.values()), axis=1)
    np.testing.assert_allclose(simulated, wanted, atol=0.03 * np.abs(wanted).max())


def test_where_it_is_tried():
    """Where the components are those of one vector; a force beside its moment is none."""
    for place in places_of(1):
        terms = terms_at(place, variables_of(1), lambda variable: np.linspace(-1.0, 1.0, 50))
        tried = {term.function for term in terms if term.of.parts}
        assert tried == ({"linear", "second_order"} if place == CENTRE else set())


def test_its_numbers_are_those_of_its_shape(law):
    """A finer frequency had been written into the verdict, and the columns had kept the coarse one."""
    finer = {"frequency_hz": 1.5, "damping": 0.65}
    moved = law.in_shape(finer)
    assert moved.shape == moved.term.numbers == finer
    assert law.shape == law.term.numbers == INSIDE


@pytest.mark.parametrize(("apart_s", "shown"), [(0.1, True), (1.2, False)])
def test_what_was_located_is_shown_where_its_knots_are_close_enough(law, signals, values, apart_s, shown):
    """Shaken at 3 Hz, straight lines between knots of 1.2 s would be anything."""
    samples = len(signals["payload_felt_x"])
    knots = np.arange(0.0, samples / RATE_HZ, apart_s)
    error = np.zeros((len(knots), 3))
    located = Located(CENTRE, 100.0, (error,), (error + 1.0,), (knots,))
    bench = SimpleNamespace(
        length=lambda trial: samples, rate_hz=lambda trial: RATE_HZ,
        row_times=lambda trial: np.array([0.0, samples / RATE_HZ]),
        values=lambda trial, law: law.term.values(lambda v: signals[v.name], RATE_HZ),
        signal=lambda trial, variable: signals[variable.name],
    )  # fmt: skip
    traces = traces_of(law, values, [located], bench)
    assert bool(traces) == shown
    if shown:
        along = sum(
            values * signals[f"payload_felt_{axis}"] for values, axis in zip(-ALONG, "xyz", strict=True)
        )
        wanted = np.interp(knots, np.arange(samples) / RATE_HZ, along)
        np.testing.assert_allclose(traces[0]["signal"], wanted, atol=0.05)
