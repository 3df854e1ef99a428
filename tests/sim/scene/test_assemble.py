"""The state a trial starts from: loops closed, nothing moves, springs as little loaded as possible."""

import itertools

import mujoco
import numpy as np
import pytest

from closed_loop import ClosedLoop, in_world
from estimator.errors import InputError
from mocobot_sim.kernels import wrist
from mocobot_sim.scene.as_built import CalibrationSpread
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import build_team
from payload_mjcf import FIVE, ONE, Grasp, Payload

CASES = ["a", "b", "c", "d", 1, 2, 5, "as built a", "as built 5"]
# Constraints carry load by opening a few micrometres; before they have, they carry 0.03 % too little.
UNSETTLED = 5e-4
SPREAD = CalibrationSpread(encoder_zero_rad=0.0, stiffness_ratio=0.02, geometry_m=1e-3)


@pytest.fixture(scope="module")
def loops(teams, tmp_path_factory) -> dict:
    scenes = {name: build_team(name) for name in "abcd"} | teams
    scenes["as built a"] = build_team("a", SPREAD.draw(3, np.random.default_rng(2)))
    path = FIVE.write(tmp_path_factory.mktemp("five"))
    scenes["as built 5"] = build_team(path, SPREAD.draw(5, np.random.default_rng(3)))
    return {case: ClosedLoop(scene) for case, scene in scenes.items()}


def _payload_weight(loop: ClosedLoop) -> float:
    return 9.81 * loop.model.body_mass[loop.index.payload_body]


@pytest.mark.parametrize("case", CASES)
def test_every_loop_is_closed(loops, case):
    loop = loops[case]
    data, robots = loop.data, loop.index.robots
    gaps = [
        data.site(f"omnid{i}/rod{k}_tip").xpos - data.site(f"omnid{i}/platform{k}").xpos
        for i in range(1, robots + 1)
        for k in (1, 2, 3)
    ]
    gaps += [
        data.site(f"omnid{i}/grasp").xpos - data.site(f"omnid1/payload/grasp{i}").xpos
        for i in range(1, robots + 1)
    ]
    assert np.abs(gaps).max() < 1e-12
    assert len(data.efc_pos) == 9 * robots + 6 * (robots - 1)
    assert np.abs(data.efc_pos).max() < 1e-12


@pytest.mark.parametrize("case", CASES)
def test_at_rest_and_stays_at_rest_under_constant_motor_torque(loops, case):
    loop = loops[case]
    assert not loop.data.qvel.any()
    assert np.abs(loop.data.qacc[loop.index.slide_dof]).max() < 2e-3 * 9.81
    data = mujoco.MjData(loop.model)
    mujoco.mj_copyData(data, loop.model, loop.data)
    start = data.site_xpos.copy()
    for _ in range(1000):
        mujoco.mj_step(loop.model, data)
    assert np.abs(data.site_xpos - start).max() < 0.01e-3


