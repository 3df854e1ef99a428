"""Check channels of a log: range, invalid values, resolution, noise, stuck and clipped stretches, oscillation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import spectrogram
from scipy.special import erf

from estimator.arrays import Array
from estimator.quantisation import quantisation_step
from estimator.recording.metadata import SENSORS
from mocobot_logs.log import NS, Stamps

UNITS = {"phi": "rad", "the": "rad", "tau": "N m", "h_x": "m", "h_y": "m", "h_z": "m", "for": "N", "ref": "m"}
"""Units of a team's channels, by the first three letters of their names."""
LISTED = 100  # number of stuck and clipped stretches per channel that are kept; all are counted

ABSURD = 1e9  # smallest absolute value that no sensor reads, in any unit [SI]
_FAR = 1000.0  # times the span of the other samples, which counts as at least 1 SI unit
_FEW = 0.02  # share of the samples on either side that may be outliers
_LAG_GAIN = 70.0  # variance of a fourth difference over that of white noise: 1 + 16 + 36 + 16 + 1
_MAD = 0.6744897501960817  # median of |x| of a standard normal distribution

STUCK_S = 0.2
"""Shortest constant stretch of a stuck channel [s]. Measured on trials of 25 s: 0.1 s moves an estimate by up to 3 of
its standard errors. 0.2 s moves it by up to 16 (inertia 2 %, grasps 4 mm). 2 s spoils it (mass 1 %, grasps 10 cm)."""
CLIPPED_SAMPLES = 5  # shortest run at an extreme that counts as clipped
_MOVES = 0.05  # share of its range by which another channel must move
_JUMP = 4.0  # times the usual large step between samples
_CORNER = 0.3  # of the usual large step
_NOISY = 0.5  # of the quantisation step; rounding alone looks like 0.3
_CHANCE = 1e-3  # probability per log that noise alone makes such a run
_CLEAR = 1.5  # quantisation steps; a slow channel approaches its extreme one step at a time
_SPEED_S, _AT_SPEED = 0.1, 0.5  # interval over which speed is taken; share of the usual high speed

ABOVE_HZ = 10.0  # lowest frequency of an oscillation [Hz]; no motion of an Omnid is that fast
NOISES = 10.0
"""Least amplitude of an oscillation over the channel's noise; spectral lines of sensors are weaker."""
STEPS = 10.0
"""Least amplitude of an oscillation over the quantisation step; a slow joint moves in stairs of one step."""
SHARE = 0.7  # least share of one spectral line in all fast power; a bump has no such line
WINDOW_S, WINDOW_ROWS = 2.5, 10_000  # length of a spectrogram's window [s] and its largest number of rows
_WIDTH = 3  # frequency bins on either side of a line that belong to it, in a Hann window


@dataclass(frozen=True)
class Stretch:
    """A stuck or clipped stretch."""

    start_s: float  # start after the robot's first stamp [s]
    duration_s: float  # duration [s]
    value: float  # constant value of the channel [SI]
    jumps: bool  # whether the channel jumps at the start or the end


@dataclass(frozen=True)
class Oscillation:
    """A line in a channel's spectrum."""

    frequency_hz: float  # frequency at its largest amplitude [Hz]; aliased if above half the rate
    amplitude: float  # largest amplitude [SI]
    duration_s: float  # total duration, in whole windows [s]


@dataclass(frozen=True)
class Channel:
    """One channel of one robot; SI units."""

    name: str  # name of the channel
    # lowest, highest: extremes of its finite samples, None without any
    lowest: float | None
    highest: float | None
    # nans, infinities: number of samples that are not finite
    nans: int
    infinities: int
    wild: int  # number of finite samples that no sensor reads, see ``wild``
    step: float | None  # quantisation step, or None
    noise: float  # standard deviation of white noise; 0 if below the step
    # stuck, clipped: stretches in which it is constant while others move, the first ``LISTED``
    stuck: tuple[Stretch, ...] = ()
    clipped: tuple[Stretch, ...] = ()
    # stuck_count, clipped_count: total number of such stretches
    stuck_count: int = 0
    clipped_count: int = 0
    oscillation: Oscillation | None = None  # spectral line above its noise, or None

    @property
    def white_noise(self) -> float:
        """Standard deviation of a sample's noise, at least that of rounding."""
        return max(self.noise, 0.0 if self.step is None else self.step / np.sqrt(12.0))


