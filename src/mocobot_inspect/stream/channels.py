"""Every channel of a robot over the whole log: range, faults, resolution, noise."""

from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array
from estimator.quantisation import quantisation_step
from estimator.recording.sampling import SENSORS
from mocobot_inspect.stream.frozen import Frozen, frozen
from mocobot_inspect.stream.noise import noise_level, wild
from mocobot_inspect.stream.oscillation import Oscillation, joined, oscillation
from mocobot_logs.log import NS, Stamps

UNITS = {"phi": "rad", "the": "rad", "tau": "N m", "h_x": "m", "h_y": "m", "h_z": "m", "for": "N", "ref": "m"}
"""Of a team's channels, by the first letters of their names."""
LISTED = 100
"""So many stuck and clipped stretches of a channel are kept; all are counted."""


@dataclass(frozen=True)
class Stretch:
    """A stuck or clipped stretch.

    Attributes:
        start_s: when it begins after the robot's first stamp [s].
        duration_s: how long it lasts [s].
        value: where the channel stands [SI].
        jumps: whether it jumps there or from there.
    """

    start_s: float
    duration_s: float
    value: float
    jumps: bool


@dataclass(frozen=True)
class Channel:
    """One channel of one robot; SI units.

    Attributes:
        name: as in ``CHANNELS``.
        lowest, highest: extremes of its finite samples, None without any.
        nans, infinities: samples that are not finite.
        wild: finite samples that no sensor reads (``noise.wild``).
        step: quantisation step, or None where there is none.
        noise: white noise of a sample; 0 where it is below the step.
        stuck, clipped: stretches in which it stands while others move, the first ``LISTED``.
        stuck_count, clipped_count: how many there are.
        oscillation: the line that stands out of its noise, or None.
    """

    name: str
    lowest: float | None
    highest: float | None
    nans: int
    infinities: int
    wild: int
    step: float | None
    noise: float
    stuck: tuple[Stretch, ...]
    clipped: tuple[Stretch, ...]
    stuck_count: int
    clipped_count: int
    oscillation: Oscillation | None

    @property
    def white_noise(self) -> float:
        """Noise of a sample, that of rounding included."""
        return max(self.noise, 0.0 if self.step is None else self.step / np.sqrt(12.0))


class ChannelTally:
    """Looks at one robot's samples block by block."""

    def __init__(self, names: tuple[str, ...], sensors: int = SENSORS) -> None:
        """Start without any; ``names`` of the channels, the first ``sensors`` of which are looked at for standing."""
        count = len(names)
        self._names, self._sensors = names, sensors
        self._low, self._high = np.full(count, np.inf), np.full(count, -np.inf)
        self._nans, self._infinities, self._wild = np.zeros((3, count), int)
        self._steps: list[list[float | None]] = [[] for _ in names]
        self._noise: list[list[float]] = [[] for _ in names]
        self._lines: list[list[Oscillation]] = [[] for _ in names]
        self._frozen: dict[tuple[str, int], list[Stretch]] = {}
        self._counts: dict[tuple[str, int], int] = {}

    def add(self, time_s: Array, values: Array, rate_hz: float | None) -> None:
        """Look at consecutive samples.

        Args:
            time_s: times after the robot's first stamp [s], shape (q,).
            values: samples [SI], shape (q, C).
            rate_hz: their rate [Hz], or None where it is not known.
        """
        self._nans += np.isnan(values).sum(axis=0)
        self._infinities += np.isinf(values).sum(axis=0)
        finite = np.isfinite(values)
        self._low = np.minimum(self._low, np.where(finite, values, np.inf).min(axis=0, initial=np.inf))
        self._high = np.maximum(self._high, np.where(finite, values, -np.inf).max(axis=0, initial=-np.inf))
        for k in range(len(self._names)):
            odd = wild(values[:, k]) & finite[:, k]
            self._wild[k] += odd.sum()
            finite[:, k] &= ~odd
            x = values[finite[:, k], k]
            self._steps[k].append(quantisation_step(x) if len(x) else None)
            self._noise[k].append(noise_level(x))
            line = oscillation(x, rate_hz) if rate_hz is not None and k < self._sensors else None
            if line is not None:
                self._lines[k].append(line)
        whole = finite.all(axis=1)
        if rate_hz is not None and whole.any():
            kept = time_s[whole]
            # Commands stand when they please.
            for found in frozen(values[whole][:, : self._sensors], rate_hz):
                self._keep(found, kept, rate_hz)

    def _keep(self, found: Frozen, time_s: Array, rate_hz: float) -> None:
        start_s = float(time_s[found.start])
        stretch = Stretch(
            start_s, float(time_s[found.stop - 1]) - start_s + 1.0 / rate_hz, found.value, found.jumps
        )
        key = found.kind, found.channel
        kept = self._frozen.setdefault(key, [])
        last = kept[-1] if kept else None
        # One that goes on from the block before.
        if (
            last is not None
            and last.value == stretch.value
            and start_s <= last.start_s + last.duration_s + 2 / rate_hz
        ):
            kept[-1] = Stretch(
                last.start_s, stretch.start_s + stretch.duration_s - last.start_s, last.value, stretch.jumps
            )
            return
        self._counts[key] = self._counts.get(key, 0) + 1
        if len(kept) < LISTED:
            kept.append(stretch)

    def finish(self) -> tuple[Channel, ...]:
        """What was found, channel by channel."""
        channels = []
        for k, name in enumerate(self._names):
            steps = [step for step in self._steps[k] if step is not None]
            known = np.isfinite(self._low[k])
            channels.append(
                Channel(
                    name=name,
                    lowest=float(self._low[k]) if known else None,
                    highest=float(self._high[k]) if known else None,
                    nans=int(self._nans[k]),
                    infinities=int(self._infinities[k]),
                    wild=int(self._wild[k]),
                    step=float(np.median(steps)) if 2 * len(steps) > len(self._steps[k]) else None,
                    noise=float(np.median(self._noise[k])) if self._noise[k] else 0.0,
                    stuck=tuple(self._frozen.get(("stuck", k), ())),
                    clipped=tuple(self._frozen.get(("clipped", k), ())),
                    stuck_count=self._counts.get(("stuck", k), 0),
                    clipped_count=self._counts.get(("clipped", k), 0),
                    oscillation=joined(self._lines[k]),
                )
            )
        return tuple(channels)


def seconds(stamp_ns: Stamps, origin_ns: int) -> Array:
    """Stamps as seconds after an origin."""
    return np.asarray((stamp_ns - origin_ns) * NS, dtype=np.float64)
