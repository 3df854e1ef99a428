"""Which parts of long recordings are searched for causes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from discrepancy.team.long.parts import PART_S, parted, seconds
from estimator.recording.model import Recording

SEARCHED_PARTS, SHORTEST_PART_S = 4, 40.0
"""How many parts at least those are, and how long at least. Chosen: they can be held out of each other's fit, and are
spread over the recording; several ways of a random motion, and twenty times what the filters leave out."""

SEARCHED_S, SEARCHED_POWER = 480.0, 1.4
"""Of recordings of three robots together that is searched for causes; of N robots (3 / N)^power of it. Chosen: a
minute and a half of CPU. Measured: a minute of three robots takes 10 s, of ten 53 s (docs/commands/performance.md)."""


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
