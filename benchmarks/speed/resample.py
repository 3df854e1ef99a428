"""Memory and speed of a long log on its way to a recording: python benchmarks/speed/resample.py [MINUTES [ROBOTS [HZ]]]

The log is made up while it is read: stamps with 5 % jitter, 1 % of the samples dropped, chunks of 1000 rows of one
robot after the other. An hour of ten robots at 1 kHz is the default.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from mocobot_logs.log import CHANNELS, Level, Samples
from mocobot_logs.one_clock import to_recording
from mocobot_logs.resample import resample
from mocobot_sim.scene.models import omnid_design


class MadeUp:
    """A team that sways, with noise, for as long as one likes."""

    name = "made up"
    level: Level = "joint"
    channels = CHANNELS["joint"]
    metadata = None

    def __init__(self, seconds: float, robots: int, rate_hz: float) -> None:
        """Robot i's channels are sines of 0.3 to 0.9 Hz about a plausible mean."""
        self.robots, self.seconds, self.rate_hz = robots, seconds, rate_hz
        self.size = round(seconds * rate_hz) * robots
        rng = np.random.default_rng(0)
        self._hertz = rng.uniform(0.3, 0.9, (3, 9))

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """As in ``LogSource``."""
        rng = np.random.default_rng(1)
        mean = np.repeat([0.5, 0.0, 1.0], 3)
        for first in range(0, round(self.seconds * self.rate_hz), 1000):
            for robot in range(self.robots):
                rows = np.arange(first, first + 1000)
                time_s = (rows + rng.uniform(-0.05, 0.05, 1000)) / self.rate_hz
                time_s = time_s[(rng.random(1000) > 0.01) | (rows == 0)]
                wave = np.sin(2 * np.pi * time_s[:, None, None] * self._hertz).sum(axis=1)
                values = mean + 0.03 * wave + 1e-4 * rng.standard_normal((len(time_s), 9))
                advance(1000)
                yield robot, Samples(np.rint(1e9 * (1.0 + time_s)).astype(np.int64), values)


def main() -> None:
    """Print times and peak memory."""
    minutes, robots, rate_hz = (float(x) for x in [*sys.argv[1:], "60", "10", "1000"][:3])
    source = MadeUp(60.0 * minutes, int(robots), rate_hz)
    before = _peak_mb()
    start = time.process_time()
    for _ in source.chunks(lambda _: None):
        pass
    making = time.process_time() - start
    start = time.process_time()
    resampled = resample(source)
    report = resampled.reports[0]
    spent = time.process_time() - start - making
    print(f"{minutes:g} min, {int(robots)} robots at {rate_hz:g} Hz: {source.size} rows; robot 1: {report}")
    print(
        f"resampling {spent:6.1f} s CPU, {1e6 * spent / source.size:.2f} us per row; peak {_peak_mb():.0f} MB"
    )
    start = time.process_time()
    options: dict[str, Any] = {"design": omnid_design(), "trial": "random"}
    recording, clocks = to_recording(resampled, **options)
    spent = time.process_time() - start
    print(
        f"one clock  {spent:6.1f} s CPU, {len(recording.time)} samples; peak {_peak_mb():.0f} MB ({before:.0f} before)"
    )
    print(f"offsets {clocks.estimate.offset_s} s")


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
