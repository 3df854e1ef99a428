"""Split long recordings into parts: search some for causes, and compare the others with the result."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
from scipy.special import stdtrit

from discrepancy.team.linear.rows import Reduction
from discrepancy.team.linear.signals import TEAM_TRIM_S
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.recording.model import Recording

PART_S = 180.0
"""Longest part of a recording that is one trial [s]. Chosen: the cost of latent states is quadratic in its length."""


@dataclass(frozen=True, eq=False)
class LaterPart(Recording):
    """A part that begins in motion, so that its commands cannot be simulated."""


def parted(recordings: Sequence[Recording], longest_s: float | None = None) -> list[Recording]:
    """Split long recordings into parts of equal length.

    Parts keep the recording's clock. They overlap by the transients of the filters, so that no rows are lost.

    Args:
        recordings: whole.
        longest_s: longest part [s]; None for ``PART_S``.
    """
    return [part for recording in recordings for part in _parts(recording, longest_s or PART_S)]


def seconds(recordings: Sequence[Recording]) -> float:
    """Total duration of recordings [s]."""
    return sum(len(recording.time) / recording.metadata.rate_hz for recording in recordings)


def _edges(recording: Recording, longest_s: float) -> list[int]:
    """Sample indices of the boundaries between parts."""
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
        ref, base = (None if x is None else x[at] for x in (recording.ref, recording.base))
        time = np.array(recording.time[at])
        name = f"{recording.name}, {recording.time[start]:.0f} to {recording.time[stop - 1]:.0f} s"
        part = replace(
            recording, time=time, phi=recording.phi[at], theta=recording.theta[at], tau=recording.tau[at], ref=ref,
            base=base, name=name,
        )  # fmt: skip
        fields = (part.time, part.phi, part.theta, part.tau, part.ref, part.metadata, part.name, part.base)
        out.append(LaterPart(*fields) if k else part)
    return out


SEARCHED_PARTS, SHORTEST_PART_S = 4, 40.0
"""Least number of parts, and their least length [s]. Chosen: parts cross-validate each other."""

WHOLE_S, SEARCHED_S, SEARCHED_POWER = 480.0, 180.0, 1.4
"""Duration of three robots up to which everything is searched, and that is searched of longer recordings [s]; N robots
scale both by (3 / N)^power. Chosen."""


@dataclass(frozen=True, eq=False)
class Choice:
    """A selection of parts.

    Attributes:
        recordings: whole.
        longest_s: longest part [s].
        parts: all parts in order.
        taken: indices of the parts that are searched, increasing.
    """

    recordings: tuple[Recording, ...]
    longest_s: float
    parts: tuple[Recording, ...]
    taken: tuple[int, ...]

    @classmethod
    def of(cls, recordings: Sequence[Recording], *, whole: bool = False) -> Choice:
        """Select every part, or evenly spread parts if ``searched_s`` is less than the recordings last.

        The cost of a search grows with the length of the data, while more of the same motion adds little information.

        Args:
            recordings: of one team.
            whole: whether to select all parts, however long.
        """
        total_s = seconds(recordings)
        most_s = searched_s(recordings[0].metadata.robots, total_s)
        everything = whole or total_s <= most_s
        longest_s = PART_S
        if not everything:
            longest_s = min(max(most_s / SEARCHED_PARTS, SHORTEST_PART_S), longest_s)
        parts = tuple(parted(recordings, longest_s))
        count = len(parts) if everything else min(max(2, int(most_s * len(parts) / total_s)), len(parts))
        taken = tuple(k * len(parts) // count for k in range(count))
        return cls(tuple(recordings), longest_s, parts, taken)

    @property
    def searched(self) -> list[Recording]:
        """The parts that are searched."""
        return [self.parts[k] for k in self.taken]

    @property
    def others(self) -> tuple[int, ...]:
        """Indices of the parts that are not searched."""
        return tuple(sorted({*range(len(self.parts))} - {*self.taken}))

    def beside(self, more: Iterable[int]) -> Choice:
        """Add parts to the search."""
        return replace(self, taken=tuple(sorted({*self.taken, *more})))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the report: a sentence for each recording that is split, or one for all."""
        if self.others:
            about = seconds(self.searched) / 60.0, seconds(self.recordings) / 60.0
            return (
                f"{len(self.taken)} parts, {about[0]:.1f} of {about[1]:.1f} minutes, were searched for causes, and "
                f"what was found was held against the other {len(self.others)} parts; where trials are numbered, the "
                "searched parts count.",
            )
        counts = [(recording, len(parted([recording], self.longest_s))) for recording in self.recordings]
        return tuple(
            f"{recording.name} is long, and was looked at in {count} parts; only the commands of its first part were "
            "simulated again, and where trials are numbered, parts count."
            for recording, count in counts
            if count > 1
        )


def searched_s(robots: int, total_s: float = math.inf) -> float:
    """Duration that is searched of recordings [s]; it falls with the number of robots, which makes minutes costlier."""
    scale = (3.0 / robots) ** SEARCHED_POWER
    return total_s if total_s <= WHOLE_S * scale else SEARCHED_S * scale


ODD_CHANCE, ODD_FACTOR = 0.01, 1.5
"""False alarm rate per diagnosis at which another part is searched, and a safety factor on that threshold. Chosen."""

ODD_WINDOW_S = 10.0
"""Length of the windows that are compared [s]. Chosen: a short push, or some periods of a motion."""


