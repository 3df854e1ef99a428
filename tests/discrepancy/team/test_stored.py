"""Arrays in files: the same numbers, and memory that is given back."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from discrepancy.team.linear.trial_linear import given_back, is_stored, stored


def resident_MB() -> float:
    """Memory of this process."""
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * 4096 / 1e6


def test_numbers_stay_and_views_know_where_they_are() -> None:
    x = np.random.default_rng(1).standard_normal((20, 3, 4))
    for numbers in (x, x.astype(np.float32), np.asfortranarray(x), x[::2, :, 1:], np.arange(7)):
        kept = stored(numbers)
        assert is_stored(kept)
        assert is_stored(kept[1:])
        assert not is_stored(numbers)
        assert kept.dtype == numbers.dtype
        np.testing.assert_array_equal(kept, numbers)
        given_back(kept[1:], kept, numbers)  # what is no file stays
        np.testing.assert_array_equal(kept, numbers)
        assert stored(kept) is kept
        with pytest.raises(ValueError, match="read-only"):
            kept[0] = 0
    nothing = stored(x[..., :0])
    assert nothing.shape == (20, 3, 0)
    assert not is_stored(nothing)


@pytest.mark.parametrize("axes", [(0, 1, 2), (2, 0, 1), (1, 2, 0), (2, 1, 0)])
def test_numbers_lie_as_they_did(axes: tuple[int, ...]) -> None:
    """Sums over what lies otherwise have other last bits."""
    x = np.random.default_rng(3).standard_normal((4, 5, 6)).transpose(axes)
    kept = stored(x)
    assert is_stored(kept)
    np.testing.assert_array_equal(kept, x)
    assert kept.strides == x.strides
    assert stored(x[0]).strides == np.array(x[0], order="K").strides


def test_a_disk_that_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system's own: whatever is written to it is refused."""
    if not Path("/dev/full").exists():
        pytest.skip("no such device")
    monkeypatch.setattr(tempfile, "TemporaryFile", partial(Path("/dev/full").open, "w+b", 0))
    for count in (3, 1_000_000):
        x = np.ones(count)
        assert stored(x) is x


@pytest.mark.skipif(not Path("/proc/self/statm").is_file(), reason="only Linux says what a process has")
def test_memory_is_given_back() -> None:
    """The system's own account of 80 MB."""
    kept = stored(np.ones(10_000_000))
    before = resident_MB()
    assert kept.sum() == 1e7
    assert resident_MB() > before + 60.0
    given_back(kept)
    assert resident_MB() < before + 20.0
    assert kept[-1] == 1.0
