"""Arms as they are: kinematics, dynamics, and what metadata say of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.arm.delta import forward_kinematics, inverse_kinematics, jacobian
from estimator.arm.dynamics import arm_torque, rotation, wrench_on_payload
from estimator.arm.unit import AT, COUNT, GROUPS, ArmUnit
from estimator.calibrate.equations import corrected
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate, format_estimate
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.parquet import read_recording, write_recording
from estimator.rigid_team import robot_data
from estimator.signals import process_recording
from mocobot_sim.scene.as_built import AsBuilt, CalibrationSpread, deviate
from mocobot_sim.scene.omnid import load_omnid, park
from mujoco_arm import Arm, random_motion
from omnid_design import DESIGN
from recorded_team import COM, GRASPS, MASS
from recordings import metadata, small_recording
from uncalibrated_team import knowing, true_units, uncalibrated

SPREAD = CalibrationSpread(0.02, 0.02, 2e-3, 0.02, 0.05)
TILT = np.array([0.02, -0.03])


def unit_of(built: AsBuilt, tilt=(0.0, 0.0)) -> ArmUnit:
    """The same deviations by the estimator's names."""
    unit = ArmUnit(DESIGN, np.zeros(COUNT))
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
    as_designed = wrench_on_payload(phi, theta, tau, ArmUnit(DESIGN, np.zeros(COUNT)))
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


@pytest.mark.parametrize("changes", [{}, {"level": "wrist"}, {"trial": "free"}])
def test_round_trip(tmp_path: Path, changes: dict[str, Any]) -> None:
    written = small_recording(rows=40, units=true_units(), **changes)
    write_recording(written, tmp_path / "rec.parquet")
    read = read_recording(tmp_path / "rec.parquet")
    assert read.metadata.units is not None
    np.testing.assert_array_equal(read.metadata.units.x, true_units().x)
    assert replace(read.metadata, units=None) == replace(written.metadata, units=None)
    # Readings stay as they were read, whatever the robots are really like.
    np.testing.assert_allclose(read.phi, written.phi, rtol=0, atol=1e-12)
    np.testing.assert_allclose(read.tau, written.tau, rtol=0, atol=1e-10)


def test_the_key_is_written_only_where_it_is_needed() -> None:
    assert json.loads(metadata().to_json())["version"] == 1
    told = json.loads(metadata(units=true_units()).to_json())
    assert (told["version"], told["level"], len(told["units"])) == (5, "joint", 3)
    robot = told["units"][1]
    assert robot["tau_zero_Nm"] == true_units().of("tau_zero")[1].tolist()
    assert [len(values) for values in robot.values()] == [len(group.entries) for group in GROUPS]


def changed(path: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(values: dict[str, Any]) -> None:
        *way, last = [int(key) if key.isdigit() else key for key in path.split("/")]
        inner: Any = values
        for key in way:
            inner = inner[key]
        inner[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (changed("units", []), r"units is \[\]; it must be a list with one object for each robot"),
        (changed("units/1", {}), r"units\[1\]: missing key 'phi_zero_rad'"),
        (changed("units/1/phi_zero", 0), r"unknown key 'phi_zero' \(did you mean 'phi_zero_rad'\?\)"),
        (changed("units/0/tilt_rad", [0.0]), r"units\[0\]: tilt_rad is \[0.0\]; it must be 2 finite numbers"),
        (
            changed("units/2/rod_mass_ratio/1", -1.5),
            r"units\[2\]: rod_mass_ratio is -1.5; .* greater than -1$",
        ),
        (changed("units/2/rod_length_m/1", -9.0), r"rod_length_m is -9; it must be greater than -0\.\d+$"),
        (changed("version", 4), "unknown key 'units'"),
    ],
)
def test_what_no_robots_are_is_refused(change: Callable[[dict[str, Any]], None], said: str) -> None:
    values = json.loads(metadata(units=true_units()).to_json())
    change(values)
    with pytest.raises(InputError, match=f"^rec: .*{said}"):
        RecordingMetadata.from_json(json.dumps(values), "rec")


def test_units_of_other_robots_are_not_written() -> None:
    two = ArmUnit(DESIGN, true_units().x[:2])
    with pytest.raises(InputError, match="units: of 2 robots; the recording is of 3"):
        metadata(units=two).to_json()
    heavier = ArmUnit(replace(DESIGN, rod_mass_kg=0.5), true_units().x)
    with pytest.raises(InputError, match="units: of robots of another design than the recording's"):
        metadata(units=heavier).to_json()


def test_motion_and_wrenches_of_robots_as_they_are() -> None:
    """Against an analytic motion, whose joint angles and torques arms as they are were given."""
    carried, units = uncalibrated()
    keep = slice(200, -200)
    data = process_recording(knowing(carried.recording, units), cutoff_hz=20.0)
    np.testing.assert_allclose(data.twist, carried.twist[keep], rtol=0, atol=1e-8)
    np.testing.assert_allclose(data.twist_dot, carried.twist_dot[keep], rtol=0, atol=2e-7)
    np.testing.assert_allclose(data.wrench, carried.wrench[keep], rtol=0, atol=1e-6)
    as_designed = process_recording(carried.recording, cutoff_hz=20.0)
    assert np.abs(as_designed.wrench - carried.wrench[keep]).max() > 1.0
    assert np.abs(as_designed.R_bi - data.R_bi).max() > 1e-3


def test_estimate_on_robots_as_they_are() -> None:
    carried, units = uncalibrated()
    found = estimate_payload([knowing(carried.recording, units)])
    assert found.contradicts is False
    assert found.mass is not None
    assert found.grasps is not None
    assert found.mass.mass == pytest.approx(MASS, rel=1e-6)
    np.testing.assert_allclose(found.p_1c, COM, atol=1e-6)
    np.testing.assert_allclose(found.grasps.p_1i, [p for _, p in GRASPS], atol=1e-6)
    assert estimate_payload([carried.recording]).contradicts is True
    # Its JSON says which robots it is of, and that of an estimate on robots as designed says nothing.
    again = PayloadEstimate.from_dict(json.loads(json.dumps(found.to_dict(), allow_nan=False)))
    assert again.units is not None
    np.testing.assert_array_equal(again.units.x, units.x)
    assert again.units.design == DESIGN
    assert "3 calibrated robots, " in format_estimate(again)