@dataclass(frozen=True, eq=False)
class Left:
    """Residual statistics of one part, in windows.

    Attributes:
        means: mean of every channel in every window of motion, shape (w, C).
        rms: standard deviation within every window, shape (w, C).
        holds: mean of every channel in every hold, shape (h, C).
    """

    means: Array
    rms: Array
    holds: Array

    @classmethod
    def of(cls, reduction: Reduction, rows: Array) -> Left:
        """Compute the statistics of rows, shape (n, C), in any unit."""
        moving, time = rows[: reduction.moving], reduction.time[: reduction.moving]
        lasts_s = time[-1] - time[0] if len(time) else 0.0
        count = max(1, int(lasts_s / ODD_WINDOW_S))  # equal windows leave no remainder
        window = np.minimum((time - time[:1]) / max(lasts_s, 1e-9) * count, count - 1).astype(int)
        # Drop windows that consist mostly of holds.
        parts = [moving[window == k] for k in np.unique(window)]
        full = max(map(len, parts), default=0)
        parts = [part for part in parts if 2 * len(part) >= full]
        none = np.zeros((0, rows.shape[1]))
        means = np.array([part.mean(axis=0) for part in parts]) if parts else none
        rms = np.array([part.std(axis=0) for part in parts]) if parts else none
        return cls(means, rms, rows[reduction.moving :])


def more_left(others: Mapping[int, Left], searched: Sequence[Left]) -> dict[int, float]:
    """Residual of each part over the allowed residual; a value above 1 indicates another cause.

    Statistics that the searched parts lack, such as those of holds, are not compared.

    Args:
        others: parts that were not searched, by index.
        searched: parts that were searched.
    """
    worst = dict.fromkeys(others, 0.0)
    for name in ("means", "rms", "holds"):
        known, each = _of(name, searched), {k: _of(name, [left]) for k, left in others.items()}
        count = sum(x.size for x in each.values())
        if len(known) < 2 or not count:
            continue
        # Means are compared with zero, standard deviations with their average in the logarithm.
        middle = known.mean(axis=0) if name == "rms" else np.zeros(known.shape[1])
        scale = np.sqrt(np.sum((known - middle) ** 2, axis=0) / (len(known) - (name == "rms")))
        allowed = -ODD_FACTOR * stdtrit(len(known) - 1, 0.5 * ODD_CHANCE / count)
        for k, x in each.items():
            away = (x - middle if name == "rms" else np.abs(x)) / np.maximum(scale, 1e-300)
            worst[k] = max(worst[k], float(away.max(initial=0.0) / allowed))
    return worst


def _of(name: str, lefts: Sequence[Left]) -> Array:
    """One statistic of all windows of some parts, shape (w, C)."""
    x = np.concatenate([getattr(left, name) for left in lefts])
    return np.log(np.maximum(x, 1e-300)) if name == "rms" else x


def times_as_much(others: Sequence[Left], searched: Sequence[Left]) -> float | None:
    """Ratio of the residual in motion to that of the searched parts, median over channels; None without motion."""
    squares = [_of("means", lefts) ** 2 + np.exp(2.0 * _of("rms", lefts)) for lefts in (others, searched)]
    if not all(map(len, squares)):
        return None
    own, known = (np.mean(square, axis=0) for square in squares)
    return float(np.sqrt(np.median(own / np.maximum(known, 1e-300))))


ODD_NAMED = 3
"""Number of conspicuous parts that a note names. Chosen."""

T = TypeVar("T")
RowsLeft = Callable[[Recording], tuple[Reduction, Array]]
"""Residual rows of a part under the result of a search, and their reduction."""


def search_parts(
    choice: Choice,
    search: Callable[[list[Recording]], T],
    left_by: Callable[[T], RowsLeft],
    say: Callable[[str], object],
) -> tuple[Choice, T, tuple[str, ...]]:
    """Search the selected parts, then add and search parts with a larger residual until there are none.

    Args:
        choice: the parts, not all of which are selected.
        search: searches some parts.
        left_by: residual of a part under a result; raises an ``InputError`` if no such robots can exist.
        say: takes the name of each stage.

    Returns:
        The selection, the result, and notes about the other parts.
    """
    most = 2 * len(choice.taken)
    while True:
        searched = search(choice.searched)
        say("hold against the other parts")
        try:
            odd, ratio = _against(choice, left_by(searched))
        except InputError:  # no such robots can exist
            note = "What was found is no team that can be, so it was not held against the other parts."
            return choice, searched, (note,)
        room = most - len(choice.taken)
        if not odd or room <= 0:
            return choice, searched, _said(choice, odd, ratio)
        worst = sorted(odd, key=lambda k: -odd[k])[:room]
        choice = choice.beside(worst)
        if not choice.others:
            return choice, search(choice.searched), ()


def _against(choice: Choice, left_by: RowsLeft) -> tuple[dict[int, float], float | None]:
    """Parts with a larger residual than the searched ones, by index, and the overall ratio of the residuals."""
    left = {k: Left.of(*left_by(part)) for k, part in enumerate(choice.parts)}
    known = [left[k] for k in choice.taken]
    others = {k: left[k] for k in choice.others}
    odd = {k: by for k, by in more_left(others, known).items() if by > 1.0}
    return odd, times_as_much(list(others.values()), known)


def _said(choice: Choice, odd: dict[int, float], ratio: float | None) -> tuple[str, ...]:
    searched = "the parts that were not searched"
    notes = [] if ratio is None else [
        f"In {searched} what was found leaves {ratio:.2f} times as much as in those that were."
    ]  # fmt: skip
    if not odd:
        return (*notes, f"In none of {searched} is so much more left that something else had to be there.")
    worst = sorted(odd, key=lambda k: -odd[k])
    names = "; ".join(choice.parts[k].name for k in worst[:ODD_NAMED])
    more = f", and {len(odd) - ODD_NAMED} more" if len(odd) > ODD_NAMED else ""
    return (
        *notes,
        f"Something else is in {len(odd)} of {searched}: {names}{more}. Diagnose these by themselves, or all with "
        "--whole.",
    )
