"""Payloads of two bodies: the truth against MuJoCo's own, the recorded motion against the joint, refusals."""

import json

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.delta import forward_kinematics
from estimator.arm.dynamics import rotation
from estimator.errors import InputError
from mocobot_sim.scene.models import models_dir
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.resimulate import resimulate
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, simulate
from mocobot_sim.trial.truth import GroundTruth

SECOND = {"hinged": (2, 3), "sliding": (2, 3), "flexible": (2, 3), "folding": (3, 4)}
EACH = pytest.mark.parametrize("name", list(SECOND))


@pytest.fixture(scope="module")
def trials():
    sensors = [sensor_preset("ideal")]
    return {name: simulate(TrialRequest(name, "periodic", duration_s=6.0), sensors) for name in SECOND}


def _floating(name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The payload alone, free in space, at the home pose."""
    spec = mujoco.MjSpec.from_file(str(models_dir() / f"payload_{name}" / "payload.xml"))
    spec.body("payload").add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@EACH
def test_the_whole_is_that_of_mujoco(name):
    truth, (model, data) = GroundTruth.of(build_team(name)), _floating(name)
    body = model.body("payload").id
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    assert truth.mass_kg == pytest.approx(model.body_subtreemass[body], rel=1e-12)
    np.testing.assert_allclose(truth.p_1c, data.subtree_com[body], rtol=0, atol=1e-12)
    about_1 = truth.R_1c @ np.diag(truth.principal_kgm2) @ truth.R_1c.T
    p = truth.p_1c
    about_1 = about_1 + truth.mass_kg * (p @ p * np.eye(3) - np.outer(p, p))
    np.testing.assert_allclose(about_1, M[3:6, 3:6], rtol=0, atol=1e-10)


@EACH
def test_the_bodies_give_mujoco_s_mass_matrix_of_the_joint(name):
    truth, (model, data) = GroundTruth.of(build_team(name)), _floating(name)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    first, second = truth.bodies
    assert first.robots + second.robots == tuple(range(1, len(truth.p_1i) + 1))
    assert second.robots == SECOND[name]
    joint = truth.to_dict()["joint"]
    axis, pivot = np.array(joint["axis_k"]), np.array(joint["pivot_k_m"])
    if joint["type"] == "slide":
        expected = second.mass_kg
    else:
        arm = np.cross(axis, second.p_kc - pivot)
        expected = axis @ second.inertia_k @ axis + second.mass_kg * arm @ arm
    assert M[6, 6] == pytest.approx(expected, rel=1e-10)
    assert first.mass_kg + second.mass_kg == pytest.approx(truth.mass_kg)


@EACH
def test_grasps_move_as_the_joint_does(trials, name):
    done = trials[name]
    log, truth, joint = done.log, done.truth, done.truth.to_dict()["joint"]
    q, axis = truth.position, np.array(joint["axis_1"])
    assert np.ptp(q) > (0.05 if joint["type"] == "slide" else 0.02)
    mounts = done.scene.X_Wb
    wrist = forward_kinematics(log.phi, done.recordings["ideal"].metadata.design)
    k = truth.bodies[1].robots[0] - 1
    R_W1, R_Wk = (mounts.rotation[i].as_matrix() @ rotation(log.theta[:, i]) for i in (0, k))
    p_1, p_k = (mounts[i].apply(wrist[:, i]) for i in (0, k))
    seen = np.einsum("qji,qj->qi", R_W1, p_k - p_1)
    turn = Rotation.from_rotvec(np.outer(q, axis)).as_matrix()
    if joint["type"] == "slide":
        R, p = truth.R_1i[k], truth.p_1i[k] + np.outer(q, axis)
    else:
        pivot = np.array(joint["pivot_1_m"])
        R, p = turn @ truth.R_1i[k], pivot + turn @ (truth.p_1i[k] - pivot)
    np.testing.assert_allclose(
        np.swapaxes(R_W1, 1, 2) @ R_Wk, np.broadcast_to(R, R_W1.shape), rtol=0, atol=1e-5
    )
    np.testing.assert_allclose(seen, p, rtol=0, atol=2e-5)


def test_a_sprung_joint_starts_where_its_spring_carries_the_load(trials):
    q = trials["flexible"].truth.position
    assert abs(q[0]) > 0.01
    # At rest in equilibrium; without it, the joint would turn by 2e-4 rad in the first 10 ms.
    assert abs(q[1] - q[0]) < 3e-5


@EACH
def test_a_recording_is_resimulated(trials, name):
    done = trials[name]
    again = resimulate(done.recordings["ideal"], build_team(name))
    np.testing.assert_allclose(again.joint[300:], done.log.joint[300:], rtol=0, atol=2e-3)


def test_truth_is_json_with_the_joint(trials):
    values = json.loads(json.dumps(trials["folding"].truth.to_dict()))
    assert [body["robots"] for body in values["bodies"]] == [[1, 2], [3, 4]]
    assert len(values["joint"]["position_rad"]) == len(trials["folding"].log.time)
    assert "bodies" not in GroundTruth.of(build_team("a")).to_dict()


INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
HINGE = '<joint name="joint" axis="0 0 1"/>'
BAD = {
    "two joints": (
        f"{HINGE}<joint name='more' axis='1 0 0'/>{INERTIAL}<site name='grasp2'/>",
        "has 2 joints",
    ),
    "ball": (f"<joint type='ball'/>{INERTIAL}<site name='grasp2'/>", "one hinge or slide"),
    "not held": (f"{HINGE}{INERTIAL}", "one other grasp"),
    "massless": (f"{HINGE}<site name='grasp2'/>", "MuJoCo cannot compile"),
}


@pytest.mark.parametrize(("second", "said"), BAD.values(), ids=BAD)
def test_bad_second_bodies_are_refused(tmp_path, second, said):
    path = tmp_path / "bad.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body name="payload">'
        f'{INERTIAL}<site name="grasp1"/><body name="second" pos="1 0 0">{second}</body></body></worldbody></mujoco>'
    )
    with pytest.raises(InputError, match=said):
        build_team(path)
