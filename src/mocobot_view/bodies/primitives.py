"""Triangle meshes of MuJoCo's geometric primitives, centred at the origin, sizes as in MJCF."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from estimator.arrays import Array

AROUND = 24
"""Facets around an axis; a rod of 6 mm then deviates from round by 0.05 mm."""
ALONG = 6
"""Rows of facets from the equator of a half sphere to its pole."""


@dataclass(frozen=True)
class Triangles:
    """A triangle mesh.

    Attributes:
        vertices: corners [m], shape (V, 3).
        normals: outward unit normals at the corners, shape (V, 3).
        faces: corners of the triangles, counter-clockwise seen from outside, shape (F, 3).
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.uint32]

    def moved(self, position: ArrayLike, R: ArrayLike) -> Triangles:
        """The mesh turned by R, shape (3, 3), and then shifted by ``position`` [m], shape (3,)."""
        R = np.asarray(R, dtype=float)
        return Triangles(self.vertices @ R.T + np.asarray(position), self.normals @ R.T, self.faces)


def join(meshes: list[Triangles]) -> Triangles:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Triangles(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]).astype(
            np.uint32
        ),
    )


def box(half: ArrayLike) -> Triangles:
    """A box with half sizes ``half`` [m], shape (3,)."""
    corners = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float)
    up = Triangles(corners, np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    turns = [("x", 0.0), ("x", 90.0), ("x", 180.0), ("x", 270.0), ("y", 90.0), ("y", 270.0)]
    cube = join(
        [up.moved(np.zeros(3), Rotation.from_euler(*turn, degrees=True).as_matrix()) for turn in turns]
    )
    return Triangles(cube.vertices * np.asarray(half, dtype=float), cube.normals, cube.faces)


def ellipsoid(semi_axes: ArrayLike) -> Triangles:
    """An ellipsoid with semi-axes [m], shape (3,)."""
    ball = _revolved(*_arc(1.0, -np.pi / 2, np.pi / 2, 2 * ALONG))
    scale = np.asarray(semi_axes, dtype=float)
    normals = ball.normals / scale
    return Triangles(
        ball.vertices * scale, normals / np.linalg.norm(normals, axis=1, keepdims=True), ball.faces
    )


def capsule(radius: float, half_length: float) -> Triangles:
    """A cylinder along z of length 2 ``half_length`` with half spheres of ``radius`` [m] on its ends."""
    low, low_normal = _arc(radius, -np.pi / 2, 0.0, ALONG)
    high, high_normal = _arc(radius, 0.0, np.pi / 2, ALONG)
    shift = np.array([0.0, half_length])
    ends = np.concatenate([low - shift, high + shift])
    return _revolved(ends, np.concatenate([low_normal, high_normal]))


def cylinder(radius: float, half_length: float) -> Triangles:
    """A cylinder along z of length 2 ``half_length`` [m]."""
    low, high = -half_length, half_length
    side = _revolved(np.array([[radius, low], [radius, high]]), np.array([[1.0, 0.0], [1.0, 0.0]]))
    bottom = _revolved(np.array([[0.0, low], [radius, low]]), np.array([[0.0, -1.0], [0.0, -1.0]]))
    top = _revolved(np.array([[radius, high], [0.0, high]]), np.array([[0.0, 1.0], [0.0, 1.0]]))
    return join([side, bottom, top])


def _arc(radius: float, start: float, stop: float, rows: int) -> tuple[Array, Array]:
    """Points (distance from the axis, height) of a circle from one latitude to another, and their normals."""
    latitude = np.linspace(start, stop, rows + 1)
    normals = np.stack([np.cos(latitude), np.sin(latitude)], axis=1)
    return radius * normals, normals


def _revolved(profile: Array, normals: Array) -> Triangles:
    """The surface of a profile (distance from the z axis, height), listed upward outside, shape (P, 2)."""
    azimuth = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    circle = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)

    def around(rows: Array) -> Array:
        ring = rows[:, None, :1] * circle
        return np.concatenate([ring, np.broadcast_to(rows[:, None, 1:], (*ring.shape[:2], 1))], axis=2)

    row, k = np.meshgrid(np.arange(len(profile) - 1), np.arange(AROUND), indexing="ij")
    a, b = row * AROUND + k, row * AROUND + (k + 1) % AROUND
    c, d = b + AROUND, a + AROUND
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    vertices = around(profile).reshape(-1, 3)
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return Triangles(
        vertices, around(normals).reshape(-1, 3), faces[area > 1e-9 * area.max()].astype(np.uint32)
    )