class ChannelTally:
    """Collects statistics of one robot's channels block by block."""

    def __init__(self, names: Sequence[str], sensors: int = SENSORS) -> None:
        """Start without samples; only the first ``sensors`` channels are checked for stuck stretches."""
        self._names, self._sensors = names, sensors
        self._parts: list[list[Channel]] = [[] for _ in names]
        self._stuck: list[list[Stretch]] = [[] for _ in names]
        self._clipped: list[list[Stretch]] = [[] for _ in names]

    def add(self, time_s: Array, values: Array) -> None:
        """Add consecutive samples [SI], shape (q, C), at times after the robot's first stamp [s], shape (q,)."""
        forward = np.diff(time_s)
        forward = forward[forward > 0]
        rate_hz = 1.0 / float(np.median(forward)) if len(forward) else None
        with np.errstate(all="ignore"):  # absurd values overflow; their range is reported
            good = np.isfinite(values) & ~wild(values)
            for k, name in enumerate(self._names):
                line = rate_hz if k < self._sensors else None
                self._parts[k].append(_part(name, values[:, k], good[:, k], line))
            whole = good.all(axis=1)
            if rate_hz is not None and whole.any():
                time_s, values = time_s[whole], values[whole][:, : self._sensors]
                self._keep(self._stuck, stuck(values, rate_hz), time_s, values, rate_hz)
                self._keep(self._clipped, clipped(values), time_s, values, rate_hz)

    @staticmethod
    def _keep(
        all_of: list[list[Stretch]], found: Iterator[Run], time_s: Array, values: Array, rate_hz: float
    ) -> None:
        """Add runs to the stretches; a run that continues the last stretch, even across blocks, extends it."""
        for k, start, stop, jumps in found:
            start_s, value = float(time_s[start]), float(values[start, k])
            duration_s = float(time_s[stop - 1]) - start_s + 1.0 / rate_hz
            last = all_of[k][-1] if all_of[k] else None
            if (
                last is not None
                and last.value == value
                and start_s <= last.start_s + last.duration_s + 2 / rate_hz
            ):
                all_of[k].pop()
                start_s, duration_s = last.start_s, start_s + duration_s - last.start_s
            all_of[k].append(Stretch(start_s, duration_s, value, jumps))

    def finish(self) -> tuple[Channel, ...]:
        channels = []
        for name, parts, stuck_all, clipped_all in zip(
            self._names, self._parts, self._stuck, self._clipped, strict=True
        ):
            steps = [part.step for part in parts if part.step is not None]
            channels.append(
                Channel(
                    name=name,
                    lowest=min((part.lowest for part in parts if part.lowest is not None), default=None),
                    highest=max((part.highest for part in parts if part.highest is not None), default=None),
                    nans=sum(part.nans for part in parts),
                    infinities=sum(part.infinities for part in parts),
                    wild=sum(part.wild for part in parts),
                    step=float(np.median(steps)) if 2 * len(steps) > len(parts) else None,
                    noise=float(np.median([part.noise for part in parts])) if parts else 0.0,
                    stuck=tuple(stuck_all[:LISTED]),
                    clipped=tuple(clipped_all[:LISTED]),
                    stuck_count=len(stuck_all),
                    clipped_count=len(clipped_all),
                    oscillation=joined([part.oscillation for part in parts if part.oscillation is not None]),
                )
            )
        return tuple(channels)


