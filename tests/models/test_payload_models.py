"""The four payload models against Table I of the paper, typed here a second time from the print."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

MODELS = Path(__file__).resolve().parents[2] / "models"

# Table I. Rotations: axis times angle [deg]; positions [m]; mass [kg]; principal moments [kg m^2].
TABLE_I = {
    "a": {
        "R12": (0, 0, 0), "R23": (0, 0, -90), "R31": (0, 0, 90),
        "p12": (0.647, 0.533, 0), "p23": (0.457, -0.838, 0), "p31": (-0.305, -1.105, 0),
        "m": 11.672, "p1c": (0.537, 0.156, 0.072), "R1c": (0.043, 0.085, -84.787),
        "I": (2.318, 3.215, 5.524),
    },
    "b": {
        "R12": (0, 0, 45), "R23": (0, 0, 90), "R31": (0, 0, -135),
        "p12": (-0.686, 0.572, 0), "p23": (0.916, -0.647, 0), "p31": (-0.242, 0.835, 0),
        "m": 11.672, "p1c": (0.034, 0.535, 0.072), "R1c": (0.115, -0.115, 2.465),
        "I": (2.153, 3.390, 5.535),
    },
    "c": {
        "R12": (0, 0, -90), "R23": (0, 0, 45), "R31": (0, 0, 45),
        "p12": (-0.115, -1.143, 0), "p23": (-0.229, 0.800, 0), "p31": (-1.132, 0.162, 0),
        "m": 10.478, "p1c": (0.547, -0.670, 0.057), "R1c": (-1.034, 0.355, -24.643),
        "I": (1.824, 2.438, 4.208),
    },
    "d": {
        "R12": (0, 0, -135), "R23": (0, 0, 45), "R31": (0, 0, 90),
        "p12": (-0.382, 0.800, -0.038), "p23": (-0.485, 0.862, 0.038), "p31": (0.533, -0.571, 0),
        "m": 10.478, "p1c": (0.089, 0.593, 0.055), "R1c": (-1.662, -0.702, 68.937),
        "I": (1.711, 2.122, 3.772),
    },
}  # fmt: skip
EACH = pytest.mark.parametrize("name", list(TABLE_I))


def _pose(rotation_deg, position) -> RigidTransform:
    rotation = Rotation.from_rotvec(np.array(rotation_deg, float), degrees=True)
    return RigidTransform.from_components(np.array(position, float), rotation)


def _load(name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_path(str(MODELS / f"payload_{name}" / "payload.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _site(data: mujoco.MjData, name: str) -> RigidTransform:
    site = data.site(name)
    return RigidTransform.from_components(site.xpos, Rotation.from_matrix(site.xmat.reshape(3, 3)))


def _assert_same(X: RigidTransform, Y: RigidTransform, position: float = 1e-9, angle: float = 1e-9) -> None:
    np.testing.assert_allclose(X.translation, Y.translation, rtol=0, atol=position)
    assert (X.rotation.inv() * Y.rotation).magnitude() < angle


@EACH
def test_inertial_is_table_one(name):
    model, _ = _load(name)
    truth, body = TABLE_I[name], model.body("payload")
    assert abs(body.mass[0] - truth["m"]) < 1e-9
    assert abs(model.body_mass.sum() - truth["m"]) < 1e-9
    np.testing.assert_allclose(body.ipos, truth["p1c"], rtol=0, atol=1e-9)
    R_1c = Rotation.from_quat(body.iquat, scalar_first=True)
    expected = Rotation.from_rotvec(truth["R1c"], degrees=True)
    assert (R_1c.inv() * expected).magnitude() < 1e-9
    # The full matrix too: it is what the dynamics use, whatever the order of the axes.
    I_1 = R_1c.as_matrix() @ np.diag(body.inertia) @ R_1c.as_matrix().T
    truth_1 = expected.as_matrix() @ np.diag(truth["I"]) @ expected.as_matrix().T
    np.testing.assert_allclose(I_1, truth_1, rtol=0, atol=1e-9)


@EACH
def test_com_site_is_the_principal_frame(name):
    _, data = _load(name)
    _assert_same(_site(data, "com"), _pose(TABLE_I[name]["R1c"], TABLE_I[name]["p1c"]))


@EACH
def test_grasp_sites_are_table_one(name):
    _, data = _load(name)
    truth = TABLE_I[name]
    X_1, X_2, X_3 = (_site(data, f"grasp{i}") for i in (1, 2, 3))
    _assert_same(X_1.inv() * X_2, _pose(truth["R12"], truth["p12"]))
    _assert_same(X_3.inv() * X_1, _pose(truth["R31"], truth["p31"]))
    # The print closes its loops only to its rounding: T_23 follows from the other two.
    _assert_same(X_2.inv() * X_3, _pose(truth["R23"], truth["p23"]), position=1.5e-3)


def _geoms(model: mujoco.MjModel) -> list[str]:
    return [model.geom(i).name for i in range(model.ngeom)]


@EACH
def test_visible_shape_weighs_and_touches_nothing(name):
    model, _ = _load(name)
    assert model.ngeom >= 20
    for geom in map(model.geom, _geoms(model)):
        assert (geom.group[0], geom.contype[0], geom.conaffinity[0]) == (2, 0, 0), geom.name
    spec = mujoco.MjSpec.from_file(str(MODELS / f"payload_{name}" / "payload.xml"))
    assert len(spec.geoms) == model.ngeom
    assert all(geom.mass == 0.0 for geom in spec.geoms)
