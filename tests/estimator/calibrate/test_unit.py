"""Robots as they are against MuJoCo: unequal legs and masses, a base that stands askew.

The simulator builds the robot from the same deviations; kinematics and dynamics come from MuJoCo's compiled chain,
balanced by linear algebra (``mujoco_arm``).
"""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.delta import forward_kinematics, inverse_kinematics, jacobian
from estimator.arm.dynamics import arm_torque, rotation, wrench_on_payload
from estimator.arm.unit import AT, ArmUnit
from estimator.calibrate.equations import corrected
from estimator.rigid_team import robot_data
from mocobot_sim.scene.as_built import AsBuilt, CalibrationSpread, deviate
from mocobot_sim.scene.omnid import load_omnid, park
from mujoco_arm import Arm, random_motion
from omnid_design import DESIGN

SPREAD = CalibrationSpread(0.02, 0.02, 2e-3, 0.02, 0.05)
TILT = np.array([0.02, -0.03])


def unit_of(built: AsBuilt, tilt=(0.0, 0.0)) -> ArmUnit:
    """The same deviations by the estimator's names."""
    unit = ArmUnit.as_designed(DESIGN)
    unit.x[AT["phi_zero"]], unit.x[AT["theta_zero"]] = built.phi_zero_rad, built.theta_zero_rad
    unit.x[AT["radius"]] = built.base_radius_m - built.platform_radius_m
    unit.x[AT["proximal_length"]], unit.x[AT["rod_length"]] = built.proximal_length_m, built.rod_length_m
    unit.x[AT["stiffness_ratio"]], unit.x[AT["tau_zero"]] = built.stiffness_ratio, built.tau_zero_Nm
    unit.x[AT["tilt"]] = tilt
    unit.x[AT["proximal_mass_ratio"]], unit.x[AT["rod_mass_ratio"]] = (
        built.proximal_mass_ratio,
        built.rod_mass_ratio,
    )
    unit.x[AT["wrist_mass_ratio"]] = built.wrist_mass_ratio
    return unit


def build(built: AsBuilt, tilt=(0.0, 0.0)) -> Arm:
    """The robot in MuJoCo; a tilt turns gravity, which is all that the arm itself sees of it."""
    omnid = load_omnid(1)
    deviate(omnid, built)
    park(omnid)
    arm = Arm(mujoco.MjModel.from_xml_string(omnid.to_xml_string(), omnid.get_assets()))
    R_ba = Rotation.from_rotvec([*tilt, 0.0]).as_matrix()
    arm.model.opt.gravity[:] = R_ba.T @ [0.0, 0.0, -DESIGN.gravity_mps2]
    return arm


def draw(seed: int) -> AsBuilt:
    return SPREAD.draw(1, np.random.default_rng([seed, 9]))[0]


@pytest.mark.parametrize("seed", range(4))
def test_pose_and_jacobian_of_unequal_legs(seed):
    built, rng = draw(seed), np.random.default_rng(seed)
    arm, unit = build(built), unit_of(built)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    grasp = arm.data.site("grasp").xpos - arm.data.site("base").xpos
    assert grasp == pytest.approx(forward_kinematics(phi[0], unit), abs=1e-12)
    assert np.linalg.norm(grasp - forward_kinematics(phi[0], DESIGN)) > 1e-4
    assert inverse_kinematics(grasp, unit) == pytest.approx(phi[0], abs=1e-10)
    velocity = arm.site_jacobian("grasp")[0] @ arm.data.qvel
    assert velocity == pytest.approx(jacobian(phi[0], unit) @ phi[1], rel=1e-9)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), TILT])
@pytest.mark.parametrize("seed", range(4))
def test_force_on_the_payload(seed, tilt):
    """Exact but for what rounding leaves, gimbals as designed."""
    built, rng = replace(draw(seed), wrist_mass_ratio=0.0), np.random.default_rng(100 + seed)
    arm, unit = build(built, tilt), unit_of(built, tilt)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    f_a = rng.normal(0, 30, 3)
    tau, m_i = arm.balance(f_a)
    wrench = wrench_on_payload(phi, theta, tau, unit)
    assert wrench[3:] == pytest.approx(rotation(theta[0]).T @ f_a, abs=1e-8)
    assert wrench[:3] == pytest.approx(m_i, abs=1e-11)
    as_designed = wrench_on_payload(phi, theta, tau, ArmUnit.as_designed(DESIGN))
    assert np.abs(as_designed - wrench).max() > 0.05


def test_a_heavier_wrist_has_gimbals_as_designed_and_its_weight_right():
    """The model's own error: gimbal inertias do not follow the wrist's mass. At rest it has none."""
    built = replace(AsBuilt(), wrist_mass_ratio=0.05)
    arm, unit, rng = build(built), unit_of(built), np.random.default_rng(5)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    tau, m_i = arm.balance(np.zeros(3))
    wrench = wrench_on_payload(phi, theta, tau, unit)
    assert np.abs(wrench[3:]).max() < 1e-8
    assert 0.02 < np.linalg.norm(wrench[:3] - m_i) / np.linalg.norm(m_i) < 0.08

    still = np.zeros(3)
    arm.set_motion((phi[0], still, still), (theta[0], still, still), rng)
    arm.data.qvel[:], arm.data.qacc[:] = 0, 0
    tau, _ = arm.balance(np.zeros(3))
    assert arm_torque(phi[0], still, still, unit) == pytest.approx(tau, abs=1e-10)
    assert np.abs(arm_torque(phi[0], still, still, DESIGN) - tau).max() > 1e-3


def test_readings_become_true_signals_in_the_level_frame():
    built, rng = draw(7), np.random.default_rng(7)
    unit = ArmUnit(DESIGN, unit_of(built, TILT).x[None])
    arm = build(built, TILT)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    f_a = rng.normal(0, 30, 3)
    tau, _ = arm.balance(f_a)
    # What the simulator's sensors read: deflection times design stiffness, zeros on top.
    reading = tau / (1.0 + built.stiffness_ratio) + built.tau_zero_Nm
    s = np.concatenate(
        [phi[0] + built.phi_zero_rad, *phi[1:], theta[0] + built.theta_zero_rad, *theta[1:], reading]
    )
    data = robot_data(corrected(s[None, None], unit), unit)
    R_ba = Rotation.from_rotvec([*TILT, 0.0]).as_matrix()
    base, grasp = arm.data.site("base"), arm.data.site("grasp")
    assert data.h[0, 0] == pytest.approx(R_ba @ (grasp.xpos - base.xpos), abs=1e-12)
    assert data.R_bi[0, 0] == pytest.approx(R_ba @ grasp.xmat.reshape(3, 3), abs=1e-12)
    assert R_ba @ grasp.xmat.reshape(3, 3) @ data.wrench[0, 0, 3:] == pytest.approx(R_ba @ f_a, abs=1e-7)


def test_several_arms_side_by_side_are_each_as_alone():
    rng = np.random.default_rng(3)
    units = [unit_of(draw(seed), TILT) for seed in (1, 2)]
    both = ArmUnit(DESIGN, np.array([unit.x for unit in units]))
    phi, theta = zip(*(random_motion(rng) for _ in units), strict=True)
    phi, theta = (tuple(np.array(part) for part in zip(*motion, strict=True)) for motion in (phi, theta))
    tau = rng.normal(0, 3, (2, 3))
    together = wrench_on_payload(phi, theta, tau, both)
    for i, unit in enumerate(units):
        alone = wrench_on_payload(tuple(p[i] for p in phi), tuple(t[i] for t in theta), tau[i], unit)
        assert together[i] == pytest.approx(alone, abs=1e-12)
