"""Camera of a picture, and marks drawn over the model: lines, arrows, ellipsoids, labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import root_scalar

from estimator.arrays import Array
from mocobot_sim.scene.models import posed
from mocobot_view.shapes import VISIBLE_GROUPS

if TYPE_CHECKING:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text
    from matplotlib.transforms import Bbox

MARGIN = 0.04  # empty margin at each side, as a share of the picture. Chosen.
NEAREST = 0.1
"""Smallest distance of the camera from the nearest point, relative to the spread of the points. Chosen."""
TURNS = (0.0, *(sign * turn for turn in range(15, 180, 15) for sign in (-1, 1)), 180.0)
"""Azimuth offsets that ``clearest`` compares [deg]; the first of equally good ones wins."""
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


@dataclass(frozen=True)
class Camera:
    """Pose of MuJoCo's free camera.

    Attributes:
        lookat: point in the middle of the picture [m], three numbers.
        distance: distance of the camera from that point [m].
        azimuth, elevation: direction of view [deg].
    """

    lookat: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float

    def axes(self) -> Array:
        """Return the directions right, up and forward in the world as rows, shape (3, 3)."""
        a, e = np.deg2rad([self.azimuth, self.elevation])
        forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([np.sin(a), -np.cos(a), 0.0])
        return np.array([right, np.cross(right, forward), forward])


def corners(model: mujoco.MjModel, qpos: Array) -> Array:
    """Return the corners of the bounding boxes of all visible geoms except planes [m], shape (K, 3)."""
    data = posed(model, qpos)
    seen = np.isin(model.geom_group, VISIBLE_GROUPS) & (model.geom_rbound > 0)  # planes are unbounded
    boxes = model.geom_aabb[seen]
    local = boxes[:, None, :3] + CORNERS * boxes[:, None, 3:]
    R = data.geom_xmat[seen].reshape(-1, 3, 3)
    return (data.geom_xpos[seen][:, None] + np.einsum("gij,gkj->gki", R, local)).reshape(-1, 3)


def framing(points: ArrayLike, azimuth: float, elevation: float, aspect: float, fovy_deg: float) -> Camera:
    """Place the camera as near as possible so that all points lie in the picture, with a margin.

    A point at (x, y, z) in the axes of the camera lies in the picture if |x - c| <= t (d + z). Here t is the tangent
    of half the angle of view, d the distance and c the shift of the camera. Two points determine d; the shift then
    centres the points.

    Args:
        points: points that must be visible [m], shape (K, 3).
        azimuth, elevation: direction of view [deg].
        aspect: width over height of the picture.
        fovy_deg: vertical angle of view [deg].
    """
    axes = Camera((0.0, 0.0, 0.0), 1.0, azimuth, elevation).axes()
    x, y, z = axes @ np.asarray(points, dtype=float).T
    tangent = (1.0 - 2.0 * MARGIN) * np.tan(0.5 * np.deg2rad(fovy_deg))
    sides = (x / (aspect * tangent), y / tangent)
    spread = float(np.linalg.norm([np.ptp(x), np.ptp(y), np.ptp(z)])) or 1.0
    least = NEAREST * spread - float(z.min())
    distance = max(least, *(0.5 * float(np.max(side - z) + np.max(-side - z)) for side in sides))
    shift = [_middle(across, z + distance) for across in (x, y)]
    lookat = np.array(shift) @ axes[:2]
    return Camera((float(lookat[0]), float(lookat[1]), float(lookat[2])), float(distance), azimuth, elevation)


def clearest(
    points: ArrayLike, feet: Array, azimuth: float, elevation: float, aspect: float, fovy_deg: float
) -> Camera:
    """Choose the camera of ``framing`` from which robots at ``feet`` (N, 3) [m] hide each other least.

    ``azimuth`` is the preferred direction of view [deg].
    """

    def apart(camera: Camera) -> float:
        """Smallest distance of two robots in the picture; widths count double, because robots are tall."""
        at = [2.0, 1.0] * pixels(camera, feet, aspect, 1.0, fovy_deg)
        return min((float(np.linalg.norm(a - b)) for a, b in combinations(at, 2)), default=0.0)

    return max((framing(points, azimuth + turn, elevation, aspect, fovy_deg) for turn in TURNS), key=apart)


def _middle(across: Array, depth: Array) -> float:
    """Find the shift c that centres the points: max (x - c) / depth = -min (x - c) / depth."""

    def excess(c: float) -> float:
        seen = (across - c) / depth
        return float(seen.max() + seen.min())

    low, high = float(across.min()), float(across.max())
    return low if low == high else float(root_scalar(excess, bracket=(low, high)).root)


def pixels(camera: Camera, points: ArrayLike, width: float, height: float, fovy_deg: float) -> Array:
    """Project points in the world [m], shape (K, 3), into a picture.

    Returns columns from the left and rows from the top [px], shape (K, 2); NaN for points behind the camera.
    """
    x, y, z = camera.axes() @ (np.reshape(np.asarray(points, dtype=float), (-1, 3)) - camera.lookat).T
    depth = np.where(z + camera.distance > 0, z + camera.distance, np.nan)
    focal = 0.5 * height / np.tan(0.5 * np.deg2rad(fovy_deg))
    return np.stack([0.5 * width + focal * x / depth, 0.5 * height - focal * y / depth], axis=1)


@dataclass(frozen=True)
class Label:
    """A short text at a point."""

    text: str  # text of a few letters
    point: tuple[float, float, float]  # position in the world [m], three numbers
    rgb: tuple[int, int, int]  # colour, components from 0 to 255


@dataclass
class Marks:
    """Lines, arrows, ellipsoids and labels to draw into a picture, in world coordinates.

    Attributes:
        lines: rows of two end points [m], radius [m] and colour (red, green, blue, opacity): 11 numbers each.
        arrows: rows of the same form, for arrows from the first point to the second.
        ellipsoids: rows of centre [m], rotation matrix row by row, semi-axes [m] and colour: 19 numbers each.
        labels: texts, drawn in front of everything.
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
        """Add an ellipsoid with centre and semi-axes [m], shapes (3,), and rotation R to the world, shape (3, 3)."""
        turn = np.eye(3) if R is None else np.asarray(R, dtype=float)
        size = np.broadcast_to(np.asarray(semi_axes, dtype=float), 3)
        self.ellipsoids.append([*np.asarray(centre, dtype=float), *turn.ravel(), *size, *rgba])

    def points(self) -> NDArray[np.float64]:
        """Return the ends of lines and arrows, the centres of ellipsoids and the labels [m], shape (K, 3)."""
        rows = [row[k : k + 3] for row in (*self.lines, *self.arrows) for k in (0, 3)]
        rows += [row[:3] for row in self.ellipsoids] + [list(label.point) for label in self.labels]
        return np.array(rows, dtype=float).reshape(-1, 3)

    def label(self, text: str, point: ArrayLike, rgb: tuple[int, int, int]) -> None:
        """Add a text at a point [m], shape (3,)."""
        x, y, z = (float(part) for part in np.asarray(point, dtype=float))
        self.labels.append(Label(text, (x, y, z), rgb))


