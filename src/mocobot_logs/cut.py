"""What of a log is wanted, as a user says it: ``12:95`` and ``robot=2:30-31``, in seconds from the log's start.

The log's start is the earliest first stamp of its robots. Both ends of a span belong to it.

One look through a log's stamps: where it begins and ends, where samples are missing, what a choice leaves out.

Parts of a log between its holes.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.log import Level, LogSource, Samples, Stamps, rows_of
from mocobot_logs.resample import is_hole

_S = r"(\d{1,12}(?:\.\d*)?|\.\d+)"
_CROP = re.compile(rf"{_S}?:{_S}?", re.ASCII)
_DROP = re.compile(rf"robot=(\d{{1,4}}):{_S}-{_S}", re.ASCII)
_NS_PER_S = 1_000_000_000
LATEST_NS = 10**12 * _NS_PER_S
"""Where a span ends that says no end: later than any log."""


@dataclass(frozen=True)
class Span:
    """Time from ``first_ns`` to ``last_ns`` after the log's start [ns], both included."""

    first_ns: int
    last_ns: int

    @property
    def length_ns(self) -> int:
        """From one end to the other [ns]."""
        return self.last_ns - self.first_ns

    def __str__(self) -> str:
        """Such as "12 to 95 s"."""
        return f"{seconds(self.first_ns)} to {'the end' if self.last_ns >= LATEST_NS else f'{seconds(self.last_ns)} s'}"


@dataclass(frozen=True)
class Drop:
    """Samples of one robot that are left out.

    Attributes:
        robot: counted from 1.
        span: when.
    """

    robot: int
    span: Span

    def __str__(self) -> str:
        """As a user says it."""
        return f"robot={self.robot}:{seconds(self.span.first_ns)}-{seconds(self.span.last_ns)}"