@pytest.mark.parametrize("case", CASES)
def test_robots_carry_the_payload_and_springs_carry_the_motor_torque(loops, case):
    loop = loops[case]
    force = loop.forces_on_payload().sum(axis=0)
    weight = _payload_weight(loop)
    np.testing.assert_allclose(force, [0, 0, weight], rtol=0, atol=UNSETTLED * weight)
    deflection = loop.data.qpos[loop.index.spring_qpos]
    stiffness = loop.model.jnt_stiffness[loop.model.dof_jntid[loop.index.spring_dof]]
    np.testing.assert_allclose(-stiffness * deflection, loop.torque, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(loop.data.ctrl[loop.index.actuator], loop.torque)
    np.testing.assert_allclose(loop.data.qfrc_spring[loop.index.spring_dof], loop.torque, rtol=0, atol=1e-12)


@pytest.mark.parametrize("case", ["a", "b", "c", "d", 5])
def test_vertical_loads_balance_moments(loops, case):
    """Newton and Euler on the payload: independent of where the internal forces were put."""
    loop = loops[case]
    forces = loop.forces_on_payload()
    assert len(forces) == loop.index.robots
    grasps = loop.data.site_xpos[loop.index.grasp_site]
    com = loop.data.xipos[loop.index.payload_body]
    moments = np.cross(grasps - com, forces)
    assert np.abs(moments).max() > 10.0
    np.testing.assert_allclose(moments.sum(axis=0), 0, rtol=0, atol=UNSETTLED * np.abs(moments).sum())


def _jacobian(phi: np.ndarray) -> np.ndarray:
    """dh/dphi of the design from test_control's subject; checked there against MuJoCo."""
    design = omnid_design()
    reach = design.base_radius_m - design.platform_radius_m
    _, s, lever, _ = wrist(phi, reach, design.proximal_length_m, design.rod_length_m)
    return np.linalg.solve(np.array(s), np.diag(lever))


@pytest.mark.parametrize("case", ["a", "d", 2, 5])
def test_squeezing_the_payload_would_only_cost_torque(loops, case):
    """Along every internal force the torques are stationary, and the squeezed state is an equilibrium too."""
    loop = loops[case]
    design_phi, points = loop.phi(), in_world(loop.scene, loop.wrist())
    R_Wb = [loop.data.body(f"omnid{i + 1}/base").xmat.reshape(3, 3) for i in range(loop.index.robots)]
    pairs = list(itertools.combinations(range(loop.index.robots), 2))
    assert pairs
    for i, j in pairs:
        along = (points[j] - points[i]) / np.linalg.norm(points[j] - points[i])
        squeeze = np.zeros_like(loop.torque)
        squeeze[i] = _jacobian(design_phi[i]).T @ R_Wb[i].T @ along
        squeeze[j] = -_jacobian(design_phi[j]).T @ R_Wb[j].T @ along
        cosine = np.sum(squeeze * loop.torque) / np.linalg.norm(squeeze) / np.linalg.norm(loop.torque)
        assert abs(cosine) < 1e-6
        data = mujoco.MjData(loop.model)
        mujoco.mj_copyData(data, loop.model, loop.data)
        data.ctrl[loop.index.actuator] += 20.0 * squeeze
        data.qpos[loop.index.spring_qpos] -= 20.0 * squeeze / 100.0
        data.qpos[loop.index.motor_qpos] += 20.0 * squeeze / 100.0
        mujoco.mj_forward(loop.model, data)
        assert np.abs(data.qacc[loop.index.slide_dof]).max() < 2e-3 * 9.81
        assert np.abs(data.qfrc_spring - loop.data.qfrc_spring).max() > 1.0


def test_a_grasp_out_of_reach_is_refused(tmp_path):
    high = Payload((Grasp(), Grasp((0.9, 0, 0.5)), Grasp((0, 0.9, 0))), 5.0, (0.3, 0.3, 0.0))
    with pytest.raises(InputError, match=r"cannot be assembled: a loop stays open by .* m"):
        ClosedLoop(build_team(high.write(tmp_path)))


@pytest.mark.parametrize(
    ("grasps", "com"), [((Grasp(),), (0.1, 0.0, -0.1)), ((Grasp(), Grasp((0.9, 0.0, 0.0))), (0.4, 0.1, -0.1))]
)
def test_a_payload_that_would_swing_is_refused(tmp_path, grasps, com):
    with pytest.raises(InputError, match="the payload cannot rest in the home pose"):
        ClosedLoop(build_team(Payload(grasps, 2.0, com).write(tmp_path)))


def test_one_robot_carries_all_of_it(loops):
    """Closed form at home: all legs alike, so each spring holds a third of the wrist's load plus its own link."""
    loop = loops[1]
    torque = loop.torque[0]
    assert np.ptp(torque) < 1e-9
    # Virtual work: raising the wrist by dz takes the same dphi on every leg.
    phi = 0.6230299772752583
    outward, height = 0.118 + 0.2 * np.cos(phi), 0.2 * np.sin(phi)
    # rod^2 = outward^2 + (h - height)^2; dh/dphi from its derivative.
    dh = 0.2 * np.cos(phi) + 0.2 * np.sin(phi) * outward / (0.355 - height)
    wrist_kg = 0.4 + 0.10 + 0.08 + 0.12 + ONE.mass_kg
    # A uniform rod's centre rises by the mean of knee and wrist.
    knee = 0.2 * np.cos(phi)
    power = 9.81 * (wrist_kg * dh / 3 + 0.10 * (knee + dh) / 2 + 0.35 * 0.1 * np.cos(phi))
    np.testing.assert_allclose(torque, power, rtol=1e-9)
