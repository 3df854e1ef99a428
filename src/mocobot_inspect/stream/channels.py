"""Every channel of a robot over the whole log: range, faults, resolution, noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import spectrogram
from scipy.special import erf

from estimator.arrays import Array
from estimator.quantisation import quantisation_step
from estimator.recording.metadata import SENSORS
from mocobot_inspect.stream.noise import noise_level, wild
from mocobot_logs.log import NS, Stamps

STUCK_S = 0.2
"""Shortest time for which a channel must stand to be stuck. Measured on trials of 25 s: 0.1 s moves an estimate by up
to 3 of its standard errors, 0.2 s by up to 16 (inertia 2 %, grasps 4 mm), 2 s spoils it (mass 1 %, grasps 10 cm)."""
CLIPPED_SAMPLES = 5
"""Shortest run at an extreme to be clipped."""
_MOVES = 0.05  # others move: by this share of their range
_JUMP = 4.0  # times the usual large step from sample to sample
_CORNER = 0.3  # of the same
_NOISY = 0.5  # of the quantisation step; rounding alone looks like 0.3
_CHANCE = 1e-3  # a run that noise makes by chance in so many logs is no sign
_CLEAR = 1.5  # steps of the resolution; what approaches an end one by one may just be slow
_SPEED_S, _AT_SPEED = 0.1, 0.5  # time over which speed is taken; share of the usual high speed


@dataclass(frozen=True)
class Frozen:
    """One stretch.

    Attributes:
        kind: ``stuck`` or ``clipped``.
        channel: which channel, from 0.
        start, stop: rows, the last one not included.
        value: where it stands [SI].
        jumps: whether it jumps there or from there.
    """

    kind: Literal["stuck", "clipped"]
    channel: int
    start: int
    stop: int
    value: float
    jumps: bool = False


def frozen(values: Array, rate_hz: float) -> list[Frozen]:
    """Stuck and clipped stretches of one robot's channels.

    A channel that stands because nothing moves is not stuck; nor is one that rests while others move. A stuck one jumps
    when it comes back, stops dead before the log ends, or repeats itself
    although it has no steps or more noise than steps.

    Args:
        values: samples of the robot's channels, finite, shape (q, C).
        rate_hz: their rate [Hz].
    """
    found = []
    least = _least_travel(values)
    for channel in range(values.shape[1]):
        x = values[:, channel]
        steps = np.abs(np.diff(x))
        if not steps.any():
            if len(x) and _others_move(values, least, channel, 0, len(x), rate_hz):
                found.append(Frozen("stuck", channel, 0, len(x), float(x[0])))
            continue
        usual = float(np.quantile(steps[steps > 0], 0.95))
        repeats = _longest_by_chance(x) if np.mean(steps == 0) < 0.5 else np.inf
        for start, stop in _runs(x):
            if stop - start < CLIPPED_SAMPLES or not _others_move(
                values, least, channel, start, stop, rate_hz
            ):
                continue
            back = steps[stop - 1] if stop < len(x) else 0.0
            into = steps[start - 1] if start else 0.0
            jumps = bool(max(back, into) > _JUMP * usual)
            if stop - start >= max(STUCK_S * rate_hz, CLIPPED_SAMPLES) and (
                jumps or stop - start > repeats or _stops_dead(x, steps, start, stop, rate_hz)
            ):
                found.append(Frozen("stuck", channel, start, stop, float(x[start]), jumps))
    return found + _clipped(values)


def _longest_by_chance(x: Array) -> float:
    """Samples for which noise alone repeats a rounded value at rest; infinite where rounding covers the noise."""
    resolution, noise = quantisation_step(x), noise_level(x)
    if resolution is None:
        return 1.0
    if noise <= _NOISY * resolution:
        return np.inf
    same = float(erf(resolution / np.sqrt(8.0 * (noise**2 - resolution**2 / 12.0))))
    return np.log(_CHANCE / len(x)) / np.log(same)


def _stops_dead(x: Array, steps: Array, start: int, stop: int, rate_hz: float) -> bool:
    """Whether a stretch that begins or ends with the log is left or entered at speed."""
    window = max(2, round(_SPEED_S * rate_hz))
    if len(x) <= 2 * window or (start > 0) == (stop < len(x)):
        return False
    usual = float(np.quantile(np.abs(x[window:] - x[:-window]), 0.95))
    other = max(start - window, 0) if start else min(stop - 1 + window, len(x) - 1)
    moved = abs(x[other] - x[start])
    return moved > max(_AT_SPEED * usual, _JUMP * float(steps[steps > 0].min()))


def _clipped(values: Array) -> list[Frozen]:
    found = []
    for channel in range(values.shape[1]):
        x = values[:, channel]
        steps = np.abs(np.diff(x))
        if not steps.any():
            continue
        usual = float(np.quantile(steps[steps > 0], 0.95))
        least = max(_CORNER * usual, _CLEAR * (quantisation_step(x, levels=2) or 0.0))
        for extreme in (x.min(), x.max()):
            runs = [(a, b) for a, b in _runs(x, x == extreme) if b - a >= CLIPPED_SAMPLES]
            # A peak is round; a clipped one has corners: speed up to the limit, and none from there on.
            corners = [
                (a, b)
                for a, b in runs
                if (a >= 2 and steps[a - 2] > least) or (b + 1 < len(x) and steps[b] > least)
            ]
            if len(corners) >= 2:
                found += [Frozen("clipped", channel, a, b, float(extreme)) for a, b in corners]
    return found


def _runs(x: Array, where: NDArray[np.bool_] | None = None) -> list[tuple[int, int]]:
    """Runs of equal values (start, stop), or those of rows ``where`` only."""
    edges = np.flatnonzero(np.diff(x) != 0) + 1
    bounds = np.concatenate([[0], edges, [len(x)]])
    runs = zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
    return [(a, b) for a, b in runs if where is None or where[a]]


def _others_move(values: Array, least: Array, channel: int, start: int, stop: int, rate_hz: float) -> bool:
    """Whether at least two other channels move in both halves of a stretch."""
    middle = (start + stop + 1) // 2
    halves = [_travel(part, rate_hz) for part in (values[start:middle], values[middle - 1 : stop])]
    moved = np.minimum(*halves) > least
    moved[channel] = False
    return int(np.sum(moved)) >= 2


def _least_travel(values: Array) -> Array:
    """Half of what a channel must travel to move: a share of its range, and more than from one sample to the next."""
    if len(values) < 2:
        return np.zeros(values.shape[1])
    return np.maximum(
        _MOVES / 2 * np.ptp(values, axis=0), np.quantile(np.abs(np.diff(values, axis=0)), 0.95, axis=0)
    )


def _travel(values: Array, rate_hz: float) -> Array:
    """Range of means over a tenth of a second: a torque's noise is no motion."""
    length = max(1, min(round(_SPEED_S * rate_hz), len(values) // 4))
    starts = np.arange(0, len(values) - length + 1, length)
    return np.ptp(np.add.reduceat(values[: starts[-1] + length], starts, axis=0) / length, axis=0)


ABOVE_HZ = 10.0
"""No motion of an Omnid is that fast."""
NOISES = 10.0
"""Amplitude over the channel's noise from which on it is worth a word; a sensor's own line is below."""
STEPS = 10.0
"""The same over its quantisation step: a slow joint climbs stairs of one."""
SHARE = 0.7
"""Least share of one line in all that is fast: a bump has none."""
WINDOW_S, WINDOW_ROWS = 2.5, 10_000
"""Length of a window, and rows of one at most: half of what is looked at together."""
_WIDTH = 3  # frequencies on either side of a line that are its own, in a Hann window


@dataclass(frozen=True)
class Oscillation:
    """A line in a channel's spectrum.

    Attributes:
        frequency_hz: where it is largest [Hz]; folded if it is above half the rate.
        amplitude: its largest [SI].
        duration_s: for how long it is there, in whole windows [s].
    """

    frequency_hz: float
    amplitude: float
    duration_s: float


def oscillation(x: Array, rate_hz: float) -> Oscillation | None:
    """The line that stands out of a channel's noise, or None.

    Args:
        x: consecutive samples, finite, shape (q,).
        rate_hz: their rate [Hz].
    """
    size = min(round(WINDOW_S * rate_hz), WINDOW_ROWS)
    if len(x) < size or rate_hz < 4.0 * ABOVE_HZ:
        return None
    frequency, _, density = spectrogram(x, rate_hz, window="hann", nperseg=size, noverlap=0, detrend="linear")
    fast = frequency >= ABOVE_HZ
    frequency, power = frequency[fast], density[fast] * (frequency[1] - frequency[0])
    total, peak = power.sum(axis=0), power.argmax(axis=0)
    near = np.abs(np.arange(len(power))[:, None] - peak) <= _WIDTH
    line = np.where(near, power, 0.0).sum(axis=0)
    # Powers of white noise are exponentially distributed: ln 2 of their mean is the median.
    noise = np.sqrt(np.median(power, axis=0) / np.log(2.0) * len(power))
    amplitude = np.sqrt(2.0 * line)
    least = np.maximum(NOISES * noise, STEPS * (quantisation_step(x) or 0.0))
    there = (amplitude > least) & (line > SHARE * total)
    if not there.any():
        return None
    at = int(np.argmax(np.where(there, amplitude, 0.0)))
    return Oscillation(
        float(frequency[peak[at]]), float(amplitude[at]), float(np.sum(there) * size / rate_hz)
    )


def joined(found: list[Oscillation]) -> Oscillation | None:
    """Those of successive parts of a channel in one, or None without any."""
    if not found:
        return None
    largest = max(found, key=lambda one: one.amplitude)
    return Oscillation(largest.frequency_hz, largest.amplitude, sum(one.duration_s for one in found))


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