@dataclass(frozen=True)
class Choice:
    """What is wanted of a log.

    Attributes:
        crop: the part that is kept, None for all of it.
        drops: what is left out of it.
    """

    crop: Span | None = None
    drops: tuple[Drop, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything is left out."""
        return self.crop is not None or bool(self.drops)


WHOLE = Choice()
"""All of a log."""


def parse_choice(crop: str | None, drops: Iterable[str] = ()) -> Choice:
    """What is wanted, from the words of the command line.

    Args:
        crop: ``FROM:TO``; either may be missing.
        drops: ``robot=N:FROM-TO`` each.

    Raises:
        InputError: one is not of that form, or ends before it begins.
    """
    return Choice(None if crop is None else _crop(crop), tuple(_drop(drop) for drop in drops))


def seconds(ns: int) -> str:
    """Nanoseconds as seconds, to the last digit and none more."""
    text = f"{Decimal(ns) / _NS_PER_S:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def to_ns(text: str) -> int:
    """Seconds in decimals as nanoseconds, exact down to these."""
    return round(Decimal(text) * _NS_PER_S)


def _crop(text: str) -> Span:
    found = _CROP.fullmatch(text)
    if found is None or text == ":":
        raise InputError(
            f"--crop is {text!r:.60}; it must be FROM:TO in seconds from the log's start, such as 12:95, 12: or :95"
        )
    first, last = found.groups()
    span = Span(to_ns(first or "0"), LATEST_NS if last is None else to_ns(last))
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
    span = Span(to_ns(found[2]), to_ns(found[3]))
    if span.last_ns < span.first_ns:
        raise InputError(f"--drop is {text!r:.60}, which ends before it begins")
    return Drop(int(found[1]), span)


class Piece:
    """What a log has in a span of time, without what is dropped, as a ``LogSource``."""

    def __init__(self, source: LogSource, origin_ns: int, span: Span | None, drops: tuple[Drop, ...]) -> None:
        """Take the log; nothing is read yet.

        Args:
            source: the log.
            origin_ns: stamp from which span and drops count [ns].
            span: what is kept, None for all.
            drops: what is left out.
        """
        self.name = source.name if span is None else f"{source.name} ({span})"
        self.level: Level = source.level
        self.robots, self.channels = source.robots, source.channels
        self.metadata, self.size = source.metadata, source.size
        self.span, self._source, self._origin_ns = span, source, origin_ns
        self._drops = [[d.span for d in drops if d.robot == i + 1] for i in range(source.robots)]

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """As ``LogSource.chunks``; what comes after the span is not read.

        Raises:
            InputError: the log is damaged, or holds what its map does not allow.
        """
        passed = [False] * self.robots
        for robot, samples in self._source.chunks(advance):
            after = samples.stamp_ns - self._origin_ns
            keep = np.ones(len(after), bool)
            if self.span is not None:
                keep &= (after >= self.span.first_ns) & (after <= self.span.last_ns)
                passed[robot] |= bool(len(after) and after[-1] > self.span.last_ns)
            for span in self._drops[robot]:
                keep &= (after < span.first_ns) | (after > span.last_ns)
            if keep.any():
                yield robot, samples if keep.all() else rows_of(samples, keep)
            if all(passed):
                return


_LOOK = 1024  # stamps that tell the period


@dataclass(frozen=True)
class Hole:
    """Time without samples that is too long to be filled.

    Attributes:
        robot: counted from 1.
        span: from the last sample before to the first one after it.
    """

    robot: int
    span: Span


@dataclass(frozen=True)
class Extent:
    """When a log has samples, by the robots' stamps, in nanoseconds after its start.

    Attributes:
        origin_ns: stamp of the start, the earliest first stamp of all robots [ns].
        whole: from the start to the latest stamp.
        chosen: what of that is kept.
        common: from the latest first to the earliest last sample of the robots, as chosen; None if they have no time
            in common.
        holes: in what is chosen.
        dropped: samples that each of the choice's drops leaves out.
        period_ns: the longest period of a robot's samples [ns].
    """

    origin_ns: int
    whole: Span
    chosen: Span
    common: Span | None
    holes: tuple[Hole, ...]
    dropped: tuple[int, ...]
    period_ns: float


def extent_of(
    source: LogSource, choice: Choice, max_gap_s: float, advance: Callable[[int], object] = lambda _: None
) -> Extent:
    """Look through a log; only its stamps are kept in memory.

    Rows that lack a value are no samples.

    Args:
        source: the log.
        choice: what is wanted of it.
        max_gap_s: longest time without samples beyond one period that is no hole [s].
        advance: takes the progress made, in the source's units.

    Raises:
        InputError: the log is damaged; a drop names no robot or no sample; or the crop leaves a robot without samples.
    """
    for drop in choice.drops:
        if not 1 <= drop.robot <= source.robots:
            raise InputError(
                f"{source.name}: --drop {drop}: there is no robot {drop.robot}; robots are counted from 1 to "
                f"{source.robots}"
            )
    stamps, starts, ends = _stamps(source, advance)
    known = [robot for robot, start in enumerate(starts) if start is not None]
    if not known:
        raise InputError(f"{source.name}: has no samples")
    origin_ns = min(starts[robot] for robot in known)  # type: ignore[type-var]
    whole = Span(0, max(ends[robot] for robot in known) - origin_ns)
    after = [np.asarray(each - origin_ns) for each in stamps]  # wraps for what the screen refuses
    if choice.crop is not None and choice.crop.first_ns > whole.last_ns:
        raise InputError(
            f"{source.name}: --crop {choice.crop}: the log ends {seconds(whole.last_ns)} s after its start"
        )
    dropped = []
    keep = [_inside(each, choice.crop) if choice.crop else np.ones(len(each), bool) for each in after]
    for drop in choice.drops:
        out = _inside(after[drop.robot - 1], drop.span)
        if not out.any():
            raise InputError(
                f"{source.name}: --drop {drop}: robot {drop.robot} has no samples then{_range(after[drop.robot - 1])}"
            )
        dropped.append(int(out.sum()))
        keep[drop.robot - 1] &= ~out
    chosen = [each[mask] for each, mask in zip(after, keep, strict=True)]
    for robot, each in enumerate(chosen, 1):
        if choice and not len(each):
            raise InputError(
                f"{source.name}: what --crop and --drop leave holds no sample of robot {robot}"
                f"{_range(after[robot - 1])}"
            )
    periods = [_period_ns(each) for each in chosen]
    holes = [
        Hole(robot, Span(int(each[k]), int(each[k + 1])))
        for robot, (each, period) in enumerate(zip(chosen, periods, strict=True), 1)
        for k in np.flatnonzero(is_hole(np.diff(each), period, max_gap_s))
    ]
    window = whole
    if choice.crop is not None:
        window = Span(choice.crop.first_ns, min(choice.crop.last_ns, whole.last_ns))
    return Extent(origin_ns, whole, window, _common(chosen), tuple(holes), tuple(dropped), max(periods))


def _stamps(
    source: LogSource, advance: Callable[[int], object]
) -> tuple[list[Stamps], list[int | None], list[int]]:
    """Stamps of every robot's whole rows, its first stamp of all, and its last."""
    parts: list[list[Stamps]] = [[np.empty(0, np.int64)] for _ in range(source.robots)]
    starts: list[int | None] = [None] * source.robots
    ends = [0] * source.robots
    for robot, samples in source.chunks(advance):
        if not len(samples.stamp_ns):
            continue
        if starts[robot] is None:
            starts[robot] = int(samples.stamp_ns[0])
        ends[robot] = int(samples.stamp_ns[-1])
        parts[robot].append(samples.stamp_ns[~np.isnan(samples.values).any(axis=1)])
    return [np.concatenate(each) for each in parts], starts, ends


def _inside(after_ns: Stamps, span: Span) -> NDArray[np.bool_]:
    return (after_ns >= span.first_ns) & (after_ns <= span.last_ns)


def _range(after_ns: Stamps) -> str:
    if not len(after_ns):
        return "; it has none at all"
    return f"; its samples go from {seconds(int(after_ns[0]))} to {seconds(int(after_ns[-1]))} s"


def _period_ns(after_ns: Stamps) -> float:
    steps = np.diff(after_ns[:_LOOK])
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 1.0


def _common(chosen: list[Stamps]) -> Span | None:
    if not all(map(len, chosen)):
        return None
    first, last = max(int(each[0]) for each in chosen), min(int(each[-1]) for each in chosen)
    return Span(first, last) if first < last else None


SHORTEST_NS = 9_500_000_000
"""Shortest part that becomes a trial [ns]: of what resampling leaves (it may take 0.1 s at either end), ``estimate``
and ``diagnose`` leave out 2 s at either end for their filters, and a diagnosis needs 5 s of the rest."""

UNEVEN_NS = 100_000_000
"""Robots that begin or end so much apart are told of [ns]."""
UNEVEN = "not all robots have samples"


@dataclass(frozen=True)
class Omission:
    """Time of a log that is in no recording.

    Attributes:
        span: after the log's start.
        robot: whose samples are left out, from 1, or None for all robots.
        samples: how many of them, where they were counted.
        why: in words.
    """

    span: Span
    robot: int | None
    samples: int | None
    why: str


def omissions(extent: Extent, choice: Choice) -> list[Omission]:
    """What a choice leaves out of a log."""
    out = []
    if extent.chosen.first_ns > 0:
        out.append(Omission(Span(0, extent.chosen.first_ns), None, None, "cropped"))
    if extent.chosen.last_ns < extent.whole.last_ns:
        out.append(Omission(Span(extent.chosen.last_ns, extent.whole.last_ns), None, None, "cropped"))
    return out + [
        Omission(drop.span, drop.robot, count, "dropped")
        for drop, count in zip(choice.drops, extent.dropped, strict=True)
    ]


def split(extent: Extent) -> tuple[list[Span], list[Omission]]:
    """Spans in which every robot has samples without a hole, and what lies between them.

    A hole in one robot's samples is one for all: forces and motions of a team mean something together only.

    Args:
        extent: of the log.

    Returns:
        The spans, however short, and the rest, each in order.
    """
    if extent.common is None:
        return [], []
    at, last = extent.common.first_ns, extent.common.last_ns
    spans, out = [], []
    if at - extent.chosen.first_ns > UNEVEN_NS:
        out.append(Omission(Span(extent.chosen.first_ns, at), None, None, UNEVEN))
    holes = sorted(extent.holes, key=lambda hole: (hole.span.first_ns, hole.span.last_ns))
    for hole in holes:
        start, end = hole.span.first_ns, hole.span.last_ns
        if end < at or start >= last:
            continue
        if start > at:
            spans.append(Span(at, start))
        out.append(Omission(hole.span, None, None, f"robot {hole.robot} has no samples"))
        at = max(at, end)
    if last > at:
        spans.append(Span(at, last))
    if extent.chosen.last_ns - last > UNEVEN_NS:
        out.append(Omission(Span(last, extent.chosen.last_ns), None, None, UNEVEN))
    return spans, out
