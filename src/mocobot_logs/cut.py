"""Parts of a log: a span to keep (``12:95``), spans to drop (``robot=2:30-31``), and the parts between gaps.

Seconds count from the log's start, the earliest first stamp of its robots. Both ends of a span belong to it.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.log import LogSource, Samples, Selection, Stamps, rows_of
from mocobot_logs.resample import is_hole

SHORTEST_NS = 9_500_000_000
"""Shortest part that becomes a trial [ns]. Derived: ``estimate`` and ``diagnose`` drop 2 s at either end for their
filters. Resampling may drop 0.1 s at either end. A diagnosis needs 5 s of the rest."""
UNEVEN_NS = 100_000_000  # smallest difference between the robots' beginnings or ends that is reported [ns]
_S = r"(\d{1,12}(?:\.\d*)?|\.\d+)"
_CROP = re.compile(rf"{_S}?:{_S}?", re.ASCII)
_DROP = re.compile(rf"robot=(\d{{1,4}}):{_S}-{_S}", re.ASCII)
_NS_PER_S = 1_000_000_000
LATEST_NS = 10**12 * _NS_PER_S  # end of a span without a given end: later than any log [ns]
_UNEVEN = "not all robots have samples"
_LOOK = 1024  # number of stamps that determine the period


@dataclass(frozen=True)
class Span:
    """Time from ``first_ns`` to ``last_ns`` after the log's start [ns], both included."""

    first_ns: int
    last_ns: int

    @property
    def length_ns(self) -> int:
        return self.last_ns - self.first_ns

    def holds(self, after_ns: Stamps) -> NDArray[np.bool_]:
        """Return which times after the log's start [ns] are inside."""
        return (after_ns >= self.first_ns) & (after_ns <= self.last_ns)

    def __str__(self) -> str:
        """Return text such as "12 to 95 s"."""
        return f"{seconds(self.first_ns)} to {'the end' if self.last_ns >= LATEST_NS else f'{seconds(self.last_ns)} s'}"


@dataclass(frozen=True)
class Drop:
    """A span whose samples of one robot, counted from 1, are left out."""

    robot: int
    span: Span

    def __str__(self) -> str:
        """Return the span in the form of the command line."""
        return f"robot={self.robot}:{seconds(self.span.first_ns)}-{seconds(self.span.last_ns)}"


@dataclass(frozen=True)
class Choice:
    """The wanted part of a log: the span to keep (None for all of it), and the drops within it."""

    crop: Span | None = None
    drops: tuple[Drop, ...] = ()

    def __bool__(self) -> bool:
        """Return whether anything is left out."""
        return self.crop is not None or bool(self.drops)


WHOLE = Choice()  # all of a log


@dataclass(frozen=True)
class Omission:
    """Time of a log that is in no recording."""

    span: Span  # time after the log's start
    robot: int | None  # robot whose samples are left out, from 1, or None for all robots
    samples: int | None  # number of these samples, or None if not counted
    why: str  # the reason in words


def parse_choice(crop: str | None, drops: Iterable[str] = ()) -> Choice:
    """Parse options of the command line: ``FROM:TO``, of which either may be missing, and ``robot=N:FROM-TO`` each."""
    return Choice(None if crop is None else _crop(crop), tuple(_drop(drop) for drop in drops))


def seconds(ns: int) -> str:
    """Format nanoseconds as seconds without rounding."""
    text = f"{Decimal(ns) / _NS_PER_S:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _ns(text: str) -> int:
    return round(Decimal(text) * _NS_PER_S)


def _crop(text: str) -> Span:
    found = _CROP.fullmatch(text)
    if found is None or text == ":":
        raise InputError(
            f"--crop is {text!r:.60}; it must be FROM:TO in seconds from the log's start, such as 12:95, 12: or :95"
        )
    first, last = found.groups()
    span = Span(_ns(first or "0"), LATEST_NS if last is None else _ns(last))
    if span.last_ns <= span.first_ns:
        raise InputError(f"--crop is {text!r:.60}, which ends before it begins; nothing would be left")
    return span


def _drop(text: str) -> Drop:
    found = _DROP.fullmatch(text)
    if found is None:
        raise InputError(
            f"--drop is {text!r:.60}; it must be robot=N:FROM-TO in seconds from the log's start, such as "
            "robot=2:30-31"
        )
    span = Span(_ns(found[2]), _ns(found[3]))
    if span.last_ns < span.first_ns:
        raise InputError(f"--drop is {text!r:.60}, which ends before it begins")
    return Drop(int(found[1]), span)


class Piece(Selection):
    """A span of a log without the dropped samples, as a ``LogSource``."""

    def __init__(self, source: LogSource, origin_ns: int, span: Span | None, drops: tuple[Drop, ...]) -> None:
        """Keep a span (None for all) without the drops; both count from ``origin_ns``. Nothing is read yet."""
        super().__init__(source, source.name if span is None else f"{source.name} ({span})")
        self.span, self._origin_ns = span, origin_ns
        self._drops = [[d.span for d in drops if d.robot == i + 1] for i in range(source.robots)]

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """Yield samples as ``LogSource.chunks``; reading stops after the span."""
        passed = [False] * self.robots
        for robot, samples in self.source.chunks(advance):
            after = samples.stamp_ns - self._origin_ns
            keep = np.ones(len(after), bool)
            if self.span is not None:
                keep &= self.span.holds(after)
                passed[robot] |= bool(len(after) and after[-1] > self.span.last_ns)
            for span in self._drops[robot]:
                keep &= ~span.holds(after)
            if keep.any():
                yield robot, samples if keep.all() else rows_of(samples, keep)
            if all(passed):
                return


