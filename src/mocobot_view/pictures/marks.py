"""What is drawn into a picture beside the model: lines, arrows, ellipsoids and words, in the world."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Label:
    """A word at a point.

    Attributes:
        text: a few letters.
        point: where [m], three numbers.
        rgb: its colour, components from 0 to 255.
    """

    text: str
    point: tuple[float, float, float]
    rgb: tuple[int, int, int]


@dataclass
class Marks:
    """Lines, arrows and ellipsoids drawn into a picture, in the world.

    Attributes:
        lines: rows of two end points [m], radius [m] and colour (red, green, blue, opacity): 11 numbers each.
        arrows: the same for arrows from the first point to the second.
        ellipsoids: rows of centre [m], rotation matrix row by row, semi-axes [m] and colour: 19 numbers each.
        labels: words, in front of everything.
    """

    lines: list[list[float]] = field(default_factory=list)
    arrows: list[list[float]] = field(default_factory=list)
    ellipsoids: list[list[float]] = field(default_factory=list)
    labels: list[Label] = field(default_factory=list)

    def path(self, points: ArrayLike, radius_m: float, rgba: Sequence[float]) -> None:
        """Add a line through points [m], shape (K, 3)."""
        points = np.asarray(points, dtype=float)
        for a, b in pairwise(points):
            self.lines.append([*a, *b, radius_m, *rgba])

    def arrow(self, start: ArrayLike, end: ArrayLike, radius_m: float, rgba: Sequence[float]) -> None:
        """Add an arrow between two points [m], shapes (3,)."""
        self.arrows.append([*np.asarray(start, dtype=float), *np.asarray(end, dtype=float), radius_m, *rgba])

    def ellipsoid(
        self, centre: ArrayLike, semi_axes: ArrayLike, rgba: Sequence[float], R: ArrayLike | None = None
    ) -> None:
        """Add an ellipsoid: centre and semi-axes [m], shapes (3,), and its axes in the world, shape (3, 3)."""
        turn = np.eye(3) if R is None else np.asarray(R, dtype=float)
        size = np.broadcast_to(np.asarray(semi_axes, dtype=float), 3)
        self.ellipsoids.append([*np.asarray(centre, dtype=float), *turn.ravel(), *size, *rgba])

    def points(self) -> NDArray[np.float64]:
        """Ends of lines and arrows, centres of ellipsoids, and labels [m], shape (K, 3)."""
        rows = [row[k : k + 3] for row in (*self.lines, *self.arrows) for k in (0, 3)]
        rows += [row[:3] for row in self.ellipsoids] + [list(label.point) for label in self.labels]
        return np.array(rows, dtype=float).reshape(-1, 3)

    def label(self, text: str, point: ArrayLike, rgb: tuple[int, int, int]) -> None:
        """Add a word at a point [m], shape (3,)."""
        x, y, z = (float(part) for part in np.asarray(point, dtype=float))
        self.labels.append(Label(text, (x, y, z), rgb))
