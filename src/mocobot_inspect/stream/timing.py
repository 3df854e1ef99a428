"""A robot's stamps: rate, jitter, gaps, duplicates, time that runs backwards."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocobot_logs.log import NS, Samples

GAP = 1.5
"""Intervals longer than this many periods lack samples."""
_FIRST = 4096  # intervals that tell the period


@dataclass(frozen=True)
class Timing:
    """Stamps of one robot.

    Attributes:
        samples: rows of the log, without those that repeat the one before.
        first_ns, last_ns: first and last stamp in the log's order [ns], None without rows.
        rate_hz: samples per second between gaps [Hz], or None.
        jitter_rms_s, jitter_max_s: how far intervals are from the period, gaps left out [s].
        gaps: intervals that lack samples.
        missing: samples that they lack.
        longest_gap_s, longest_gap_at_s: longest such interval, and when it begins after the first stamp [s].
        duplicates: stamps that repeat the one before.
        repeats: rows that repeat the one before but for the stamp; they are no samples.
        backwards: stamps earlier than the one before.
        farthest_back_s, farthest_back_at_s: by how much at most, and when the one before is, after the first [s].
        recorder_s: smallest and largest lead of the recorder's time over the stamps [s], or None.
    """

    samples: int
    first_ns: int | None
    last_ns: int | None
    rate_hz: float | None
    jitter_rms_s: float
    jitter_max_s: float
    gaps: int
    missing: int
    longest_gap_s: float
    longest_gap_at_s: float
    duplicates: int
    repeats: int
    backwards: int
    farthest_back_s: float
    farthest_back_at_s: float
    recorder_s: tuple[float, float] | None

    @property
    def duration_s(self) -> float:
        """From the first to the last stamp [s]."""
        return 0.0 if self.first_ns is None or self.last_ns is None else (self.last_ns - self.first_ns) * NS


class TimingTally:
    """Counts stamps as they come; memory does not grow with the log."""

    def __init__(self) -> None:
        """Start without any."""
        self._samples = self._repeats = self._gaps = self._missing = self._duplicates = self._backwards = (
            self._regular
        ) = 0
        self._first_ns: int | None = None
        self._last_ns: int | None = None
        self._period_s: float | None = None
        self._back = self._back_at = 0.0
        self._regular_s = self._squares = self._worst = self._longest = self._longest_at = 0.0
        self._early: list[NDArray] = []
        self._recorder: tuple[float, float] | None = None

    def add(self, samples: Samples) -> None:
        """Count the stamps of a chunk, and the recorder's times where there are."""
        stamp_ns, log_ns = samples.stamp_ns, samples.log_ns
        if not len(stamp_ns):
            return
        self._repeats += int(samples.repeats.sum())
        if log_ns is not None:
            lead = (log_ns - stamp_ns) * NS
            low, high = float(lead.min()), float(lead.max())
            known = self._recorder
            self._recorder = (low, high) if known is None else (min(low, known[0]), max(high, known[1]))
        if self._first_ns is None:
            self._first_ns, before = int(stamp_ns[0]), stamp_ns[:-1]
            intervals, at = np.diff(stamp_ns) * NS, (before - self._first_ns) * NS
        else:
            assert self._last_ns is not None
            before = np.concatenate([[self._last_ns], stamp_ns[:-1]])
            intervals, at = (stamp_ns - before) * NS, (before - self._first_ns) * NS
        self._samples += len(stamp_ns)
        self._last_ns = int(stamp_ns[-1])
        self._early.append(np.stack([intervals, at]))
        if self._period_s is not None or sum(part.shape[1] for part in self._early) >= _FIRST:
            self._settle()

    def _settle(self) -> None:
        """Count the intervals that are waiting for the period."""
        intervals, at = np.concatenate(self._early, axis=1) if self._early else np.zeros((2, 0))
        self._early = []
        forward = intervals > 0
        if self._period_s is None and forward.any():
            self._period_s = float(np.median(intervals[forward]))
        self._duplicates += int(np.sum(intervals == 0))
        self._backwards += int(np.sum(intervals < 0))
        if len(intervals) and -np.min(intervals) > self._back:
            k = int(np.argmin(intervals))
            self._back, self._back_at = -float(intervals[k]), float(at[k])
        if self._period_s is None:
            return
        regular = forward & (intervals <= GAP * self._period_s)
        self._regular += int(np.sum(regular))
        self._regular_s += float(np.sum(intervals[regular]))
        off = intervals[regular] - self._period_s
        self._squares += float(np.sum(off**2))
        self._worst = max(self._worst, float(np.max(np.abs(off), initial=0.0)))
        gap = intervals > GAP * self._period_s
        if gap.any():
            self._gaps += int(np.sum(gap))
            self._missing += int(np.sum(np.maximum(np.rint(intervals[gap] / self._period_s) - 1, 1)))
            k = int(np.argmax(intervals))
            if intervals[k] > self._longest:
                self._longest, self._longest_at = float(intervals[k]), float(at[k])

    def finish(self) -> Timing:
        """What was counted."""
        self._settle()
        mean_s = self._regular_s / self._regular if self._regular else None
        return Timing(
            samples=self._samples,
            first_ns=self._first_ns,
            last_ns=self._last_ns,
            rate_hz=1.0 / mean_s if mean_s else None,
            jitter_rms_s=float(np.sqrt(self._squares / max(self._regular, 1))),
            jitter_max_s=self._worst,
            gaps=self._gaps,
            missing=self._missing,
            longest_gap_s=self._longest,
            longest_gap_at_s=self._longest_at,
            duplicates=self._duplicates,
            repeats=self._repeats,
            backwards=self._backwards,
            farthest_back_s=self._back,
            farthest_back_at_s=self._back_at,
            recorder_s=self._recorder,
        )
