"""Triangle meshes of MuJoCo's primitives and of the visible geometry of bodies, for drawing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from mocobot_sim.scene.models import posed

AROUND = 24
"""Number of facets around an axis. Chosen: a rod of 6 mm then deviates by 0.05 mm from a cylinder."""
ALONG = 6  # number of rows of facets from the equator of a half sphere to its pole. Chosen.


@dataclass(frozen=True)
class Triangles:
    """A triangle mesh."""

    vertices: Array  # corners [m], shape (V, 3)
    normals: Array  # outward unit normals at the corners, shape (V, 3)
    faces: NDArray[np.uint32]  # corners of the triangles, counter-clockwise seen from outside, shape (F, 3)

    def moved(self, position: ArrayLike, R: ArrayLike) -> Triangles:
        """Return the mesh rotated by R, shape (3, 3), and then shifted by ``position`` [m], shape (3,)."""
        R = np.asarray(R, dtype=float)
        return Triangles(self.vertices @ R.T + np.asarray(position), self.normals @ R.T, self.faces)


def join(meshes: list[Triangles]) -> Triangles:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Triangles(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]).astype(
            np.uint32
        ),
    )


def box(half: ArrayLike) -> Triangles:
    """Make a box with half sizes ``half`` [m], shape (3,)."""
    corners = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float)
    up = Triangles(corners, np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    turns = [("x", 0.0), ("x", 90.0), ("x", 180.0), ("x", 270.0), ("y", 90.0), ("y", 270.0)]
    cube = join(
        [up.moved(np.zeros(3), Rotation.from_euler(*turn, degrees=True).as_matrix()) for turn in turns]
    )
    return Triangles(cube.vertices * np.asarray(half, dtype=float), cube.normals, cube.faces)


def ellipsoid(semi_axes: ArrayLike) -> Triangles:
    """Make an ellipsoid with semi-axes [m], shape (3,)."""
    ball = _revolved(*_arc(1.0, -np.pi / 2, np.pi / 2, 2 * ALONG))
    scale = np.asarray(semi_axes, dtype=float)
    normals = ball.normals / scale
    return Triangles(
        ball.vertices * scale, normals / np.linalg.norm(normals, axis=1, keepdims=True), ball.faces
    )


def capsule(radius: float, half_length: float) -> Triangles:
    """Make a capsule along z: a cylinder of length 2 ``half_length`` [m] with half spheres of ``radius`` [m]."""
    low, low_normal = _arc(radius, -np.pi / 2, 0.0, ALONG)
    high, high_normal = _arc(radius, 0.0, np.pi / 2, ALONG)
    shift = np.array([0.0, half_length])
    ends = np.concatenate([low - shift, high + shift])
    return _revolved(ends, np.concatenate([low_normal, high_normal]))


def cylinder(radius: float, half_length: float) -> Triangles:
    """Make a cylinder along z with length 2 ``half_length`` [m]."""
    low, high = -half_length, half_length
    side = _revolved(np.array([[radius, low], [radius, high]]), np.array([[1.0, 0.0], [1.0, 0.0]]))
    bottom = _revolved(np.array([[0.0, low], [radius, low]]), np.array([[0.0, -1.0], [0.0, -1.0]]))
    top = _revolved(np.array([[radius, high], [0.0, high]]), np.array([[0.0, 1.0], [0.0, 1.0]]))
    return join([side, bottom, top])


def _arc(radius: float, start: float, stop: float, rows: int) -> tuple[Array, Array]:
    """Return points (distance from the axis, height) of an arc from latitude ``start`` to ``stop``, and normals."""
    latitude = np.linspace(start, stop, rows + 1)
    normals = np.stack([np.cos(latitude), np.sin(latitude)], axis=1)
    return radius * normals, normals


def _revolved(profile: Array, normals: Array) -> Triangles:
    """Make the surface of revolution of a profile (distance from the z axis, height), listed upward, shape (P, 2)."""
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


VISIBLE_GROUPS = (0, 1, 2)
"""Geom groups that MuJoCo's viewer shows by default; the others are by convention for collisions."""
_PLAIN = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)
"""MuJoCo's default colour, which marks a geom that takes the colour of its material."""
_PRIMITIVES: dict[mujoco.mjtGeom, Callable[[Array], Triangles]] = {
    mujoco.mjtGeom.mjGEOM_BOX: box,
    mujoco.mjtGeom.mjGEOM_SPHERE: lambda size: ellipsoid(np.full(3, size[0])),
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: ellipsoid,
    mujoco.mjtGeom.mjGEOM_CAPSULE: lambda size: capsule(size[0], size[1]),
    mujoco.mjtGeom.mjGEOM_CYLINDER: lambda size: cylinder(size[0], size[1]),
}


