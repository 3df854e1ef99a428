"""Filled gaps against polynomials, sines and noise."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from mocobot_logs.resample_filter import Merger, fill_gaps

EVERY_M = [1, 2, 3, 5, 12, 49]


def with_gap(missing: int, around: int = 120, jitter: float = 0.0, seed: int = 0):
    """Times of samples one unit apart with one gap in the middle; the gap's length per interval."""
    rng = np.random.default_rng(seed)
    time = np.r_[np.arange(around), np.arange(around, 2 * around) + missing].astype(float)
    time += jitter * rng.uniform(-1, 1, len(time))
    holes = np.zeros(len(time) - 1, np.int64)
    holes[around - 1] = missing
    return time, holes


def filled_part(time, values, holes, missing):
    at, out = fill_gaps(time, values, holes)
    assert np.all(np.diff(at) > 0)
    inside = ~np.isin(at, time)
    assert inside.sum() == missing
    np.testing.assert_array_equal(out[~inside], values)
    return at[inside], out[inside]


@pytest.mark.parametrize("missing", EVERY_M)
def test_polynomials_of_degree_seven_are_met(missing):
    time, holes = with_gap(missing, jitter=0.2)
    curves = [Polynomial(np.random.default_rng(k).normal(size=8), domain=[0, time[-1]]) for k in range(3)]
    at, out = filled_part(time, np.stack([c(time) for c in curves], axis=1), holes, missing)
    np.testing.assert_allclose(out, np.stack([c(at) for c in curves], axis=1), rtol=0, atol=1e-9)
    edges = time[119:121]
    np.testing.assert_allclose(at, np.linspace(*edges, missing + 2)[1:-1], rtol=1e-12)


@pytest.mark.parametrize(
    ("missing", "hertz", "most"), [(1, 1.0, 5e-12), (5, 1.0, 1e-8), (1, 5.0, 1.5e-6), (5, 5.0, 3.5e-3)]
)
def test_sines_at_100_hz(missing, hertz, most):
    time, holes = with_gap(missing)
    wave = np.exp(2j * np.pi * hertz / 100 * time)
    at, out = filled_part(time, np.stack([wave.real, wave.imag], axis=1), holes, missing)
    error = np.abs(out @ [1, 1j] - np.exp(2j * np.pi * hertz / 100 * at))
    assert 0.1 * most < error.max() < most


@pytest.mark.parametrize("missing", EVERY_M)
def test_noise_does_not_grow_with_the_gap(missing):
    """Unit impulses at every sample give the weights, whose root sum of squares is the gain of white noise."""
    time, holes = with_gap(missing)
    weights = filled_part(time, np.eye(len(time)), holes, missing)[1]
    gain = np.sqrt(np.sum(weights**2, axis=1)).max()
    assert 0.5 < gain < 1.9
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-9)


def test_gaps_at_the_ends_and_of_many_lengths_at_once():
    rng = np.random.default_rng(1)
    full = np.arange(400.0)
    gone = np.r_[1, 5:7, 100:103, 110, 200:206, 397:399]
    time = np.delete(full, gone)
    signal = np.sin(0.06 * full[:, None] + rng.uniform(0, 6, 4))
    at, out = fill_gaps(time, np.delete(signal, gone, axis=0), np.diff(time).astype(np.int64) - 1)
    np.testing.assert_allclose(at, full, rtol=0, atol=1e-12)
    np.testing.assert_allclose(out, signal, rtol=0, atol=1e-6)


@pytest.mark.parametrize("cuts", [[], [3], [2, 3, 4, 5, 6, 7], [6]])
def test_crowding_rows_become_their_mean(cuts):
    time = np.array([0, 100, 190, 210, 225, 300, 400, 401], np.int64)
    values = np.arange(16.0).reshape(8, 2) ** 2
    merger = Merger(period_ns=100.0)
    parts = [merger.push(t, v) for t, v in zip(np.split(time, cuts), np.split(values, cuts), strict=True)]
    at, out = (np.concatenate(x) for x in zip(*parts, merger.finish(), strict=True))
    np.testing.assert_array_equal(at, [0, 100, 208, 300, 400])  # whole nanoseconds, rounded down
    expected = [values[0], values[1], values[2:5].mean(axis=0), values[5], values[6:].mean(axis=0)]
    np.testing.assert_allclose(out, expected, rtol=1e-15)
    assert merger.merged == 3