def _part(name: str, x: Array, good: NDArray[np.bool_], rate_hz: float | None) -> Channel:
    """Return statistics of one block without stuck stretches; oscillations are searched if a rate is given."""
    finite, readings = x[np.isfinite(x)], x[good]
    return Channel(
        name=name,
        lowest=float(finite.min() + 0.0) if len(finite) else None,
        highest=float(finite.max() + 0.0) if len(finite) else None,
        nans=int(np.isnan(x).sum()),
        infinities=int(np.isinf(x).sum()),
        wild=len(finite) - len(readings),
        step=quantisation_step(readings) if len(readings) else None,
        noise=noise_level(readings),
        oscillation=None if rate_hz is None else oscillation(readings, rate_hz),
    )


def noise_level(values: Array) -> float:
    """Estimate the standard deviation of white noise on a smooth signal (q,) from the median of fourth differences.

    Noise well below the quantisation step gives 0.
    """
    if len(values) < 5:
        return 0.0
    fourth = np.diff(values, 4)
    return float(np.median(np.abs(fourth)) / _MAD / np.sqrt(_LAG_GAIN))


def wild(values: Array) -> NDArray[np.bool_]:
    """Return which samples, (q,) or (q, C), no sensor reads: infinite, absurd, or a thousand times farther off."""
    if values.ndim == 2:
        return np.stack([wild(x) for x in values.T], axis=1)
    with np.errstate(invalid="ignore"):
        absurd = np.abs(values) >= ABSURD
    rest = values[np.isfinite(values) & ~absurd]
    if not len(rest):
        return absurd
    low, middle, high = np.quantile(rest, [_FEW, 0.5, 1.0 - _FEW])
    return absurd | (
        np.abs(np.where(np.isnan(values) | absurd, middle, values) - middle) > _FAR * max(high - low, 1.0)
    )


Run = tuple[int, int, int, bool]
"""Channel, first row, row after the last, and whether the channel jumps at either end."""


def stuck(values: Array, rate_hz: float) -> Iterator[Run]:
    """Yield runs in which a channel of a robot is stuck, from finite samples of its channels, shape (q, C).

    A channel is not stuck if nothing moves, or if it merely rests while others move. A stuck channel jumps at either
    end, stops abruptly before the log ends, or repeats a value more often than its noise allows.
    """
    least = _least_travel(values)
    for channel, x in enumerate(values.T):
        steps = np.abs(np.diff(x))
        if not steps.any():
            if len(x) and _others_move(values, least, channel, 0, len(x), rate_hz):
                yield channel, 0, len(x), False
            continue
        usual = _usual(steps)
        repeats = _longest_by_chance(x) if np.mean(steps == 0) < 0.5 else np.inf
        shortest = max(STUCK_S * rate_hz, CLIPPED_SAMPLES)
        for start, stop in _runs(x):
            if stop - start < shortest or not _others_move(values, least, channel, start, stop, rate_hz):
                continue
            back = steps[stop - 1] if stop < len(x) else 0.0
            into = steps[start - 1] if start else 0.0
            jumps = bool(max(back, into) > _JUMP * usual)
            if jumps or stop - start > repeats or _stops_dead(x, steps, start, stop, rate_hz):
                yield channel, start, stop, jumps


def clipped(values: Array) -> Iterator[Run]:
    """Yield runs in which a channel is cut off at an extreme, at least twice; ``values`` as in ``stuck``."""
    for channel, x in enumerate(values.T):
        steps = np.abs(np.diff(x))
        if not steps.any():
            continue
        least = max(_CORNER * _usual(steps), _CLEAR * (quantisation_step(x, levels=2) or 0.0))
        for extreme in (x.min(), x.max()):
            # A peak is round. A clipped one has corners: full speed up to the limit, then none.
            corners = [
                (a, b)
                for a, b in _runs(x)
                if x[a] == extreme
                and b - a >= CLIPPED_SAMPLES
                and ((a >= 2 and steps[a - 2] > least) or (b + 1 < len(x) and steps[b] > least))
            ]
            if len(corners) >= 2:
                yield from ((channel, a, b, False) for a, b in corners)


def _usual(steps: Array) -> float:
    """Return a typical large step between samples."""
    return float(np.quantile(steps[steps > 0], 0.95))


