"""An hour of ten robots is estimated in less than 2 GB: memory per sample is what is checked, on a shorter trial."""

from __future__ import annotations

import dataclasses
import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest

from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from recorded_team import Sines, carry
from recordings import metadata

HOUR = 360_000  # samples
ROBOTS = 10
LIMIT_BYTES = 2.0e9
ELSEWHERE_BYTES = 0.3e9  # interpreter, libraries, and what the allocator does not give back


def long_trial(repeats: int) -> Recording:
    """Ten robots on three grasps, to and fro: a motion run backwards takes the same forces."""
    rng = np.random.default_rng(0)
    path = Sines.draw(rng, [*np.deg2rad([3.5, 3.5, 3.5]), 0.01, 0.01, 0.01], 3, 0.3, 0.7)
    once = carry(path, Sines.draw(rng, [5.0] * 3, 8, 0.1, 1.5), 20.0).recording
    rows = np.concatenate([np.arange(2000), np.arange(2000)[::-1]])
    rows, robots = np.tile(rows, repeats), np.arange(ROBOTS) % 3
    parts = {
        name: getattr(once, name)[rows][:, robots] + 1e-5 * rng.standard_normal((len(rows), ROBOTS, 3))
        for name in ("phi", "theta", "tau")
    }
    time = np.arange(len(rows)) / 100.0
    return dataclasses.replace(once, time=time, metadata=metadata(robots=ROBOTS), **parts)


@pytest.mark.slow
def test_memory_of_an_estimate_per_sample() -> None:
    rows = []

    def recordings() -> Iterator[Recording]:
        recording = long_trial(5)
        rows.append(len(recording.time))
        tracemalloc.reset_peak()
        yield recording

    tracemalloc.start()
    try:
        estimate = estimate_payload(recordings())
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert estimate.inertia is not None
    assert rows == [20_000]
    assert peak * HOUR / rows[0] < LIMIT_BYTES - ELSEWHERE_BYTES
