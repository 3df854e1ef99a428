"""The arms' numbers as MuJoCo compiles them are those that their pages cite."""

from __future__ import annotations

import math
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

MODELS = Path(__file__).resolve().parents[2] / "models"
JOINTS = {"tx40": 6, "panda": 7}


def numbers(cell: str) -> list[float]:
    """Numbers of a table's cell, pi among them."""
    values = {"pi": math.pi, "-pi": -math.pi, "pi/2": math.pi / 2, "-pi/2": -math.pi / 2}
    return [values[word] if word in values else float(word) for word in cell.split()]


def table(name: str, first: str) -> dict[str, list[list[float]]]:
    """Rows of the table of a page whose header begins with a word, by name."""
    page = (MODELS / name / "README.md").read_text(encoding="utf-8")
    body = re.search(rf"^\| {first} \|.*\n\|[-|]+\n((?:\|.*\n)+)", page, re.MULTILINE)
    assert body is not None
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in body[1].splitlines()]
    return {row[0].strip("`"): [numbers(cell) for cell in row[1:]] for row in rows}


@pytest.fixture(params=list(JOINTS))
def arm(request) -> tuple[str, mujoco.MjModel]:
    path = MODELS / request.param / f"{request.param}.xml"
    return request.param, mujoco.MjModel.from_xml_path(str(path))


def test_joints_stand_where_the_page_says(arm) -> None:
    name, model = arm
    rows = table(name, "joint")
    assert len(rows) == model.njnt == JOINTS[name]
    for joint, (xyz, rpy, limits, effort) in rows.items():
        found = model.joint(joint)
        body = int(found.bodyid[0])
        np.testing.assert_allclose(model.body_pos[body], xyz, atol=1e-12)
        w, x, y, z = model.body_quat[body]
        # URDF: roll about x, then pitch about y, then yaw about z, all of the parent.
        wanted = Rotation.from_euler("xyz", rpy)
        assert (Rotation.from_quat([x, y, z, w]) * wanted.inv()).magnitude() < 1e-9, joint
        np.testing.assert_allclose(found.axis, [0, 0, 1])
        np.testing.assert_allclose(found.pos, 0)
        np.testing.assert_allclose(found.range, limits)
        np.testing.assert_allclose(model.jnt_actfrcrange[found.id], [-effort[0], effort[0]])
        assert model.dof_armature[found.id] == model.dof_frictionloss[found.id] == 0
        assert np.all(model.dof_damping[found.id] == 0)


def test_inertias_are_those_of_the_page(arm) -> None:
    name, model = arm
    rows = table(name, "link")
    assert len(rows) == JOINTS[name]
    for link, (mass, centre, *yaw, inertia) in rows.items():
        body = model.body(link)
        np.testing.assert_allclose(body.mass, mass)
        np.testing.assert_allclose(body.ipos, centre, atol=1e-12)
        xx, yy, zz, xy, xz, yz = inertia
        given = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        R = Rotation.from_euler("z", yaw[0][0]).as_matrix() if yaw else np.eye(3)
        w, x, y, z = body.iquat
        P = Rotation.from_quat([x, y, z, w]).as_matrix()
        assumed = 4.1e-5 if not given.any() else 0.0  # link 6 of the TX40: MuJoCo takes no inertia of zero
        np.testing.assert_allclose(
            P @ np.diag(body.inertia) @ P.T, R @ given @ R.T, rtol=1e-9, atol=1e-9 + assumed
        )


def test_pendulum_needs_its_weight_times_its_arm() -> None:
    """Held level it takes m g l; hanging, nothing; its inertia is that of a point."""
    model = mujoco.MjModel.from_xml_path(str(MODELS / "xl330" / "xl330.xml"))
    data = mujoco.MjData(model)
    for angle in (0.0, 0.3, math.pi / 2, -math.pi / 2):
        data.qpos[:] = angle
        data.qacc[:] = 2.0
        mujoco.mj_inverse(model, data)
        inertia = 0.49 * 0.10**2
        expected = 0.49 * 9.81 * 0.10 * math.sin(angle) + 2.0 * inertia
        assert data.qfrc_inverse[0] == pytest.approx(expected, rel=3e-4, abs=3e-6)
