"""Long recordings in parts, each with bases of its own: time and memory then grow as the recording does, not faster.

What causes leave open, such as friction at every rest, is a number of unknowns that grows with the trial, and to take
them out of its rows costs their square. What is minutes apart has nothing to do with each other but through the
unknowns of all trials, so parts lose nothing; and they can be held out of a fit, which a single trial cannot.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from discrepancy.team.linear.signals import TEAM_TRIM_S
from estimator.recording.model import Recording

PART_S = 180.0
"""Of a recording at most that is looked at as one trial. Chosen: what a trial leaves open costs its square, and ten of
its overlaps are a tenth of that; longer than any trial of the experiment."""


@dataclass(frozen=True, eq=False)
class LaterPart(Recording):
    """A part that begins in motion: its commands cannot be simulated from there."""


def parted(recordings: Sequence[Recording], longest_s: float | None = None) -> list[Recording]:
    """The recordings, long ones in parts of equal length.

    Parts keep the recording's clock. They overlap by what the filters take at their ends, so that all rows are there.

    Args:
        recordings: whole.
        longest_s: of a part [s]; None for that of the rules.
    """
    return [part for recording in recordings for part in _parts(recording, longest_s or PART_S)]


def seconds(recordings: Sequence[Recording]) -> float:
    """How long recordings are together [s]."""
    return sum(len(recording.time) / recording.metadata.rate_hz for recording in recordings)


def _edges(recording: Recording, longest_s: float) -> list[int]:
    """Samples between which the parts are."""
    samples, longest = len(recording.time), longest_s * recording.metadata.rate_hz
    count = max(1, -int(-samples // longest))
    return [round(k * samples / count) for k in range(count + 1)]


def _parts(recording: Recording, longest_s: float) -> list[Recording]:
    edges, trim = _edges(recording, longest_s), round(TEAM_TRIM_S * recording.metadata.rate_hz)
    if len(edges) == 2:
        return [recording]
    out = []
    for k, (start, stop) in enumerate(pairwise(edges)):
        at = slice(max(0, start - trim), stop + trim)
        ref = None if recording.ref is None else recording.ref[at]
        time = np.array(recording.time[at])
        name = f"{recording.name}, {recording.time[start]:.0f} to {recording.time[stop - 1]:.0f} s"
        part = replace(
            recording, time=time, phi=recording.phi[at], theta=recording.theta[at], tau=recording.tau[at], ref=ref,
            name=name,
        )  # fmt: skip
        fields = (part.time, part.phi, part.theta, part.tau, part.ref, part.metadata, part.name)
        out.append(LaterPart(*fields) if k else part)
    return out
