"""Parts of logs predict each other: shared values by the others, each part's own by itself."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.evidence.cells import Bands, Cells
from discrepancy.evidence.parts import Parts
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.evidence.search import Chosen, State

RATE_HZ, ROWS = 20.0, 200
SHARED, OWN = 0.7, (5.0, -3.0)
"""Values of the column that all parts have, and of the one that is each part's own."""


@pytest.fixture(scope="module")
def parts() -> Parts:
    """Two parts: a shared column at fault, and one own column each."""
    rng = np.random.default_rng(1)
    X = rng.standard_normal((2, ROWS, 3))
    X[0, :, 2], X[1, :, 1] = 0.0, 0.0
    x = np.array([SHARED, *OWN])
    y = X @ x + 0.1 * rng.standard_normal((2, ROWS))
    variance = np.full((1, 1), 0.01)
    bands = Bands([RATE_HZ], [ROWS], np.array([0.0, RATE_HZ]))
    group = Group("gain", "here", (0,), (1.0,))
    posterior = Posterior(Cells.of(bands, [y[0][:, None]]), np.array([1.0, 1e4, 1e4]), variance)
    state = State((Chosen(group, 1.0),), posterior, 0.0)
    each = [
        (A.T @ A / 0.01, A.T @ b / 0.01, float(b @ b / 0.01), np.array([[ROWS]]))
        for A, b in zip(X, y, strict=True)
    ]
    return Parts.of(state, each, [1, 2], [1, 2], [])


def test_shared_values_come_from_the_others_and_own_ones_from_the_part(parts: Parts) -> None:
    for t in (0, 1):
        x = parts.predicted(parts.prior, t)
        by_the_other = parts.mean(parts.prior, t)
        assert x[0] == pytest.approx(by_the_other[0], abs=1e-12)
        assert x[0] == pytest.approx(SHARED, abs=0.05)
        assert x[1 + t] == pytest.approx(OWN[t], abs=0.05)
        assert x[2 - t] == pytest.approx(0.0, abs=1e-9)
        assert parts.left(x, t) == pytest.approx(ROWS, rel=0.3)


def test_what_a_part_says_itself_does_not_predict_it(parts: Parts) -> None:
    products = parts.products.copy()
    products[0, 0] = 0.0
    spoilt = replace(parts, products=products)
    assert spoilt.predicted(parts.prior, 0)[0] == pytest.approx(parts.predicted(parts.prior, 0)[0], abs=1e-12)
    assert abs(spoilt.mean(parts.prior)[0] - SHARED) > 0.1


def test_without_the_cause_a_part_is_not_predicted(parts: Parts) -> None:
    without = np.where(np.arange(3) == 0, 0.0, parts.prior)
    assert parts.left(parts.predicted(without, 0), 0) > 20.0 * ROWS


def test_a_single_part_predicts_itself(parts: Parts) -> None:
    first = {name: getattr(parts, name)[:1] for name in ("grams", "products", "squares", "rows")}
    alone = replace(parts, **first)
    assert alone.predicted(alone.prior, 0) == pytest.approx(alone.mean(alone.prior), rel=1e-6, abs=1e-9)


def test_values_shrink_nothing_and_have_errors(parts: Parts) -> None:
    mean, covariance = parts.values(parts.prior)
    assert parts.prior[0] == 9.0
    assert mean == pytest.approx(parts.mean(parts.prior))
    assert mean[0] == pytest.approx(SHARED, abs=4.0 * np.sqrt(covariance[0, 0]))
    assert covariance[0, 0] == pytest.approx(0.01 / (2 * ROWS), rel=0.3)
