"""MuJoCo's free camera: from where to look so that everything is in the picture, and where points lie in it."""

from dataclasses import dataclass
from itertools import combinations

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import root_scalar

from estimator.arrays import Array
from mocobot_sim.scene.models import posed
from mocobot_view.bodies.shapes import VISIBLE_GROUPS

MARGIN = 0.04
"""Share of the picture that stays free at each side."""
NEAREST = 0.1
"""Least distance of the camera from the nearest point, over the points' spread."""
TURNS = (0.0, *(sign * turn for turn in range(15, 180, 15) for sign in (-1, 1)), 180.0)
"""Other directions that ``clearest`` tries [deg]; the first of equal ones is taken."""
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


@dataclass(frozen=True)
class Camera:
    """From where to look: MuJoCo's free camera.

    Attributes:
        lookat: point in the middle of the picture [m], three numbers.
        distance: from there [m].
        azimuth, elevation: direction of view [deg].
    """

    lookat: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float

    def axes(self) -> Array:
        """Right, up and forward in the world, rows of shape (3, 3)."""
        a, e = np.deg2rad([self.azimuth, self.elevation])
        forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([np.sin(a), -np.cos(a), 0.0])
        return np.array([right, np.cross(right, forward), forward])


def corners(model: mujoco.MjModel, qpos: Array) -> Array:
    """Corners of the boxes around all that is visible of a model and moves or stands on the floor [m], shape (K, 3)."""
    data = posed(model, qpos)
    seen = np.isin(model.geom_group, VISIBLE_GROUPS) & (model.geom_rbound > 0)  # planes have no bound
    boxes = model.geom_aabb[seen]
    local = boxes[:, None, :3] + CORNERS * boxes[:, None, 3:]
    R = data.geom_xmat[seen].reshape(-1, 3, 3)
    return (data.geom_xpos[seen][:, None] + np.einsum("gij,gkj->gki", R, local)).reshape(-1, 3)


def framing(points: ArrayLike, azimuth: float, elevation: float, aspect: float, fovy_deg: float) -> Camera:
    """The nearest camera of a direction that has all points in the picture, with a margin around.

    Across the picture a point at (x, y, z) in the camera's axes is inside if |x - c| <= t (d + z), with t the tangent
    of half the angle of view: two points decide on d. Everything is then shifted into the middle of the picture.

    Args:
        points: what must be seen [m], shape (K, 3).
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
    """The camera of ``framing`` from where robots hide each other least, as near to a direction as that allows.

    Args:
        points, elevation, aspect, fovy_deg: as for ``framing``.
        feet: where the robots stand [m], shape (N, 3).
        azimuth: direction of view that is preferred [deg].
    """

    def apart(camera: Camera) -> float:
        """Least distance of two robots in the picture, widths counting double, because robots are tall."""
        at = [2.0, 1.0] * pixels(camera, feet, aspect, 1.0, fovy_deg)
        return min((float(np.linalg.norm(a - b)) for a, b in combinations(at, 2)), default=0.0)

    return max((framing(points, azimuth + turn, elevation, aspect, fovy_deg) for turn in TURNS), key=apart)


def _middle(across: Array, depth: Array) -> float:
    """Shift c that leaves as much room on one side as on the other: max (x - c) / depth = -min (x - c) / depth."""

    def excess(c: float) -> float:
        seen = (across - c) / depth
        return float(seen.max() + seen.min())

    low, high = float(across.min()), float(across.max())
    return low if low == high else float(root_scalar(excess, bracket=(low, high)).root)


def pixels(camera: Camera, points: ArrayLike, width: float, height: float, fovy_deg: float) -> Array:
    """Where points lie in a picture: columns from the left and rows from the top, NaN if behind; shape (K, 2).

    Args:
        camera: from where.
        points: [m], shape (K, 3).
        width, height: of the picture.
        fovy_deg: vertical angle of view [deg].
    """
    x, y, z = camera.axes() @ (np.reshape(np.asarray(points, dtype=float), (-1, 3)) - camera.lookat).T
    depth = np.where(z + camera.distance > 0, z + camera.distance, np.nan)
    focal = 0.5 * height / np.tan(0.5 * np.deg2rad(fovy_deg))
    return np.stack([0.5 * width + focal * x / depth, 0.5 * height - focal * y / depth], axis=1)