@dataclass(frozen=True)
class Shape:
    """A coloured mesh."""

    triangles: Triangles  # mesh in the frame of its body [m]
    rgba: NDArray[np.uint8]  # colours of the vertices, shape (V, 4), uint8

    @classmethod
    def of(cls, triangles: Triangles, rgba: tuple[float, float, float, float] | Array) -> Shape:
        """Make a shape in one colour with components from 0 to 1."""
        colour = np.clip(np.round(255.0 * np.asarray(rgba, dtype=float)), 0, 255).astype(np.uint8)
        return cls(triangles, np.tile(colour, (len(triangles.vertices), 1)))

    def in_colour(self, rgb: tuple[int, int, int]) -> Shape:
        """Return the same mesh in another colour with components from 0 to 255."""
        return Shape(self.triangles, np.tile(np.array([*rgb, 255], dtype=np.uint8), (len(self.rgba), 1)))


def body_shape(
    model: mujoco.MjModel, bodies: list[int], frame: tuple[Array, Array] | None = None
) -> Shape | None:
    """Collect the visible geometry of bodies without relative motion; None if there is none.

    Planes, height fields and signed distance fields are left out. The colour of the material replaces textures.
    ``frame`` is position (3,) [m] and rotation (3, 3) of the frame of the result at ``qpos0``; by default that of the
    first body.
    """
    data = posed(model)
    origin, R = frame or (data.xpos[bodies[0]].copy(), data.xmat[bodies[0]].reshape(3, 3).copy())
    meshes, colours = [], []
    for g in range(model.ngeom):
        if model.geom_bodyid[g] not in bodies or model.geom_group[g] not in VISIBLE_GROUPS:
            continue
        rgba = _colour(model, g)
        mesh = _triangles(model, g)
        if mesh is None or rgba[3] == 0:
            continue
        pose = R.T @ (data.geom_xpos[g] - origin), R.T @ data.geom_xmat[g].reshape(3, 3)
        meshes.append(mesh.moved(*pose))
        colours.append(Shape.of(mesh, rgba).rgba)
    return Shape(join(meshes), np.concatenate(colours)) if meshes else None


def _triangles(model: mujoco.MjModel, g: int) -> Triangles | None:
    kind = mujoco.mjtGeom(int(model.geom_type[g]))
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[g]))
    return _PRIMITIVES[kind](model.geom_size[g]) if kind in _PRIMITIVES else None


def _mesh(model: mujoco.MjModel, m: int) -> Triangles:
    """Convert a mesh asset; each corner of each face becomes a vertex, because MuJoCo indexes normals separately."""
    first, faces = model.mesh_vertadr[m], model.mesh_face[model.mesh_faceadr[m] :][: model.mesh_facenum[m]]
    first_normal = model.mesh_normaladr[m]
    of_normals = model.mesh_facenormal[model.mesh_faceadr[m] :][: model.mesh_facenum[m]]
    return Triangles(
        model.mesh_vert[first + faces.ravel()].astype(float),
        model.mesh_normal[first_normal + of_normals.ravel()].astype(float),
        np.arange(faces.size, dtype=np.uint32).reshape(-1, 3),
    )


def _colour(model: mujoco.MjModel, g: int) -> Array:
    """Return the RGBA with which MuJoCo draws a geom: its own colour if set, else that of its material."""
    material = int(model.geom_matid[g])
    own = model.geom_rgba[g]
    return model.mat_rgba[material] if material >= 0 and np.array_equal(own, _PLAIN) else own
