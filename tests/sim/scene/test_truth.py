"""Ground truth of the compiled scene against Table I, typed here from the print."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.truth import GroundTruth, truth_path, write_truth

# Angles about z of R_12 and R_31 [deg], p_12 and p_31 [m]; T_23 follows.
GRASPS = {
    "a": (0, 90, (0.647, 0.533, 0), (-0.305, -1.105, 0)),
    "b": (45, -135, (-0.686, 0.572, 0), (-0.242, 0.835, 0)),
    "c": (-90, 45, (-0.115, -1.143, 0), (-1.132, 0.162, 0)),
    "d": (-135, 90, (-0.382, 0.800, -0.038), (0.533, -0.571, 0)),
}
# m [kg], p_1c [m], R_1c as axis times angle [deg], principal moments [kg m^2].
BODIES = {
    "a": (11.672, (0.537, 0.156, 0.072), (0.043, 0.085, -84.787), (2.318, 3.215, 5.524)),
    "b": (11.672, (0.034, 0.535, 0.072), (0.115, -0.115, 2.465), (2.153, 3.390, 5.535)),
    "c": (10.478, (0.547, -0.670, 0.057), (-1.034, 0.355, -24.643), (1.824, 2.438, 4.208)),
    "d": (10.478, (0.089, 0.593, 0.055), (-1.662, -0.702, 68.937), (1.711, 2.122, 3.772)),
}
# Table I's p_23, printed to a millimetre and closing its loop only to about that.
P_23 = {
    "a": (0.457, -0.838, 0), "b": (0.916, -0.647, 0), "c": (-0.229, 0.800, 0), "d": (-0.485, 0.862, 0.038)
}  # fmt: skip
EACH = pytest.mark.parametrize("name", list("abcd"))


def _rz(degrees: float) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


@pytest.fixture(scope="module")
def truths() -> dict[str, GroundTruth]:
    return {name: GroundTruth.of(build_team(name)) for name in "abcd"}


@EACH
def test_grasps_are_table_one(truths, name):
    truth = truths[name]
    about_12, about_31, p_12, p_31 = GRASPS[name]
    R_13 = _rz(about_31).T
    np.testing.assert_allclose(truth.R_1i, [np.eye(3), _rz(about_12), R_13], rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth.p_1i, [np.zeros(3), p_12, -R_13 @ p_31], rtol=0, atol=1e-12)
    p_23 = truth.R_1i[1].T @ (truth.p_1i[2] - truth.p_1i[1])
    np.testing.assert_allclose(p_23, P_23[name], rtol=0, atol=1.5e-3)


@EACH
def test_body_is_table_one(truths, name):
    truth = truths[name]
    mass, p_1c, rotvec, principal = BODIES[name]
    assert truth.mass_kg == mass
    np.testing.assert_allclose(truth.p_1c, p_1c, rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth.principal_kgm2, principal, rtol=1e-12)
    R_1c = Rotation.from_rotvec(rotvec, degrees=True).as_matrix()
    np.testing.assert_allclose(truth.R_1c, R_1c, rtol=0, atol=1e-9)


@EACH
def test_axes_are_right_handed(truths, name):
    R = truths[name].R_1c
    np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-12)
    assert abs(np.linalg.det(R) - 1) < 1e-12


def test_sidecar_replaces_an_old_one_and_leaves_no_scraps(tmp_path, truths):
    recording = tmp_path / "rec.parquet"
    write_truth(truths["a"], recording)
    write_truth(truths["d"], recording)
    assert [path.name for path in tmp_path.iterdir()] == ["rec.truth.json"]
    values = json.loads(truth_path(recording).read_text(encoding="utf-8"))
    assert values["mass_kg"] == 10.478
    assert len(values["as_built"]) == 3
    assert all(not np.any(values) for unit in values["as_built"] for values in unit.values())
