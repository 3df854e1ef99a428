"""What else may be in a named cause's place, and how probable that is."""

from dataclasses import dataclass

import numpy as np

from discrepancy.engine.explanation import Found


@dataclass(frozen=True)
class Instead:
    """Probabilities that add up to 1 with that of the cause.

    Attributes:
        rivals: of every listed rival, in the order of ``Found.rivals``.
        nothing: that there is nothing in its place.
        unlisted: that something is there that is not in the catalogue, and looks like it.
    """

    rivals: tuple[float, ...]
    nothing: float
    unlisted: float

    @classmethod
    def of(cls, found: Found) -> "Instead":
        """What ``engine.probability`` weighs against a cause: what is so many nats less likely, by so much less."""
        gaps = np.array([*(gap for _, gap in found.rivals), found.over_nothing], dtype=float)
        listed = found.probability * np.exp(-np.clip(gaps, -50.0, 700.0))
        rest = 1.0 - found.probability - float(listed.sum())
        return cls(tuple(map(float, listed[:-1])), float(listed[-1]), max(rest, 0.0))
