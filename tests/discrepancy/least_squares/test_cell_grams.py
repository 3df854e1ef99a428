"""Gram matrices that share what stays, against those of whole columns."""

from __future__ import annotations

import numpy as np
import pytest

from discrepancy.least_squares.cell_grams import CellGrams
from discrepancy.team.linear.stored import is_stored

K, ROWS, W = 3, 30, 6


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(8)


def grams(x: np.ndarray) -> np.ndarray:
    """Of columns (K, rows, W)."""
    return np.einsum("kri,krj->kij", x, x)


def check(found: CellGrams, x: np.ndarray, rng: np.random.Generator) -> None:
    """All that is asked of them is that of the columns x."""
    expected, width = grams(x), x.shape[2]
    assert (found.cells, found.width) == (K, width)
    for cell, gram in enumerate(found.each(range(K))):
        np.testing.assert_allclose(gram, expected[cell], atol=1e-10)
    weights = rng.uniform(0.5, 2.0, K)
    np.testing.assert_allclose(found.weighted(weights), np.einsum("k,kij", weights, expected), atol=1e-10)
    for start, count in ((0, width), (0, 1), (width - 2, 2), (width - 1, 1), (1, 0)):
        values = rng.standard_normal(count)
        squares = ((x[..., start : start + count] @ values) ** 2).sum(axis=1)
        np.testing.assert_allclose(found.squares(values, start), squares, atol=1e-9)
    at = rng.integers(0, width, (2, 4))
    np.testing.assert_allclose(
        found.summed(at[:, None], at), expected.sum(axis=0)[at[:, None], at], atol=1e-10
    )


def replaced(found: CellGrams, x: np.ndarray, at: tuple[int, int, int], rng: np.random.Generator):
    """With so many other columns in place of some."""
    start, stop, count = at
    new = rng.standard_normal((K, ROWS, count))
    x = np.concatenate([x[..., :start], new, x[..., stop:]], axis=2)
    return found.replaced(start, stop, np.einsum("kri,krj->kij", x, new)), x


def test_as_they_are_made(rng: np.random.Generator) -> None:
    x = rng.standard_normal((K, ROWS, W))
    check(CellGrams.of(grams(x)), x, rng)


@pytest.mark.parametrize("kept", [False, True])
@pytest.mark.parametrize(
    "changes",
    [
        [(2, 4, 2)],
        [(5, 6, 1)],
        [(3, 3, 2)],  # put between
        [(5, 5, 1), (6, 7, 1)],  # put before the last, which is then another
        [(1, 3, 2), (2, 3, 1)],  # half of what came later goes again
        [(4, 6, 2), (0, 5, 1), (1, 1, 3)],
        [(0, 6, 4), (1, 2, 1)],  # nothing of the first is left
    ],
)
def test_others_in_place_of_some(rng: np.random.Generator, changes, kept: bool) -> None:
    x = rng.standard_normal((K, ROWS, W))
    found = CellGrams.of(grams(x))
    found = found.stored() if kept else found
    for at in changes:
        found, x = replaced(found, x, at, rng)
        check(found, x, rng)
    assert is_stored(found.first) == kept
    loss = rng.standard_normal((K, ROWS, x.shape[2]))
    less = found.changed(lambda cell, gram: gram - grams(loss)[cell])
    assert is_stored(less.first) == kept
    for cell in range(K):
        np.testing.assert_allclose(less.whole(cell), grams(x)[cell] - grams(loss)[cell], atol=1e-10)
    check(found, x, rng)  # which is as it was


def test_problems_share_the_first(rng: np.random.Generator) -> None:
    x = rng.standard_normal((K, ROWS, W))
    first = CellGrams.of(grams(x))
    assert np.shares_memory(replaced(first, x, (1, 2, 1), rng)[0].first, first.first)
