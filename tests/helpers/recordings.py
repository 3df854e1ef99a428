"""Small plausible recordings to spoil in tests."""

import numpy as np

from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from omnid_design import DESIGN


def metadata(robots=3, **changes) -> RecordingMetadata:
    values = {
        "robots": robots,
        "rate_hz": 100.0,
        "trial": "random",
        "source": "test",
        "payload": None,
        "seed": None,
        "design": DESIGN,
    }
    return RecordingMetadata(**(values | changes))


def small_recording(rows=600, robots=3, ref=True, **changes) -> Recording:
    """Random, distinct values in every channel, inside every allowed range."""
    rng = np.random.default_rng(7)
    shape = (rows, robots, 3)
    return Recording(
        time=np.arange(rows) / 100.0,
        phi=rng.uniform(0.3, 0.9, shape),
        theta=rng.uniform(-0.2, 0.2, shape),
        tau=rng.uniform(-9.0, 9.0, shape),
        ref=rng.uniform(-0.1, 0.4, shape) if ref else None,
        metadata=metadata(robots, **changes),
    )
