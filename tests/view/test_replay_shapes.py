"""What is drawn has MuJoCo's shape, place and colour."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from estimator.arm.delta import inverse_kinematics
from mocobot_sim.scene.models import models_dir, omnid_design, payload_path
from mocobot_view.robot import PATHS, body_motion, robot_shapes
from mocobot_view.shapes import Triangles, body_shape, box, capsule, cylinder, ellipsoid, join
from omnid_design import DESIGN

SOLIDS = {
    "box": (box([0.1, 0.2, 0.3]), 8 * 0.1 * 0.2 * 0.3),
    "ellipsoid": (ellipsoid([0.1, 0.2, 0.3]), 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
    "capsule": (capsule(0.1, 0.3), np.pi * 0.01 * 0.6 + 4 / 3 * np.pi * 1e-3),
    "cylinder": (cylinder(0.1, 0.3), np.pi * 0.01 * 0.6),
    "two": (
        join([box([0.1, 0.2, 0.3]), box([0.1, 0.1, 0.1]).moved([1.0, 0, 0], np.eye(3))]),
        8 * (6e-3 + 1e-3),
    ),
}


def volume(mesh: Triangles) -> float:
    """By Gauss's theorem: right only if every face is there and turned outward."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_turned_outward(name: str) -> None:
    mesh, true = SOLIDS[name]
    assert volume(mesh) == pytest.approx(true, rel=1e-12 if name in ("box", "two") else 0.04)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1.0)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    face = np.cross(b - a, c - a)
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    cosine = np.einsum("fj,fkj->fk", face, mesh.normals[mesh.faces])
    assert cosine.min() > np.cos(np.deg2rad(40.0)), "shading goes with the faces"


def nearest_surfaces(model: mujoco.MjModel, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """What a ray from 1 mm above each point, back along the normal, travels to a geom's surface [m], by MuJoCo.

    Of all geoms, the one whose surface is nearest to the point counts.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    start, best = points + 1e-3 * normals, np.full(len(points), np.inf)
    for g in range(model.ngeom):
        kind = model.geom_type[g]
        frame = data.geom_xpos[g], data.geom_xmat[g], model.geom_size[g]
        for k in range(len(points)):
            ray = start[k], -normals[k]
            if kind == mujoco.mjtGeom.mjGEOM_MESH:
                hit = mujoco.mj_rayMesh(model, data, g, *ray, None)
            else:
                hit = mujoco.mju_rayGeom(*frame, *ray, kind)
            if abs(hit - 1e-3) < abs(best[k] - 1e-3):
                best[k] = hit
    return best


def check_on_surfaces(model: mujoco.MjModel, bodies: list[int], every: int = 7) -> None:
    """Points of the mesh's faces, close to their corners, lie on MuJoCo's surfaces; facets are flat between them."""
    shape = body_shape(model, bodies)
    assert shape is not None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mesh = shape.triangles.moved(data.xpos[bodies[0]], data.xmat[bodies[0]].reshape(3, 3))
    corners = mesh.vertices[mesh.faces[::every]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = 0.999 * corners[:, 0] + 0.001 * corners.mean(axis=1)
    assert len(points) > 5
    assert nearest_surfaces(model, points, normals) == pytest.approx(1e-3, abs=2e-5)


@pytest.mark.parametrize(
    "body", ["chassis", "wheel_rear_left", "base", "proximal2", "rod3", "platform", "ring"]
)
def test_robot_has_mujocos_surfaces(body: str) -> None:
    model = mujoco.MjModel.from_xml_path(str(models_dir() / "omnid" / "omnid.xml"))
    check_on_surfaces(model, [model.body(body).id])


def test_payload_has_mujocos_surfaces() -> None:
    model = mujoco.MjModel.from_xml_path(str(payload_path("a")))
    check_on_surfaces(model, [model.body("payload").id], every=23)


TETRAHEDRON = """
<mujoco><asset><mesh name="t" vertex="0 0 0  0.3 0 0  0 0.2 0  0 0 0.1"/>
<material name="m" rgba="0.2 0.4 0.6 1"/></asset><worldbody><body name="b" pos="1 2 3" euler="10 20 30">
<geom type="mesh" mesh="t" material="m"/><geom type="sphere" size="0.05" pos="1 0 0" rgba="0 1 0 1" material="m"/>
<geom type="ellipsoid" size="0.1 0.2 0.3" pos="2 0 0" euler="0 90 0"/>
<geom type="box" size="1 1 1" group="3"/><geom type="box" size="1 1 1" rgba="1 0 0 0"/></body></worldbody></mujoco>
"""


def test_meshes_materials_and_hidden_geoms() -> None:
    model = mujoco.MjModel.from_xml_string(TETRAHEDRON)
    check_on_surfaces(model, [1], every=1)
    shape = body_shape(model, [1])
    assert shape is not None
    assert np.abs(shape.triangles.vertices[:, 0]).max() < 2.4, "group 3 and the invisible are left out"
    colours = {tuple(rgba) for rgba in shape.rgba.tolist()}
    assert colours == {(51, 102, 153, 255), (0, 255, 0, 255), (128, 128, 128, 255)}
    mesh = [k for k, rgba in enumerate(shape.rgba.tolist()) if rgba[0] == 51]
    part = Triangles(shape.triangles.vertices[mesh], shape.triangles.normals[mesh], shape.triangles.faces[:4])
    assert volume(part) == pytest.approx(0.3 * 0.2 * 0.1 / 6, rel=1e-5)


def test_body_without_geoms_has_no_shape() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body name='b'/></worldbody></mujoco>")
    assert body_shape(model, [1]) is None


def test_every_moving_body_of_the_robot_is_drawn() -> None:
    assert set(robot_shapes(omnid_design()).moving) == set(PATHS)


def test_another_design_is_drawn_with_its_own_lengths() -> None:
    design = replace(
        DESIGN, base_radius_m=0.25, proximal_length_m=0.3, rod_length_m=0.5, platform_radius_m=0.1
    )
    shapes = robot_shapes(design)
    link, rod = shapes.moving["proximal1"].triangles.vertices, shapes.moving["rod3"].triangles.vertices
    radius = 0.014, 0.006
    assert [link[:, 0].min(), link[:, 0].max()] == pytest.approx([-radius[0], 0.3 + radius[0]])
    assert [rod[:, 0].min(), rod[:, 0].max()] == pytest.approx([-radius[1], 0.5 + radius[1]])
    home = np.array([[[0.0, 0.0, 0.5]]])
    motion = body_motion(inverse_kinematics(home, design), np.zeros((1, 1, 3)), design)
    assert motion.wrist == pytest.approx(home)
    standing = shapes.standing.triangles.vertices
    plate = standing[np.abs(standing[:, 2] + 0.051125) < 0.0048]
    radii = np.linalg.norm(plate[:, :2], axis=1)
    assert np.isclose(radii, 0.20 + 0.07).sum() >= 48, "rims of the base plate"