SIZE = 0.028
"""Height of the letters relative to that of the picture, but at least ``LEAST_PX`` pixels. Chosen."""
LEAST_PX = 9.0
HALO, HALO_SHARE = "white", 0.25


def with_labels(
    picture: NDArray[np.uint8], labels: Sequence[Label], at: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """Write labels into a picture (height, width, 3), without overlaps.

    ``at`` (K, 2) is column and row of the middle of each text [px], NaN if behind the camera.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # an optional dependency
    from matplotlib.figure import Figure
    from matplotlib.patheffects import withStroke

    inside = [
        (label, x, y)
        for label, (x, y) in zip(labels, at, strict=True)
        if 0 <= x < picture.shape[1] and 0 <= y < picture.shape[0]
    ]
    if not inside:
        return picture
    height, width = picture.shape[:2]
    figure = Figure(figsize=(width / 100.0, height / 100.0), dpi=100.0)
    canvas = FigureCanvasAgg(figure)
    figure.figimage(picture)
    points = 0.72 * max(SIZE * height, LEAST_PX)  # font size in 1/72 inch at 100 dpi
    taken: list[Bbox] = []
    for label, x, y in sorted(inside, key=lambda entry: -entry[2]):
        text = figure.text(
            x / width, 1.0 - y / height, label.text, color=tuple(part / 255.0 for part in label.rgb), fontsize=points,
            fontweight="bold", ha="center", va="center", parse_math=False,
            path_effects=[withStroke(linewidth=HALO_SHARE * points, foreground=HALO)],
        )  # fmt: skip
        _make_room(text, taken, canvas, width, height)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])


def _make_room(text: Text, taken: list[Bbox], canvas: FigureCanvasAgg, width: int, height: int) -> None:
    """Move a text into the picture, and up until it overlaps no earlier text."""
    renderer = canvas.get_renderer()
    rim = 0.5 * HALO_SHARE * float(text.get_fontsize()) * 100.0 / 72.0
    for _ in range(len(taken) + 1):
        box = text.get_window_extent(renderer).padded(rim)
        x, y = text.get_position()
        x += (max(0.0, -box.x0) - max(0.0, box.x1 - width)) / width
        over = [other for other in taken if box.overlaps(other)]
        if over:
            y += (max(other.y1 for other in over) - box.y0 + 1.0) / height
        text.set_position((x, y))
        if not over:
            break
    taken.append(text.get_window_extent(renderer).padded(rim))
