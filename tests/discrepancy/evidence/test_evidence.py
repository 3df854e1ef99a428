"""Evidence, gains and covariances of the linear problem against densities computed directly and against scatter."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import dct
from scipy.stats import multivariate_normal

from discrepancy.evidence.cells import Bands, Cells, Columns
from discrepancy.evidence.posterior import Group, Posterior, prior_root

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


def test_members_of_a_kind_share_half_of_their_variance() -> None:
    group = Group("c", "all", (5, 6, 7, 8), (1.0, 2.0, 3.0, 4.0), members=((5, 6), (7, 8)))
    root = prior_root(group)
    S = np.diag([1.0, 2.0, 3.0, 4.0])
    alike = np.array([[1, 0, 0.5, 0], [0, 1, 0, 0.5], [0.5, 0, 1, 0], [0, 0.5, 0, 1]])
    assert root @ root.T == pytest.approx(S @ alike @ S)


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


def test_weighted_residual_gives_the_scores_of_columns(rng: np.random.Generator) -> None:
    cells, _, _ = problem(rng)
    p = Posterior(cells, np.array([0.5, 0.0, 2.0, 0.0]), rng.uniform(0.3, 2.0, (2, 3)))
    series = [rng.standard_normal(n) for n in LENGTHS]
    score = cells.weighted_residual(p.mean, p.variance)
    expected = sum(float(x @ z[:, 1]) for x, z in zip(series, score, strict=True))
    (k,) = cells.add([{1: series}])
    wider = Posterior(cells, np.append(p.prior, 0.0), p.variance)
    assert wider._conditional[1][k] == pytest.approx(expected, rel=1e-9)


def test_columns_that_are_taken_away_leave_the_problem_as_it_was(rng: np.random.Generator) -> None:
    cells, _, _ = problem(rng)
    prior, variance = np.ones(4), np.ones((2, 3))
    before = Posterior(cells, prior, variance).log_evidence
    cells.add([{0: [rng.standard_normal(n) for n in LENGTHS]}])
    assert Posterior(cells, np.ones(5), variance).log_evidence != before
    cells.truncate(4)
    assert Posterior(cells, prior, variance).log_evidence == before


def test_columns_without_their_zeros_are_the_columns(rng: np.random.Generator) -> None:
    """Joined, taken apart, and in the problem; a column without rows keeps its prior variance."""
    cells, _, X = problem(rng)
    wide = np.stack([np.column_stack([x, np.zeros(len(x))]) for x in X]).astype(np.float32)
    narrow = Columns.joined([Columns.of(wide[..., :2]), Columns.of(wide[..., 2:])])
    assert [len(at) for at in narrow.at] == [4, 3]  # the first column is in one channel
    np.testing.assert_array_equal(narrow.dense, wide)
    np.testing.assert_array_equal(narrow.part(slice(1, 4)).dense, wide[..., 1:4])
    cells.truncate(0)
    assert cells.add_rows(narrow) == list(range(5))
    prior, variance = np.full(5, 0.7), rng.uniform(0.3, 2.0, (2, 3))
    weights = [
        np.repeat(1.0 / v, np.diff(c.starts))[:, None] for v, c in zip(variance, cells.channels, strict=True)
    ]
    G = sum(x.T @ (w * x) for x, w in zip(wide.astype(float), weights, strict=True))
    expected = np.diag(np.linalg.inv(G + np.eye(5) / 0.7))
    found = Posterior(cells, prior, variance)
    np.testing.assert_allclose(found.variances, expected, rtol=1e-9)
    assert found.variances[4] == pytest.approx(0.7)


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


def test_squares_explained_are_those_of_the_covariance_also_where_columns_came_later(
    rng: np.random.Generator,
) -> None:
    cells, _, _ = problem(rng)
    p = Posterior(cells, np.array([0.5, 0.0, 2.0, 0.1]), rng.uniform(0.3, 2.0, (2, 3)))
    expected = p.covariance
    cells.add([{1: [rng.standard_normal(n) for n in LENGTHS]}])
    assert p.variances == pytest.approx(np.diag(expected), rel=1e-10)
    mean, wide = np.append(p.mean, 0.0), np.pad(expected, ((0, 1), (0, 1)))
    for found, full in zip(p.left, cells.left(mean, wide), strict=True):
        assert found == pytest.approx(full, rel=1e-10)


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
