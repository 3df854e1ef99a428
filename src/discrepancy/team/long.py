"""Long recordings in parts: some are searched for causes, the others held against what is found."""

from __future__ import annotations

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
"""Longest part of a recording that is one trial: latent states cost the square of its length."""


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


SEARCHED_PARTS, SHORTEST_PART_S = 4, 40.0
"""Least number of parts, and their least length: they predict each other."""

SEARCHED_S, SEARCHED_POWER = 480.0, 1.4
"""Length of recordings that is searched, of three robots; of N robots (3 / N)^power of it."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Some parts of all that there are.

    Attributes:
        recordings: whole.
        longest_s: of a part [s].
        parts: of all of them, in their order.
        taken: numbers of those that are searched, rising.
    """

    recordings: tuple[Recording, ...]
    longest_s: float
    parts: tuple[Recording, ...]
    taken: tuple[int, ...]

    @classmethod
    def of(cls, recordings: Sequence[Recording], *, whole: bool = False) -> Choice:
        """Every part, or of recordings that together are longer than is searched, parts spread evenly over them.

        A search takes time and memory with the length of the data, while what minutes of motion tell of robots and
        causes changes little with more of the same.

        Args:
            recordings: of one team.
            whole: whether to take all parts, however long.
        """
        most_s, total_s = searched_s(recordings[0].metadata.robots), seconds(recordings)
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
        """Numbers of the parts that are not."""
        return tuple(sorted({*range(len(self.parts))} - {*self.taken}))

    def beside(self, more: Iterable[int]) -> Choice:
        """With further parts among those that are searched."""
        return replace(self, taken=tuple(sorted({*self.taken, *more})))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said of it: a sentence for each recording that is cut, or one for all."""
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


def searched_s(robots: int) -> float:
    """How much of long recordings is searched, all together [s]: less of many robots, whose minutes take longer."""
    return SEARCHED_S * (3.0 / robots) ** SEARCHED_POWER


ODD_CHANCE, ODD_FACTOR = 0.01, 1.5
"""False alarm rate of a whole diagnosis at which a part is searched, too, and a factor on that threshold."""

ODD_WINDOW_S = 10.0
"""Length of the windows that are compared with searched parts [s]: a short push, some periods of a motion."""


@dataclass(frozen=True, eq=False)
class Left:
    """Residual of one part, in windows.

    Attributes:
        means: of every channel in every window of motion, shape (w, C).
        rms: about those, shape (w, C).
        holds: mean of every channel in every hold, shape (h, C).
    """

    means: Array
    rms: Array
    holds: Array

    @classmethod
    def of(cls, reduction: Reduction, rows: Array) -> Left:
        """From rows, shape (n, C), in any unit."""
        moving, time = rows[: reduction.moving], reduction.time[: reduction.moving]
        lasts_s = time[-1] - time[0] if len(time) else 0.0
        count = max(1, int(lasts_s / ODD_WINDOW_S))  # equal ones: none is left over at the end
        window = np.minimum((time - time[:1]) / max(lasts_s, 1e-9) * count, count - 1).astype(int)
        # One that holds leave little of tells little.
        parts = [moving[window == k] for k in np.unique(window)]
        full = max(map(len, parts), default=0)
        parts = [part for part in parts if 2 * len(part) >= full]
        none = np.zeros((0, rows.shape[1]))
        means = np.array([part.mean(axis=0) for part in parts]) if parts else none
        rms = np.array([part.std(axis=0) for part in parts]) if parts else none
        return cls(means, rms, rows[reduction.moving :])


def more_left(others: Mapping[int, Left], searched: Sequence[Left]) -> dict[int, float]:
    """By what factor of what is allowed each part leaves more than what was searched; beyond 1 something else is there.

    What was not there to compare with, holds for one, is not compared.

    Args:
        others: parts by their number.
        searched: parts that were.
    """
    worst = dict.fromkeys(others, 0.0)
    for name in ("means", "rms", "holds"):
        known, each = _of(name, searched), {k: _of(name, [left]) for k, left in others.items()}
        count = sum(x.size for x in each.values())
        if len(known) < 2 or not count:
            continue
        # Means are about zero; how loud windows are, about what they are on average, in shares of it.
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
    """How many times as much is left in motion as in what was searched, median of channels; None where all rests."""
    squares = [_of("means", lefts) ** 2 + np.exp(2.0 * _of("rms", lefts)) for lefts in (others, searched)]
    if not all(map(len, squares)):
        return None
    own, known = (np.mean(square, axis=0) for square in squares)
    return float(np.sqrt(np.median(own / np.maximum(known, 1e-300))))


ODD_NAMED = 3
"""How many odd parts that were not searched are named."""

T = TypeVar("T")
RowsLeft = Callable[[Recording], tuple[Reduction, Array]]
"""Rows that what was found leaves in a part, and how they were made."""


def search_parts(
    choice: Choice,
    search: Callable[[list[Recording]], T],
    left_by: Callable[[T], RowsLeft],
    say: Callable[[str], object],
) -> tuple[Choice, T, tuple[str, ...]]:
    """Search the parts that are taken, and those in which more is left than in these, too, until there are none.

    Returns the parts that were searched, the result, and sentences about the others.

    Args:
        choice: the parts, not all of which are taken.
        search: of some.
        left_by: what a result leaves in a part; it raises an ``InputError`` where there are no such robots.
        say: takes the name of the stage that begins.
    """
    most = 2 * len(choice.taken)
    while True:
        searched = search(choice.searched)
        say("hold against the other parts")
        try:
            odd, ratio = _against(choice, left_by(searched))
        except InputError:  # no such robots
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
    """Parts in which more is left than in any that was searched, by number, and by how much all others leave more."""
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