def _longest_by_chance(x: Array) -> float:
    """Return how many times noise alone may repeat a rounded value at rest; infinite if rounding hides the noise."""
    resolution, noise = quantisation_step(x), noise_level(x)
    if resolution is None:
        return 1.0
    if noise <= _NOISY * resolution:
        return np.inf
    same = float(erf(resolution / np.sqrt(8.0 * (noise**2 - resolution**2 / 12.0))))
    return np.log(_CHANCE / len(x)) / np.log(same)


def _stops_dead(x: Array, steps: Array, start: int, stop: int, rate_hz: float) -> bool:
    """Return whether a stretch at the start or end of the log is left or entered at speed."""
    window = max(2, round(_SPEED_S * rate_hz))
    if len(x) <= 2 * window or (start > 0) == (stop < len(x)):
        return False
    usual = float(np.quantile(np.abs(x[window:] - x[:-window]), 0.95))
    other = max(start - window, 0) if start else min(stop - 1 + window, len(x) - 1)
    moved = abs(x[other] - x[start])
    return moved > max(_AT_SPEED * usual, _JUMP * float(steps[steps > 0].min()))


def _runs(x: Array) -> list[tuple[int, int]]:
    """Return runs of equal values (start, stop)."""
    edges = np.flatnonzero(np.diff(x) != 0) + 1
    bounds = [0, *edges.tolist(), len(x)]
    return list(pairwise(bounds))


def _others_move(values: Array, least: Array, channel: int, start: int, stop: int, rate_hz: float) -> bool:
    """Return whether at least two other channels move in both halves of a stretch."""
    middle = (start + stop + 1) // 2
    halves = [_travel(part, rate_hz) for part in (values[start:middle], values[middle - 1 : stop])]
    moved = np.minimum(*halves) > least
    moved[channel] = False
    return int(np.sum(moved)) >= 2


def _least_travel(values: Array) -> Array:
    """Return the least travel of a moving channel per half stretch: a share of its range, and more than its usual
    steps."""
    if len(values) < 2:
        return np.zeros(values.shape[1])
    return np.maximum(
        _MOVES / 2 * np.ptp(values, axis=0), np.quantile(np.abs(np.diff(values, axis=0)), 0.95, axis=0)
    )


def _travel(values: Array, rate_hz: float) -> Array:
    """Return the range of means over a tenth of a second, which excludes noise."""
    length = max(1, min(round(_SPEED_S * rate_hz), len(values) // 4))
    starts = np.arange(0, len(values) - length + 1, length)
    return np.ptp(np.add.reduceat(values[: starts[-1] + length], starts, axis=0) / length, axis=0)


def oscillation(x: Array, rate_hz: float) -> Oscillation | None:
    """Return the spectral line above the noise of consecutive finite samples (q,), or None."""
    size = min(round(WINDOW_S * rate_hz), WINDOW_ROWS)
    if len(x) < size or rate_hz < 4.0 * ABOVE_HZ:
        return None
    frequency, _, density = spectrogram(x, rate_hz, window="hann", nperseg=size, noverlap=0, detrend="linear")
    fast = frequency >= ABOVE_HZ
    frequency, power = frequency[fast], density[fast] * (frequency[1] - frequency[0])
    total, peak = power.sum(axis=0), power.argmax(axis=0)
    near = np.abs(np.arange(len(power))[:, None] - peak) <= _WIDTH
    line = np.where(near, power, 0.0).sum(axis=0)
    # The power of white noise is exponentially distributed: its median is ln 2 times its mean.
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
    """Merge oscillations of successive parts of a channel; None if there are none."""
    if not found:
        return None
    largest = max(found, key=lambda one: one.amplitude)
    return Oscillation(largest.frequency_hz, largest.amplitude, sum(one.duration_s for one in found))


def seconds(stamp_ns: Stamps, origin_ns: int) -> Array:
    """Return stamps as seconds after an origin."""
    return np.asarray((stamp_ns - origin_ns) * NS, dtype=np.float64)
