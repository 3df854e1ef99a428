"""The shipped team in plain MuJoCo: it holds the payload, with the dynamics of the team that the simulator builds."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from mocobot_sim.extended.extended import load_extended
from mocobot_sim.extended.plain_team import write_plain_team
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.resimulate import predicted
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial

FOLDER = Path(__file__).resolve().parents[2] / "models" / "team_a"
PAYLOAD_KG, GRAVITY_MPS2 = 11.672, 9.81


def held(name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_path(str(FOLDER / name))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hold").id)
    return model, data


@pytest.mark.parametrize(("name", "seconds"), [("team.xml", 1.0), ("scene.xml", 5.0)])
def test_the_robots_hold_the_payload(name, seconds):
    model, data = held(name)
    mujoco.mj_forward(model, data)
    start = data.sensor("payload_position").data.copy()
    mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
    assert not any(int(count) for count in data.warning.number)
    np.testing.assert_allclose(data.sensor("payload_position").data, start, rtol=0, atol=1e-5)
    np.testing.assert_allclose(data.sensor("payload_orientation").data, [1, 0, 0, 0], rtol=0, atol=1e-5)
    # Gravity of all that the springs carry does virtual work m g per metre of lift, and so do their torques.
    h = 1e-6
    lift = np.array([data.sensor(f"omnid{i}/tau{k}").data[0] for i in (1, 2, 3) for k in (1, 2, 3)])
    assert (lift > 0).all()
    omnid = mujoco.MjModel.from_xml_path(str(FOLDER.parent / "omnid" / "omnid.xml"))
    carried = PAYLOAD_KG + 3 * sum(omnid.body(b).mass[0] for b in ("platform", "yoke", "ring", "flange"))
    rods = 3 * sum(omnid.body(f"{part}{k}").mass[0] for k in (1, 2, 3) for part in ("rod", "proximal"))
    rate = -phi_rate(h)
    assert carried * GRAVITY_MPS2 < lift.sum() * rate < (carried + rods) * GRAVITY_MPS2


def phi_rate(h: float) -> float:
    """Change of phi per metre that the wrist moves down at home, from the triangle of axis, knee and wrist."""

    def phi(height: float) -> float:
        reach, upper, rod = 0.18 - 0.062, 0.2, 0.368
        distance = np.hypot(reach, height)
        cosine = (upper**2 + distance**2 - rod**2) / (2 * upper * distance)
        return float(np.arctan2(height, -reach) - np.arccos(cosine))

    return -(phi(0.355 + h) - phi(0.355 - h)) / (2 * h)


def test_sensors_are_what_they_are_called():
    model, data = held("team.xml")
    rng = np.random.default_rng(0)
    data.qpos[:] = 0.1 * rng.standard_normal(model.nq)
    mujoco.mj_forward(model, data)
    for i in (1, 2, 3):
        for k, axis in enumerate("zyx", 1):
            motor, spring, gimbal = (
                data.joint(f"omnid{i}/{name}").qpos[0]
                for name in (f"motor{k}", f"spring{k}", f"gimbal_{axis}")
            )
            assert data.sensor(f"omnid{i}/phi{k}").data[0] == pytest.approx(motor + spring, abs=1e-15)
            assert data.sensor(f"omnid{i}/theta_{axis}").data[0] == gimbal
            passive = data.joint(f"omnid{i}/spring{k}").qfrc_passive[0]
            assert data.sensor(f"omnid{i}/tau{k}").data[0] == pytest.approx(passive, abs=1e-12)


def dynamics(model: mujoco.MjModel, qpos: np.ndarray, qvel: np.ndarray) -> tuple[np.ndarray, ...]:
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    return mass, data.qfrc_bias, data.qfrc_passive, data.efc_pos, data.xpos


def test_dynamics_are_those_of_the_simulators_team():
    ours, theirs = mujoco.MjModel.from_xml_path(str(FOLDER / "team.xml")), build_team("a").compile()
    names = [[m.joint(k).name for k in range(m.njnt)] for m in (ours, theirs)]
    assert names[0] == names[1]
    rng = np.random.default_rng(1)
    for _ in range(5):
        state = 0.2 * rng.standard_normal((2, ours.nv))
        for one, other in zip(dynamics(ours, *state), dynamics(theirs, *state), strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-10)


def test_a_trial_is_that_of_the_simulators_team_and_the_command_makes_the_folder(tmp_path):
    write_plain_team("a", tmp_path)
    scenes = load_extended(FOLDER), load_extended(tmp_path), build_team("a")
    trajectory = random_vias(scenes[2].wrist_home_b, np.random.default_rng(0), 1)
    one, other, expected = (predicted(run_trial(scene, trajectory)) for scene in scenes)
    for channel in ("phi", "theta", "tau"):
        for found in (one, other):
            np.testing.assert_allclose(
                getattr(found, channel), getattr(expected, channel), rtol=0, atol=1e-10
            )
    made, shipped = (mujoco.MjModel.from_xml_path(str(folder / "scene.xml")) for folder in (tmp_path, FOLDER))
    np.testing.assert_allclose(made.eq_data, shipped.eq_data, rtol=0, atol=1e-12)
    np.testing.assert_allclose(made.key_qpos, shipped.key_qpos, rtol=0, atol=1e-12)
