"""Parts of a log between its holes."""

from dataclasses import dataclass

from mocobot_logs.cut.choice import Choice, Span
from mocobot_logs.cut.extent import Extent

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
