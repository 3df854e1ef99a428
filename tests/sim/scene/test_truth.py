"""Ground truth of the compiled scene against Table I, typed here from the print."""

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.errors import InputError
from mocobot_sim.scene.as_built import CalibrationSpread
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.truth import GroundTruth, truth_path, write_truth
from payload_mjcf import FIVE, ONE, TEAMS

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


@pytest.mark.parametrize(
    "moments", [(0.08, 0.05, 0.06), (0.06, 0.08, 0.05), (0.05, 0.08, 0.06), (0.08, 0.06, 0.05)]
)
def test_moments_come_ascending_with_their_axes(tmp_path, moments):
    payload = dataclasses.replace(ONE, inertia_kgm2=moments)
    truth = GroundTruth.of(build_team(payload.write(tmp_path)))
    np.testing.assert_allclose(truth.principal_kgm2, (0.05, 0.06, 0.08), rtol=1e-12)
    assert abs(np.linalg.det(truth.R_1c) - 1) < 1e-12
    whole = truth.R_1c @ np.diag(truth.principal_kgm2) @ truth.R_1c.T
    np.testing.assert_allclose(whole, np.diag(moments), rtol=0, atol=1e-12)


@pytest.mark.parametrize("robots", [1, 2, 5])
def test_any_number_of_grasps(teams, robots):
    truth = GroundTruth.of(teams[robots])
    payload = TEAMS[robots]
    np.testing.assert_allclose(truth.p_1i, [grasp.position for grasp in payload.grasps], rtol=0, atol=1e-12)
    R_1i = [grasp.pose().rotation.as_matrix() for grasp in payload.grasps]
    np.testing.assert_allclose(truth.R_1i, R_1i, rtol=0, atol=1e-12)
    assert truth.mass_kg == payload.mass_kg
    np.testing.assert_allclose(truth.p_1c, payload.com_m, rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth.principal_kgm2, payload.inertia_kgm2, rtol=1e-12)


def test_as_built_robots_carry_the_same_payload(truths):
    units = CalibrationSpread(0.02, 0.02, 1e-3, 0.02).draw(3, np.random.default_rng(0))
    other = GroundTruth.of(build_team("d", units))
    assert other.units == units
    for entry in dataclasses.fields(GroundTruth)[:-3]:
        np.testing.assert_allclose(
            getattr(other, entry.name), getattr(truths["d"], entry.name), rtol=0, atol=1e-12
        )


def test_sidecar_holds_the_truth_in_plain_json(tmp_path):
    units = CalibrationSpread(0.02, 0.02, 1e-3, 0.02).draw(5, np.random.default_rng(0))
    truth = GroundTruth.of(build_team(FIVE.write(tmp_path), units))
    recording = tmp_path / "rec.parquet"
    write_truth(truth, recording)
    assert truth_path(recording) == tmp_path / "rec.truth.json"
    values = json.loads((tmp_path / "rec.truth.json").read_text(encoding="utf-8"))
    assert values["mass_kg"] == 16.0
    np.testing.assert_allclose(values["p_1c_m"], FIVE.com_m, rtol=0, atol=1e-12)
    np.testing.assert_allclose(values["principal_inertia_kgm2"], FIVE.inertia_kgm2, rtol=1e-12)
    np.testing.assert_allclose(values["R_1c_rotvec_deg"], 0, atol=1e-9)
    assert len(values["grasps"]) == 5
    for entry, grasp in zip(values["grasps"], FIVE.grasps, strict=True):
        np.testing.assert_allclose(entry["p_1i_m"], grasp.position, rtol=0, atol=1e-12)
        turn = Rotation.from_rotvec(entry["R_1i_rotvec_deg"], degrees=True)
        assert (turn.inv() * grasp.pose().rotation).magnitude() < 1e-12
    assert len(values["as_built"]) == 5
    for entry, unit in zip(values["as_built"], units, strict=True):
        assert entry == {f.name: np.asarray(getattr(unit, f.name)).tolist() for f in dataclasses.fields(unit)}


def test_sidecar_that_cannot_be_written_is_refused(tmp_path, truths):
    (tmp_path / "rec.truth.json").mkdir()
    with pytest.raises(InputError, match=r"rec\.truth\.json: cannot be written"):
        write_truth(truths["a"], tmp_path / "rec.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["rec.truth.json"]


def test_sidecar_replaces_an_old_one_and_leaves_no_scraps(tmp_path, truths):
    recording = tmp_path / "rec.parquet"
    write_truth(truths["a"], recording)
    write_truth(truths["d"], recording)
    assert [path.name for path in tmp_path.iterdir()] == ["rec.truth.json"]
    values = json.loads(truth_path(recording).read_text(encoding="utf-8"))
    assert values["mass_kg"] == 10.478
    assert len(values["as_built"]) == 3
    assert all(not np.any(values) for unit in values["as_built"] for values in unit.values())
