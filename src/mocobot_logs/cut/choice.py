"""What of a log is wanted, as a user says it: ``12:95`` and ``robot=2:30-31``, in seconds from the log's start.

The log's start is the earliest first stamp of its robots. Both ends of a span belong to it.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from estimator.errors import InputError
from mocobot_logs.log import Level, LogSource, Samples, rows_of

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
