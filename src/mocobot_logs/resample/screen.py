"""A robot's rows in order: each a whole, finite sample at a later time than the one before."""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from mocobot_logs.log import NS, Array, Samples, Stamps, rows_of

LONGEST_S = 1e8
"""Three years [s]: whatever lasts longer is two clocks, and nanoseconds of it would overflow."""
LARGEST = 1e100
"""Larger values are no measurements, and arithmetic would overflow."""


class Screen:
    """Drops repeated rows and rows that lack a value, and refuses what no resampling can mend.

    Attributes:
        rows: rows seen.
        repeats: rows among them that repeat the one before but for the stamp: samples that are missing.
        duplicates: rows dropped because they repeat the one before, stamp and values.
        blank: rows dropped because a channel is NaN: samples that are missing.
        blank_channels: how many of them by channel that is.
        first_ns, last_ns: first and last stamp [ns], None before the first row.
        log_ns: first and last time of the recorder [ns], None where the log has none.
    """

    def __init__(self, where: str, channels: tuple[str, ...]) -> None:
        """Take the names that messages need: of the log (and its robot), and of the channels."""
        self.rows = self.repeats = self.duplicates = self.blank = 0
        self.blank_channels: Counter[str] = Counter()
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self.log_ns: tuple[int, int] | None = None
        self._where = where
        self._channels = channels
        self._last: Array | None = None

    def keep(self, samples: Samples) -> tuple[Stamps, Array]:
        """Rows of a chunk that say something new: time since the first row [ns], shape (q,), and values (q, C).

        Raises:
            InputError: a value is infinite, time goes back or leaps, or one stamp has two values.
        """
        lacking = np.isnan(samples.values)
        whole = np.flatnonzero(~lacking.any(axis=1))
        left_out = int(samples.repeats.sum())
        row = (self.rows + np.arange(len(lacking)) + np.cumsum(samples.repeats) - samples.repeats)[whole]
        self.rows += len(lacking) + left_out
        self.repeats += left_out
        self.blank += len(lacking) - len(row)
        for k in np.flatnonzero(lacking.any(axis=0)):
            self.blank_channels[self._channels[k]] += int(lacking[:, k].sum())
        if not len(row):
            return samples.stamp_ns[:0], samples.values[:0]
        if len(row) < len(lacking):
            samples = rows_of(samples, whole)
        stamp, values = samples.stamp_ns, samples.values
        self._note(samples)
        before = np.concatenate([[stamp[0] if self.last_ns is None else self.last_ns], stamp[:-1]])
        above = np.concatenate([(values[0] if self._last is None else self._last)[None], values[:-1]])
        same = stamp == before
        same[0] &= self._last is not None
        repeats = same & np.all(values == above, axis=1)
        finite = _is_number(values).all(axis=1)
        bad = ~finite | (stamp < before) | (same & ~repeats) | self._leaps(stamp, before)
        if bad.any():
            k = int(np.argmax(bad))
            self._refuse(int(row[k]), stamp[k], before[k], values[k], above[k])
        self.duplicates += int(repeats.sum())
        self.last_ns, self._last = int(stamp[-1]), values[-1]
        assert self.first_ns is not None
        return stamp[~repeats] - self.first_ns, values[~repeats]

    def _note(self, samples: Samples) -> None:
        if self.first_ns is None:
            self.first_ns = int(samples.stamp_ns[0])
        if samples.log_ns is not None:
            first = int(samples.log_ns[0]) if self.log_ns is None else self.log_ns[0]
            self.log_ns = first, int(samples.log_ns[-1])

    def _leaps(self, stamp: Stamps, before: Stamps) -> NDArray[np.bool_]:
        """Whether time moves on by more than any log lasts; as floats, which do not overflow."""
        assert self.first_ns is not None
        return np.abs(stamp.astype(float) - before.astype(float)) > LONGEST_S / NS

    def _refuse(self, row: int, stamp: np.int64, before: np.int64, values: Array, above: Array) -> None:
        assert self.first_ns is not None
        here = f"row {row}, {_seconds(int(stamp) - self.first_ns)} s after its first sample"
        faulty = np.flatnonzero(~_is_number(values))
        if len(faulty):
            raise InputError(
                f"{self._where}: {self._channels[faulty[0]]} is {values[faulty[0]]} in {here}; "
                f"every value must be a finite number, smaller than {LARGEST:g} (--drop leaves samples out)"
            )
        if stamp < before:
            raise InputError(
                f"{self._where}: time runs back by {_seconds(int(before) - int(stamp))} s in {here}; "
                "stamps must increase"
            )
        if stamp == before:
            c = int(np.flatnonzero(values != above)[0])
            raise InputError(
                f"{self._where}: {self._channels[c]} is {above[c]:.9g} and {values[c]:.9g} at one time, "
                f"in {here}; a repeated stamp must repeat all values (are the stamps too coarse?)"
            )
        raise InputError(
            f"{self._where}: time leaps by {_seconds(int(stamp) - int(before))} s in {here}; "
            "all stamps of a robot must come from one clock"
        )


def _is_number(values: Array) -> NDArray[np.bool_]:
    return np.abs(values) < LARGEST  # false for NaN


def _seconds(ns: int) -> str:
    return f"{ns * NS:.9g}"