@dataclass(frozen=True)
class Extent:
    """Time covered by a log, by the robots' stamps, in nanoseconds after its start."""

    origin_ns: int  # stamp of the start, the earliest first stamp of all robots [ns]
    chosen: Span  # the span that is kept
    # from the latest first to the earliest last kept sample of the robots; None if they share no time
    common: Span | None
    # robot (from 1) and time between samples, for each gap too long to be filled
    holes: tuple[tuple[int, Span], ...]
    left_out: tuple[Omission, ...]  # what the choice leaves out
    period_ns: float  # longest period of a robot's samples [ns]


def extent_of(
    source: LogSource, choice: Choice, max_gap_s: float, advance: Callable[[int], object] = lambda _: None
) -> Extent:
    """Scan a log; only its stamps stay in memory. Rows that lack a value do not count as samples.

    Gaps of more than ``max_gap_s`` beyond one period [s] are not filled.
    """
    for drop in choice.drops:
        if not 1 <= drop.robot <= source.robots:
            raise InputError(
                f"{source.name}: --drop {drop}: there is no robot {drop.robot}; robots are counted from 1 to "
                f"{source.robots}"
            )
    stamps, ends = _stamps(source, advance)
    if not ends:
        raise InputError(f"{source.name}: has no samples")
    origin_ns = min(first for first, _ in ends.values())
    last_ns = max(last for _, last in ends.values()) - origin_ns
    after = [np.asarray(each - origin_ns) for each in stamps]  # may wrap for stamps that are refused later
    chosen, left_out = Span(0, last_ns), []
    if (crop := choice.crop) is not None:
        if crop.first_ns > last_ns:
            raise InputError(
                f"{source.name}: --crop {crop}: the log ends {seconds(last_ns)} s after its start"
            )
        chosen = Span(crop.first_ns, min(crop.last_ns, last_ns))
        if chosen.first_ns > 0:
            left_out.append(Omission(Span(0, chosen.first_ns), None, None, "cropped"))
        if chosen.last_ns < last_ns:
            left_out.append(Omission(Span(chosen.last_ns, last_ns), None, None, "cropped"))
    keep = [np.ones(len(each), bool) if crop is None else crop.holds(each) for each in after]
    for drop in choice.drops:
        times = after[drop.robot - 1]
        out = drop.span.holds(times)
        if not out.any():
            raise InputError(
                f"{source.name}: --drop {drop}: robot {drop.robot} has no samples then{_range(times)}"
            )
        left_out.append(Omission(drop.span, drop.robot, int(out.sum()), "dropped"))
        keep[drop.robot - 1] &= ~out
    kept = [each[mask] for each, mask in zip(after, keep, strict=True)]
    for robot, each in enumerate(kept, 1):
        if choice and not len(each):
            raise InputError(
                f"{source.name}: what --crop and --drop leave holds no sample of robot {robot}"
                f"{_range(after[robot - 1])}"
            )
    periods = [_period_ns(each) for each in kept]
    holes = [
        (robot, Span(int(each[k]), int(each[k + 1])))
        for robot, (each, period) in enumerate(zip(kept, periods, strict=True), 1)
        for k in np.flatnonzero(is_hole(np.diff(each), period, max_gap_s))
    ]
    return Extent(origin_ns, chosen, _common(kept), tuple(holes), tuple(left_out), max(periods))


def _stamps(
    source: LogSource, advance: Callable[[int], object]
) -> tuple[list[Stamps], dict[int, tuple[int, int]]]:
    """Return the stamps of every robot's complete rows, and each robot's first and last stamp of all rows."""
    parts: list[list[Stamps]] = [[np.empty(0, np.int64)] for _ in range(source.robots)]
    ends: dict[int, tuple[int, int]] = {}
    for robot, samples in source.chunks(advance):
        if len(samples.stamp_ns):
            first, last = int(samples.stamp_ns[0]), int(samples.stamp_ns[-1])
            ends[robot] = ends.get(robot, (first, last))[0], last
            parts[robot].append(samples.stamp_ns[~np.isnan(samples.values).any(axis=1)])
    return [np.concatenate(each) for each in parts], ends


def _range(after_ns: Stamps) -> str:
    if not len(after_ns):
        return "; it has none at all"
    return f"; its samples go from {seconds(int(after_ns[0]))} to {seconds(int(after_ns[-1]))} s"


def _period_ns(after_ns: Stamps) -> float:
    steps = np.diff(after_ns[:_LOOK])
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 1.0


def _common(kept: list[Stamps]) -> Span | None:
    if not all(map(len, kept)):
        return None
    first, last = max(int(each[0]) for each in kept), min(int(each[-1]) for each in kept)
    return Span(first, last) if first < last else None


def split(extent: Extent) -> tuple[list[Span], list[Omission]]:
    """Return spans in which every robot has samples without a long gap, however short, and the omissions between them.

    A gap of one robot counts for all, since forces and motions of a team are only meaningful together.
    """
    if extent.common is None:
        return [], []
    at, last = extent.common.first_ns, extent.common.last_ns
    spans, out = [], []
    if at - extent.chosen.first_ns > UNEVEN_NS:
        out.append(Omission(Span(extent.chosen.first_ns, at), None, None, _UNEVEN))
    for robot, hole in sorted(extent.holes, key=lambda each: (each[1].first_ns, each[1].last_ns)):
        if hole.last_ns < at or hole.first_ns >= last:
            continue
        if hole.first_ns > at:
            spans.append(Span(at, hole.first_ns))
        out.append(Omission(hole, None, None, f"robot {robot} has no samples"))
        at = max(at, hole.last_ns)
    if last > at:
        spans.append(Span(at, last))
    if extent.chosen.last_ns - last > UNEVEN_NS:
        out.append(Omission(Span(last, extent.chosen.last_ns), None, None, _UNEVEN))
    return spans, out
