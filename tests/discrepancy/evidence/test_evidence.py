"""Evidence, gains and covariances of the linear problem against densities computed directly and against scatter."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import dct
from scipy.stats import multivariate_normal

from discrepancy.evidence.cells import Bands, Cells
from discrepancy.evidence.posterior import Group, Posterior

RATE_HZ, LENGTHS, EDGES_HZ = 20.0, (60, 41), np.array([0.0, 1.0, 2.5, 6.0])
BANDS = Bands([RATE_HZ, RATE_HZ], LENGTHS, EDGES_HZ)


def problem(rng: np.random.Generator, columns: int = 4) -> tuple[Cells, list[np.ndarray], list[np.ndarray]]:
    """Two channels and two trials; the rows and columns of each channel besides, made here."""
    residual = [rng.standard_normal((n, 2)) for n in LENGTHS]
    cells = Cells.of(BANDS, residual)
    series = [
        {c: [rng.standard_normal(n) for n in LENGTHS] for c in ((0, 1) if k else (0,))}
        for k in range(columns)
    ]
    assert cells.add(series) == list(range(columns))

    def rows(of: list[np.ndarray]) -> np.ndarray:
        """Coefficients below the last edge, band after band."""
        parts = []
        for n, x in zip(LENGTHS, of, strict=True):
            f = np.arange(n) * RATE_HZ / (2 * n)
            parts.append((np.searchsorted(EDGES_HZ, f, side="right") - 1, dct(x, norm="ortho"), f))
        band, x, f = (np.concatenate(p) for p in zip(*parts, strict=True))
        keep = f < EDGES_HZ[-1]
        return x[keep][np.argsort(band[keep], kind="stable")]

    y = [rows([r[:, c] for r in residual]) for c in range(2)]
    zero = [np.zeros(n) for n in LENGTHS]
    X = [np.column_stack([rows(list(s.get(c, zero))) for s in series]) for c in range(2)]
    return cells, y, X


def covariance_of_rows(
    cells: Cells, X: list[np.ndarray], prior: np.ndarray, variance: np.ndarray
) -> np.ndarray:
    """Dense covariance of all rows, channel after channel."""
    noise = np.concatenate(
        [np.repeat(v, np.diff(c.starts)) for v, c in zip(variance, cells.channels, strict=True)]
    )
    every = np.concatenate(X)
    return np.diag(noise) + (every * prior) @ every.T


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_evidence_is_the_density_of_the_rows(rng: np.random.Generator) -> None:
    cells, y, X = problem(rng)
    prior, variance = np.array([0.5, 0.0, 2.0, 0.1]), rng.uniform(0.3, 2.0, (2, 3))
    found = Posterior(cells, prior, variance).log_evidence
    dense = covariance_of_rows(cells, X, prior, variance)
    expected = multivariate_normal(cov=dense).logpdf(np.concatenate(y))
    assert found - 0.5 * len(dense) * np.log(2 * np.pi) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("columns", [(1,), (0, 3), (1, 2)])
def test_gain_is_the_difference_of_evidences(rng: np.random.Generator, columns: tuple[int, ...]) -> None:
    """Also of columns that have a variance already."""
    cells, _, _ = problem(rng)
    prior, variance = np.array([0.5, 0.0, 2.0, 0.1]), rng.uniform(0.3, 2.0, (2, 3))
    base = Posterior(cells, prior, variance)
    more = prior.copy()
    more[list(columns)] += 0.7**2
    expected = Posterior(cells, more, variance).log_evidence - base.log_evidence
    gain, scale = base.gain(Group("c", "p", columns, (0.7,) * len(columns)), octaves=1)
    assert gain == pytest.approx(expected, rel=1e-9)
    assert scale == 1.0


def test_what_cannot_be_negative_gains_where_it_is_positive(rng: np.random.Generator) -> None:
    """Evidence of a half-normal prior is the integral over the positive half."""
    cells, y, X = problem(rng, 2)
    variance = np.full((2, 3), 0.8)
    base = Posterior(cells, np.array([0.0, 0.0]), variance)
    gain, _ = base.gain(Group("c", "p", (1,), (0.5,), least=(0.0,)), octaves=1)
    grid = np.linspace(0.0, 4.0, 4001)
    rows, columns = np.concatenate(y), np.concatenate([x[:, 1] for x in X])
    log = -0.5 * np.sum((rows[:, None] - columns[:, None] * grid) ** 2 - rows[:, None] ** 2, axis=0) / 0.8
    density = 2.0 * np.exp(-0.5 * (grid / 0.5) ** 2) / np.sqrt(2 * np.pi) / 0.5
    expected = np.log(np.trapezoid(np.exp(log) * density, grid))
    assert gain == pytest.approx(expected, abs=2e-3)


def test_covariance_is_the_scatter_of_the_values() -> None:
    """Values drawn from the prior and noise from its variance: errors scatter as the covariance says."""
    rng = np.random.default_rng(11)
    prior, variance = np.array([1.0, 0.25]), np.array([[0.4, 1.0, 2.5]])
    n = 80
    bands = Bands([RATE_HZ], [n], EDGES_HZ)
    band = bands.of_trial(0)
    columns = [rng.standard_normal(n) for _ in prior]
    errors = []
    for _ in range(400):
        x = np.sqrt(prior) * rng.standard_normal(2)
        spectrum = np.zeros(n)
        spectrum[: len(band)] = np.sqrt(variance[0][band]) * rng.standard_normal(len(band))
        noise = dct(spectrum, type=3, norm="ortho")
        cells = Cells.of(bands, [(x @ np.array(columns) + noise)[:, None]])
        cells.add([{0: [c]} for c in columns])
        p = Posterior(cells, prior, variance)
        errors.append(np.linalg.solve(np.linalg.cholesky(p.covariance), p.mean - x))
    assert np.mean(np.square(errors), axis=0) == pytest.approx([1.0, 1.0], abs=0.25)
    assert abs(np.mean(np.prod(errors, axis=1))) < 0.15


def test_what_a_group_is_worth_is_the_difference_of_evidences(rng: np.random.Generator) -> None:
    cells, _, _ = problem(rng)
    prior, variance = np.array([0.5, 0.0, 2.0, 0.1]), rng.uniform(0.3, 2.0, (2, 3))
    less = np.array([0.5, 0.0, 0.0, 0.04])
    expected = Posterior(cells, prior, variance).log_evidence - Posterior(cells, less, variance).log_evidence
    assert Posterior(cells, prior, variance).worth([2, 3], less[[2, 3]]) == pytest.approx(expected, rel=1e-9)


def test_noise_is_learnt() -> None:
    rng = np.random.default_rng(5)
    n = 4000
    bands = Bands([RATE_HZ], [n], EDGES_HZ)
    true = np.array([0.5, 2.0, 9.0])
    spectrum = np.zeros(n)
    band = bands.of_trial(0)
    spectrum[: len(band)] = np.sqrt(true[band]) * rng.standard_normal(len(band))
    cells = Cells.of(bands, [dct(spectrum, type=3, norm="ortho")[:, None]])
    cells.add([{0: [rng.standard_normal(n)]} for _ in range(5)])
    p = Posterior(cells, np.full(5, 1e4), np.ones((1, 3)))
    for _ in range(5):
        p = Posterior(cells, p.prior, p.better_noise(np.ones((1, 3)), 0.0))
    assert p.variance[0] == pytest.approx(true, rel=0.15)
