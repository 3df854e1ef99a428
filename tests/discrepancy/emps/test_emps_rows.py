"""From samples to rows: cycles, blocks, pulses in a residual, traces of causes against what they do in simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.candidate import Candidate, Parameter
from discrepancy.emps.blocks import blocks, period_of
from discrepancy.emps.catalogue import candidate_of
from discrepancy.emps.causes import CAUSES
from discrepancy.emps.causes.train import in_step
from discrepancy.emps.noise import repeated
from discrepancy.emps.pulse_search import pulse_train, rectangle
from discrepancy.emps.recording.axis_log import AxisLog
from discrepancy.emps.recording.signals import Signals, at_delay
from discrepancy.emps.reduction import Reduction
from discrepancy.emps.rig import EmpsRig
from discrepancy.engine.block_errors import with_block_errors
from discrepancy.engine.explanation import explain
from discrepancy.inference.search import search
from discrepancy.least_squares.block_errors import block_covariance
from discrepancy.least_squares.fit import Fit
from discrepancy.least_squares.problem import Problem
from discrepancy.rig import Rows
from emps_errors import bootstrap
from emps_made import CYCLE_S, CYCLES, GAIN, RATE_HZ, nominal, recorded, reference
from estimator.errors import InputError
from mocobot_sim.emps.effects import AxisEffect, apply_effects
from mocobot_sim.emps.plant import Plant, PulseTrain, Ripple

PERIOD = round(CYCLE_S * RATE_HZ)


@pytest.fixture(scope="module")
def clean() -> EmpsRig:
    return EmpsRig.of(recorded(replace(nominal(), mass_kg=95.0)))


# Cycles and blocks.


def test_period_of_a_repeated_reference() -> None:
    assert period_of(reference(), RATE_HZ) == PERIOD
    assert period_of(reference(2), RATE_HZ) == PERIOD


def test_no_period_without_a_repetition() -> None:
    assert period_of(reference(1), RATE_HZ) is None
    rng = np.random.default_rng(0)
    assert period_of(np.cumsum(np.cumsum(rng.standard_normal(5000))), RATE_HZ) is None
    assert period_of(np.ones(5000), RATE_HZ) is None


def test_blocks_are_cycles_that_begin_in_steady_motion(clean: EmpsRig) -> None:
    cut, v, a = clean.blocks, clean.signals.v, clean.signals.a
    assert len(cut) == CYCLES
    assert [b.stop for b in cut[:-1]] == [b.start for b in cut[1:]]
    lengths = np.array([b.stop - b.start for b in cut])
    assert np.all(np.abs(lengths - PERIOD) < 0.2 * PERIOD)
    for b in cut:
        assert abs(v[b.start]) > 0.3 * np.sqrt(np.mean(v**2))
        assert abs(a[b.start]) < 0.1 * np.abs(a).max()


def test_without_cycles_blocks_are_even() -> None:
    log = clean_log(np.cumsum(0.05 + 0.02 * np.sin(np.arange(20000) / 700.0)) * 1e-3)
    cut = blocks(Signals.of(log), None)
    assert len(cut) == 3
    assert max(b.stop - b.start for b in cut) < 1.2 * min(b.stop - b.start for b in cut)


def clean_log(x: np.ndarray) -> AxisLog:
    time = np.arange(len(x)) / RATE_HZ
    return AxisLog("x.mat", time, x, x, np.zeros(len(x)), GAIN, 160.0, 240.0, np.ones(len(x), dtype=bool))


def test_other_motion_on_the_same_reference_does_not_repeat(clean: EmpsRig) -> None:
    assert repeated(clean.signals, PERIOD)
    pushed = clean.log.position + 2e-4 * (clean.log.time > 3.0)
    assert not repeated(Signals.of(replace(clean.log, position=pushed)), PERIOD)
    assert not repeated(clean.signals, None)


def test_rows_keep_away_from_ends_and_from_what_is_unusable(clean: EmpsRig) -> None:
    usable = clean.log.usable.copy()
    usable[3000:3200] = False
    rig = EmpsRig.of(replace(clean.log, usable=usable))
    for block, rows in zip(rig.blocks, rig.reduction.samples, strict=True):
        assert rows.min() - block.start >= 50
        assert block.stop - rows.max() >= 50
    rows = np.concatenate(rig.reduction.samples)
    assert not np.any((rows > 2950) & (rows < 3250))
    # What happens there does not matter any more.
    spoilt = clean.signals.residual.copy()
    spoilt[3010:3190] += 1e6
    for a, b in zip(rig.reduction(spoilt), rig.reduction(clean.signals.residual), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


def test_reduction_passes_a_slow_sine_and_stops_a_fast_one(clean: EmpsRig) -> None:
    time = clean.log.time
    for frequency, gain in ((2.0, 1.0), (10.0, 1.0), (40.0, 0.5), (150.0, 0.0)):
        wave = np.sin(2 * np.pi * frequency * time)
        rows = np.concatenate(clean.reduction(wave))
        at = np.concatenate(clean.reduction.samples)
        np.testing.assert_allclose(rows, gain * wave[at], atol=0.02)


def test_a_recording_without_long_enough_parts_is_refused(clean: EmpsRig) -> None:
    usable = clean.log.usable.copy()
    usable[::120] = False
    with pytest.raises(InputError, match="long enough"):
        EmpsRig.of(replace(clean.log, usable=usable))


# Pulses.


@pytest.mark.parametrize(
    "train",
    [
        PulseTrain(0.344, 1.0, 0.5, 5.0),
        PulseTrain(0.05, 0.73, 0.11, -2.0),
        PulseTrain(-0.3, 1.7, 1.2, 1.0),
        PulseTrain(1.0, 1.5, 0.2, 0.5),
    ],
    ids=["benchmark", "short", "on already", "late"],
)
def test_pulses_are_found_to_the_sample(train: PulseTrain) -> None:
    time = np.arange(12000) / RATE_HZ
    rng = np.random.default_rng(1)
    residual = train.size * train.on(time) + 0.05 * rng.standard_normal(len(time))
    residual += 0.05 * np.sin(2 * np.pi * time / 3.1)
    found = pulse_train(residual, RATE_HZ)
    np.testing.assert_array_equal(rectangle(time, *found[:3]), train.on(time))
    assert found.period_s == pytest.approx(train.period_s, abs=1e-6)
    assert found.size == pytest.approx(train.size, abs=0.05)


def test_the_train_that_is_found_does_not_hang_on_rounding() -> None:
    """In noise any train fits badly; a box and what is between its boxes fit equally, and look different sharpened."""
    for seed in range(2):
        rng = np.random.default_rng(seed)
        residual = np.convolve(rng.standard_normal(7200), np.ones(30) / 30, mode="same")
        found = pulse_train(residual, RATE_HZ)
        for _ in range(4):
            disturbed = residual * (1.0 + 1e-12 * rng.standard_normal(len(residual)))
            np.testing.assert_allclose(pulse_train(disturbed, RATE_HZ), found, rtol=1e-9)


def test_trains_in_step_with_the_motion_are_where_a_train_is_on() -> None:
    time, cycle = np.arange(7200) / RATE_HZ, 2.4
    near = {"start_s": -0.007, "period_s": 2.3824, "width_s": 0.06}
    places = np.unique(np.round(time[rectangle(time, **near) > 0.5] % cycle, 3))
    shapes = in_step(time, cycle, near)
    assert {s["period_s"] for s in shapes} == {cycle}
    assert {round(s["width_s"], 9) for s in shapes} == {0.02, 0.04, 0.06}
    for shape in shapes:
        on = np.round(time[rectangle(time, **shape) > 0.5] % cycle, 3)
        assert len(on) == pytest.approx(3 * RATE_HZ * shape["width_s"], abs=3)
        # A step of the places is a sixth of a pulse.
        assert np.abs(on[:, None] - places).min(axis=1).max() <= 0.01
    often = in_step(time, cycle, near | {"period_s": 0.7})
    assert {round(s["period_s"], 9) for s in often} == {2.4, 0.8}


def test_rectangle_counts_samples_exactly() -> None:
    on = rectangle(np.arange(3000) / RATE_HZ, 0.344, 1.0, 0.5)
    assert np.flatnonzero(np.diff(on)).tolist() == [343, 843, 1343, 1843, 2343, 2843]


# Traces.


def with_cause(plant: Plant, name: str, values: np.ndarray, shape: dict[str, float]) -> Plant:
    named = dict(zip(CAUSES[name].parameters, values.tolist(), strict=True))
    return apply_effects(plant, [AxisEffect(name, named | shape)])


def test_shift_of_a_signal() -> None:
    time = np.arange(2000) / RATE_HZ
    late = at_delay(np.sin(7.0 * time), RATE_HZ, 3.3e-3)
    np.testing.assert_allclose(late[10:], np.sin(7.0 * (time[10:] - 3.3e-3)), atol=1e-9)


CASES = {
    "mass": (np.array([-5.0]), {}),
    "viscous_friction": (np.array([150.0]), {}),
    "asymmetric_viscous": (np.array([-40.0]), {}),
    "force_offset": (np.array([3.0]), {}),
    "position_force": (np.array([1.0, -2.0]), {"wavelength_m": 2.5e-3}),
    "delay": (np.array([6e-4]), {}),
    "position_gain": (np.array([4.0]), {}),
    "velocity_gain": (np.array([-8.0]), {}),
    "velocity_lag": (np.array([1.2e-3]), {}),
    "injected_voltage": (np.array([1.0]), {"start_s": 0.3, "period_s": 0.7, "width_s": 0.3}),
    "injected_force": (np.array([15.0]), {"start_s": 0.3, "period_s": 0.7, "width_s": 0.3}),
    "push": (np.array([10.0]), {"start_s": 3.1, "duration_s": 0.4}),
    "coulomb_friction": (np.array([15.0]), {"slow_mps": 1e-3}),
    "asymmetric_coulomb": (np.array([4.0]), {"slow_mps": 1e-3}),
    "stribeck": (np.array([10.0]), {"speed_mps": 0.04}),
}


def test_every_cause_but_play_has_a_case() -> None:
    assert set(CASES) == set(CAUSES) - {"backlash"}


@pytest.mark.parametrize("name", CASES)
def test_trace_takes_out_what_the_simulation_puts_in(name: str) -> None:
    """Rows of a simulated recording with the cause, less its trace, are as small as without any cause."""
    values, shape = CASES[name]
    friction = name in ("asymmetric_coulomb", "stribeck")
    start = replace(nominal(), coulomb_N=(15.0, 15.0)) if friction else nominal()
    signals = Signals.of(recorded(with_cause(start, name, values, shape)))
    reduction = Reduction.of(RATE_HZ, blocks(signals, PERIOD), signals.log.usable)
    residual = signals.residual
    if friction:
        residual = residual - CAUSES["coulomb_friction"].exact(signals, np.array([15.0]), {"slow_mps": 1e-3})
    trace = CAUSES[name].exact(signals, values, shape)
    before, after = (np.concatenate(reduction(x)) for x in (residual, residual - trace))
    # Dry friction is left out where the axis turns round: there it is what keeps it at rest.
    speed = np.abs(signals.v[np.concatenate(reduction.samples)])
    moving = speed > (0.02 if friction or name == "coulomb_friction" else -1.0)
    channel = 1 if CAUSES[name].where == "loop" else 0
    rms = [np.sqrt(np.mean(x[moving, channel] ** 2)) for x in (before, after)]
    assert rms[1] < (0.45, 2e-3)[channel]
    assert rms[1] < 0.5 * rms[0]
    # The other channel knows nothing of it.
    np.testing.assert_allclose(before[:, 1 - channel], after[:, 1 - channel], atol=1e-9)


@pytest.mark.parametrize("name", ["delay", "velocity_lag"])
def test_exact_trace_begins_as_the_linear_one(clean: EmpsRig, name: str) -> None:
    cause, small = CAUSES[name], np.array([1e-6])
    linear = cause.columns(clean.signals, {}) @ small
    exact = cause.exact(clean.signals, small, {})
    assert np.abs(exact - linear)[200:-200].max() < 0.02 * np.abs(linear).max()


def test_whitened_noise_is_white_and_of_unit_size() -> None:
    """Two recordings of one motion differ by their noise: whitened by the first, of unit variance and little memory."""
    plant = replace(nominal(), coulomb_N=(15.0, 15.0))
    rig = EmpsRig.of(recorded(plant, seed=4))
    assert rig.noise.repeats == CYCLES
    other = rig.reduction(Signals.of(recorded(plant, seed=5)).residual)
    apart = [(a - b) / np.sqrt(2.0) for a, b in zip(rig.reduction(rig.signals.residual), other, strict=True)]
    z = [white(x) for white, x in zip(rig.whitening, apart, strict=True)]
    size = np.mean(np.concatenate(z) ** 2, axis=0)
    assert np.all((size > 0.5) & (size < 2.0))
    for x in z:
        memory = np.mean(x[1:] * x[:-1], axis=0) / np.mean(x**2, axis=0)
        assert np.all(np.abs(memory) < 0.4)


def test_a_rig_is_linear_in_its_causes(clean: EmpsRig) -> None:
    causes = [candidate_of(n, clean.hints) for n in ("mass", "viscous_friction", "position_gain")]
    values = [np.array([3.0]), np.array([20.0]), np.array([1.0])]
    rows = clean.rows(causes)
    left = clean.residual(np.zeros(0), [], list(zip(causes, values, strict=True)))
    for t, trial in enumerate(rows):
        expected = trial.residual - sum(c @ v for c, v in zip(trial.causes, values, strict=True))
        np.testing.assert_allclose(left[t], expected, atol=1e-9)


def test_negative_friction_and_invisible_play_cannot_be(clean: EmpsRig) -> None:
    friction = candidate_of("coulomb_friction", clean.hints)
    assert clean.possible(friction, np.array([-0.1]), np.array([[1.0]]))
    assert not clean.possible(friction, np.array([-5.0]), np.array([[1.0]]))
    play = candidate_of("backlash", clean.hints)
    assert not clean.possible(play, np.array([4e-7]), np.array([[1e-16]]))  # two steps of the encoder
    assert clean.possible(play, np.array([4e-5]), np.array([[1e-16]]))


def test_coarse_positions_hide_what_needs_their_derivatives() -> None:
    log = recorded(replace(nominal(), coulomb_N=(15.0, 15.0), mass_kg=95.0))
    step = 6e-5
    rig = EmpsRig.of(replace(log, position=np.round(log.position / step) * step))
    names = {c.cause for c in rig.candidates()}
    assert "mass" not in names
    assert {"coulomb_friction", "injected_voltage"} <= names
    assert any("rounding hides" in note for note in rig.log.notes)


def test_unknown_cause_is_refused(clean: EmpsRig) -> None:
    with pytest.raises(InputError, match="wobble"):
        EmpsRig.of(clean.log, excluded=["wobble"])


def test_ripple_is_where_a_search_begins() -> None:
    log = recorded(replace(nominal(), ripples=(Ripple(4e-3, 2.0, 1.0),)))
    assert EmpsRig.of(log).hints.wavelength_m == pytest.approx(4e-3, rel=0.02)


# Standard errors.


def correlated(rng: np.random.Generator, phi: float, trials: int = 4, n: int = 500) -> Problem:
    """Two causes with slow columns, and noise of unit variance with memory phi, twice as loud as believed."""
    parameters = (Parameter("x", 0.0, 1.0),)
    causes = tuple(Candidate(name, name, None, None, parameters) for name in "ab")

    def slow(shape: tuple[int, ...]) -> np.ndarray:
        x = rng.standard_normal(shape)
        for k in range(1, shape[0]):
            x[k] = phi * x[k - 1] + np.sqrt(1.0 - phi**2) * x[k]
        return x

    rows = []
    for t in range(trials):
        columns = [slow((n, 2))[..., None] for _ in causes]
        residual = 2.0 * slow((n, 2)) + 1.5 * columns[0][..., 0]
        none = np.zeros((n, 2, 0))
        rows.append(Rows(f"trial {t}", residual, none, none, columns, np.arange(n) / 100.0))
    return Problem.of(rows, causes)


@pytest.mark.parametrize("phi", [0.0, 0.9])
def test_block_errors_are_the_scatter_of_many_data_sets(phi: float) -> None:
    values, block, naive = [], [], []
    for seed in range(120):
        fit = Fit.of(correlated(np.random.default_rng(seed), phi, trials=2, n=300), [0, 1])
        values.append(fit.solution)
        block.append(np.diag(block_covariance(fit, 50)))
        naive.append(np.diag(fit.covariance))
    scatter = np.std(values, axis=0)
    np.testing.assert_allclose(np.sqrt(np.mean(block, axis=0)), scatter, rtol=0.2)
    assert np.all(np.sqrt(np.mean(naive, axis=0)) < 0.6 * scatter)


def test_block_errors_are_those_of_a_bootstrap() -> None:
    fit = Fit.of(correlated(np.random.default_rng(5), 0.8), [0, 1])
    drawn = bootstrap(fit, 50, np.random.default_rng(0), draws=800)
    np.testing.assert_allclose(np.sqrt(np.diag(block_covariance(fit, 50))), drawn, rtol=0.15)


def test_a_transient_keeps_an_error() -> None:
    rig = EmpsRig.of(recorded(with_cause(nominal(), "push", *CASES["push"])))
    explanation = with_block_errors(explain(search(rig, 3)), 100)
    (found,) = explanation.found
    assert found.candidate.cause == "push"
    assert found.values[0] == pytest.approx(10.0, abs=1.0)
    assert 0.05 < np.sqrt(found.covariance[0, 0]) < 2.0
