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
UP = np.array([0.0, 0.0, 1.0])
PAIRS = [("a", "b"), ("c", "d")]
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
def test_body_frame_is_grasp_1_and_has_no_joint(name):
    model, data = _load(name)
    assert model.nbody == 2
    assert model.njnt == 0, "the scene decides how the payload moves"
    _assert_same(_site(data, "grasp1"), RigidTransform.identity())


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


def _distance(model: mujoco.MjModel, data: mujoco.MjData, geom: str, point: np.ndarray) -> float:
    """Distance from a point to a box or an upright cylinder [m], negative inside."""
    shape, view = model.geom(geom), data.geom(geom)
    local = view.xmat.reshape(3, 3).T @ (point - view.xpos)
    if shape.type[0] == mujoco.mjtGeom.mjGEOM_CYLINDER:
        outside = np.array([np.hypot(local[0], local[1]), abs(local[2])]) - shape.size[:2]
    else:
        assert shape.type[0] == mujoco.mjtGeom.mjGEOM_BOX
        outside = np.abs(local) - shape.size
    return float(np.linalg.norm(np.maximum(outside, 0)) + min(outside.max(), 0))


@EACH
def test_visible_shape_reaches_each_grasp_without_burying_it(name):
    model, data = _load(name)
    for i in (1, 2, 3):
        nearest = min(_distance(model, data, geom, data.site(f"grasp{i}").xpos) for geom in _geoms(model))
        # The gimbal flange comes from below up to 30 mm over the wrist centre.
        assert 0.0299 < nearest < 0.060
        plate, post = f"adapter{i}_plate", f"adapter{i}_post"
        top = data.geom(plate).xpos[2] + model.geom(plate).size[2]
        bottom = data.geom(post).xpos[2] - model.geom(post).size[1]
        assert abs(top - bottom) < 1e-6


@EACH
def test_each_adapter_post_ends_in_a_bar(name):
    model, data = _load(name)
    bars = _bars(model)
    for i in (1, 2, 3):
        post = f"adapter{i}_post"
        top = data.geom(post).xpos + model.geom(post).size[1] * UP
        assert min(_distance(model, data, bar, top) for bar in bars) < 1e-3


def _bars(model: mujoco.MjModel) -> list[str]:
    details = ("_slot_side", "_slot_top", "_cap", "_plate", "_post")
    bars = [geom for geom in _geoms(model) if not geom.endswith(details)]
    assert len(bars) == 5
    return bars


def _extent_in_structure(model: mujoco.MjModel, data: mujoco.MjData, bar: str):
    """Centre and half size of a bar along the axes of the structure frame {k}."""
    X_k = _site(data, "structure")
    centre = X_k.inv().apply(data.geom(bar).xpos)
    R_kg = X_k.rotation.as_matrix().T @ data.geom(bar).xmat.reshape(3, 3)
    return centre, np.abs(R_kg @ model.geom(bar).size)


@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_both_configurations_of_a_structure_have_the_same_bars(first, second):
    (model_1, data_1), (model_2, data_2) = _load(first), _load(second)
    assert _bars(model_1) == _bars(model_2)
    for bar in _bars(model_1):
        one, two = (_extent_in_structure(m, d, bar) for m, d in ((model_1, data_1), (model_2, data_2)))
        np.testing.assert_allclose(one[0], two[0], rtol=0, atol=1e-6, err_msg=bar)
        np.testing.assert_allclose(one[1], two[1], rtol=0, atol=1e-6, err_msg=bar)
        np.testing.assert_allclose(sorted(one[1])[:2], 0.01905, rtol=0, atol=1e-9)


ADAPTER_KG = 0.61  # mass of a grasp adapter that makes both configurations of each structure agree (README)


@EACH
def test_uniform_bars_with_adapters_come_close_to_table_one(name):
    """The README's claim about the drawn frame: it could be the thing that Table I describes."""
    model, data = _load(name)
    truth, mass, points = TABLE_I[name], [], []
    bars = _bars(model)
    length = {bar: 2 * model.geom(bar).size.max() for bar in bars}
    per_metre = (truth["m"] - 3 * ADAPTER_KG) / sum(length.values())
    for bar in bars:
        # Two half-weights at +- L / (2 sqrt 3) have a thin uniform rod's moments.
        axis = data.geom(bar).xmat.reshape(3, 3)[:, np.argmax(model.geom(bar).size)]
        for side in (-1, 1):
            points.append(data.geom(bar).xpos + side * axis * length[bar] / np.sqrt(12))
            mass.append(per_metre * length[bar] / 2)
    for i in (1, 2, 3):
        points.append(data.site(f"grasp{i}").xpos + 0.035 * UP)
        mass.append(ADAPTER_KG)
    weights, positions = np.array(mass), np.array(points)
    com = weights @ positions / weights.sum()
    moment = (weights[:, None] * (positions - com)).T @ (positions - com)
    principal = np.linalg.eigvalsh(np.trace(moment) * np.eye(3) - moment)
    exact = name in "ab"
    assert np.linalg.norm(com - truth["p1c"]) < (0.0005 if exact else 0.005)
    np.testing.assert_allclose(principal, truth["I"], rtol=0.002 if exact else 0.035)
