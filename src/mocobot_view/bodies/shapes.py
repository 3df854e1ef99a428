"""The visible geometry of a MuJoCo body as one coloured mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from mocobot_sim.scene.models import posed
from mocobot_view.bodies.primitives import Triangles, box, capsule, cylinder, ellipsoid, join

VISIBLE_GROUPS = (0, 1, 2)
"""Geom groups that MuJoCo's own viewer shows; the others are by custom for collisions."""
_PLAIN = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)
"""Colour of a geom that sets none: then its material's counts."""
_PRIMITIVES: dict[mujoco.mjtGeom, Callable[[Array], Triangles]] = {
    mujoco.mjtGeom.mjGEOM_BOX: box,
    mujoco.mjtGeom.mjGEOM_SPHERE: lambda size: ellipsoid(np.full(3, size[0])),
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: ellipsoid,
    mujoco.mjtGeom.mjGEOM_CAPSULE: lambda size: capsule(size[0], size[1]),
    mujoco.mjtGeom.mjGEOM_CYLINDER: lambda size: cylinder(size[0], size[1]),
}


@dataclass(frozen=True)
class Shape:
    """A coloured mesh.

    Attributes:
        triangles: in the frame it belongs to [m].
        rgba: colours of the vertices, shape (V, 4), uint8.
    """

    triangles: Triangles
    rgba: NDArray[np.uint8]

    @classmethod
    def of(cls, triangles: Triangles, rgba: tuple[float, float, float, float] | Array) -> Shape:
        """A mesh in one colour, components from 0 to 1."""
        colour = np.clip(np.round(255.0 * np.asarray(rgba, dtype=float)), 0, 255).astype(np.uint8)
        return cls(triangles, np.tile(colour, (len(triangles.vertices), 1)))

    def in_colour(self, rgb: tuple[int, int, int]) -> Shape:
        """The same mesh in another colour, components from 0 to 255."""
        return Shape(self.triangles, np.tile(np.array([*rgb, 255], dtype=np.uint8), (len(self.rgba), 1)))


def body_shape(
    model: mujoco.MjModel, bodies: list[int], frame: tuple[Array, Array] | None = None
) -> Shape | None:
    """Everything visible of some bodies that do not move against each other, or None if there is nothing.

    Planes, height fields and signed distance fields are left out; textures become their material's colour.

    Args:
        model: compiled model.
        bodies: body ids.
        frame: position [m], (3,), and rotation, (3, 3), of the frame to express it in, at ``qpos0``; None for the
            frame of the first body.
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
    """A mesh asset; every corner of every face gets its own normal, because MuJoCo indexes the two apart."""
    first, faces = model.mesh_vertadr[m], model.mesh_face[model.mesh_faceadr[m] :][: model.mesh_facenum[m]]
    first_normal = model.mesh_normaladr[m]
    of_normals = model.mesh_facenormal[model.mesh_faceadr[m] :][: model.mesh_facenum[m]]
    return Triangles(
        model.mesh_vert[first + faces.ravel()].astype(float),
        model.mesh_normal[first_normal + of_normals.ravel()].astype(float),
        np.arange(faces.size, dtype=np.uint32).reshape(-1, 3),
    )


def _colour(model: mujoco.MjModel, g: int) -> Array:
    """RGBA as MuJoCo draws it: the geom's own colour if it sets one, else its material's."""
    material = int(model.geom_matid[g])
    own = model.geom_rgba[g]
    return model.mat_rgba[material] if material >= 0 and np.array_equal(own, _PLAIN) else own
