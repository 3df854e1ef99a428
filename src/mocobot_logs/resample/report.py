"""What resampling found in a robot's stream, and what it did to it."""

from dataclasses import asdict, dataclass
from typing import Any

from estimator.recording.metadata import Method


@dataclass(frozen=True)
class StreamReport:
    """One robot's stream.

    Attributes:
        robot: number of the robot, from 1.
        samples: rows of the log, duplicates and repeats included.
        first_ns, last_ns: its first and its last stamp [ns].
        native_hz: rate of its samples [Hz], dropped ones counted in.
        jitter_rms_s, jitter_max_s: how far intervals between stamps are from whole periods [s].
        gaps: intervals in which samples are missing.
        longest_gap_s: the longest time without samples beyond one period [s].
        filled: samples that are missing and were interpolated, at the native rate.
        blank: rows in which a channel is NaN: dropped, so that they are among the missing samples.
        blank_channels: the channels that are NaN there, by the number of rows.
        duplicates: rows that repeat the row before, stamp and values; dropped.
        repeats: rows that repeat the row before but for the stamp: one reading; dropped, so that they are among the
            missing samples where the rate is theirs.
        merged: rows closer than a quarter of a period to the row before; averaged with it.
        method: what was done.
        steps: rounding step of every sensor's channel, 0 for none [SI].
    """

    robot: int
    samples: int
    first_ns: int
    last_ns: int
    native_hz: float
    jitter_rms_s: float
    jitter_max_s: float
    gaps: int
    longest_gap_s: float
    filled: int
    blank: int
    blank_channels: dict[str, int]
    duplicates: int
    repeats: int
    merged: int
    method: Method
    steps: tuple[float, ...]

    @property
    def filled_share(self) -> float:
        """Missing samples over all that there should be."""
        return self.filled / max(1, self.filled + self.samples - self.blank - self.duplicates - self.repeats)

    def to_dict(self) -> dict[str, Any]:
        """Plain values by name."""
        return asdict(self) | {"filled_share": self.filled_share}
