"""One look through a log's stamps: where it begins and ends, where samples are missing, what a choice leaves out."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.cut.choice import Choice, Span, seconds
from mocobot_logs.log import LogSource, Stamps
from mocobot_logs.resample.tally import is_hole

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
