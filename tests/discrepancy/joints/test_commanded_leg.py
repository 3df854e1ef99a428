"""A leg whose drives tell no torque: MuJoCo simulates position loops, and the log has commands and positions only."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
import scipy.optimize
import scipy.stats

import mocobot
from command import refused, run
from discrepancy.joints.actuators import quantity_of, to_dict
from discrepancy.joints.calibrated import as_found
from discrepancy.joints.calibration import Parameter
from discrepancy.joints.causes import JointSignals, Span
from discrepancy.joints.friction import polynomial
from estimator.errors import InputError
from made_leg import DRY_NM, HEADER, KD, KP, LEG, LIMIT_NM, MAP, RATE_HZ, ROTOR_KGM2, VISCOUS, write_leg

SECONDS = 12.0


@pytest.fixture(scope="module")
def leg(tmp_path_factory) -> Path:
    """Folder with model, map and log."""
    return write_leg(tmp_path_factory.mktemp("leg"), SECONDS)


def test_commands_and_gains_tell_rotors_and_friction(leg):
    found = mocobot.calibrate(leg / "log.csv", leg / "leg.xml").found
    values = {(p.place, p.name): p for p in found.parameters}
    for joint, rotor, dry, viscous in zip(("hip", "knee"), ROTOR_KGM2, DRY_NM, VISCOUS, strict=True):
        for name, true, share in (
            ("coulomb_Nm", dry, 0.1), ("viscous_Nms_per_rad", viscous, 0.15), ("armature_kgm2", rotor, 0.2),
        ):  # fmt: skip
            p = values[joint, name]
            assert abs(p.value - true) < max(4.0 * p.se, share * true)
    assert any("are those asked for by the position loop" in note for note in found.notes)


def test_the_commands_take_such_a_log(leg, capsys, tmp_path):
    lines = (leg / "log.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    log = tmp_path / "short.csv"
    log.write_text("".join(lines[: round(10.0 * RATE_HZ)]), encoding="utf-8")
    code, out, _ = run(capsys, "inspect", log, "--model", leg / "leg.xml")
    assert code == 0
    assert "ready for: a diagnosis from torques of 2 joints" in out
    code, out, _ = run(capsys, "diagnose", log, "--model", leg / "leg.xml", "--no-closed-loop")
    assert code == 0
    assert "friction" in out


def test_without_gains_such_a_log_is_refused(leg, capsys, tmp_path):
    bare = tmp_path / "bare.toml"
    bare.write_text("\n".join(line for line in MAP.splitlines() if "_gain" not in line), encoding="utf-8")
    said = refused(capsys, "calibrate", leg / "log.csv", "--model", leg / "leg.xml", "--map", bare)
    assert "nor commands with known gains" in said


def test_logged_torques_are_not_replaced(leg, tmp_path):
    columns = np.genfromtxt(leg / "log.csv", delimiter=",", names=True)
    both = np.column_stack([*(columns[n] for n in columns.dtype.names), np.full(len(columns), 3.0)])
    np.savetxt(
        tmp_path / "log.csv",
        both,
        delimiter=",",
        comments="",
        header="t,hip q,knee q,hip command,knee command,hip torque",
    )
    (tmp_path / "log.toml").write_text(
        MAP.replace(
            "[control]", '[joint.hip.channels]\ntorque = { column = "hip torque", unit = "Nm" }\n[control]'
        ),
        encoding="utf-8",
    )
    (log,) = mocobot.serial.read_logs(tmp_path / "log.csv", leg / "leg.xml")
    assert log.torque is not None
    assert np.all(log.torque[:, 0] == 3.0)
    assert np.ptp(log.torque[:, 1]) > 0.1


def test_a_draft_says_which_joints_the_log_lacks(leg, tmp_path, capsys):
    more = LEG.replace(
        "</worldbody>", '<body name="tail"><joint name="tail"/><geom size="0.1"/></body></worldbody>'
    )
    (tmp_path / "more.xml").write_text(more, encoding="utf-8")
    code, out, _ = run(capsys, "map", leg / "log.csv", "--model", tmp_path / "more.xml")
    assert code == 0
    assert 'joints = ["hip", "knee"]' in out
    assert "joint tail is in no column\n" in out
    assert "joints that do not move are locked where they are: --lock tail=0\n" in out
    (tmp_path / "draft.toml").write_text(
        out.replace('position_gain = "free"', f"position_gain = {KP}").replace('velocity_gain = "free"\n', "")
    )
    locked = mocobot.serial.read_model(tmp_path / "more.xml", lock=["tail=0"])
    (log,) = mocobot.serial.read_logs(leg / "log.csv", locked, map=tmp_path / "draft.toml")
    assert log.torque is not None
    with pytest.raises(InputError, match="--lock"):
        mocobot.serial.read_logs(leg / "log.csv", tmp_path / "more.xml", map=tmp_path / "draft.toml")


# Actuators for policies.

MJLAB = {
    "target_names_expr", "armature", "velocity_limit", "frictionloss", "viscous_damping", "delay_min_lag",
    "delay_max_lag", "stiffness", "damping", "effort_limit", "saturation_effort",
}  # fmt: skip
"""Keys of mjlab's IdealPdActuatorCfg and DcMotorActuatorCfg (mujocolab.github.io/mjlab, mjlab.actuator)."""
ISAAC = {
    "joint_names_expr", "actuator_effort_limit", "actuator_velocity_limit", "joint_effort_limit",
    "joint_velocity_limit", "stiffness", "damping", "armature", "friction", "dynamic_friction", "viscous_friction",
    "saturation_effort",
}  # fmt: skip
"""Keys of Isaac Lab's ImplicitActuatorCfg and DCMotorCfg (isaac-sim.github.io/IsaacLab/release/3.0.0)."""


def test_actuators_are_those_of_the_calibration_and_of_the_model(leg, tmp_path, capsys):
    code, _, err = run(
        capsys, "calibrate", leg / "log.csv", "--model", leg / "leg.xml", "--out", tmp_path / "out"
    )
    assert code == 0, err
    found = json.loads((tmp_path / "out" / "actuators.json").read_text())
    fitted = {
        (p["place"], p["parameter"]): p
        for p in json.loads((tmp_path / "out" / "calibration.json").read_text())["parameters"]
    }
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "as_found.xml"))
    lost = {(one["joint"], one["quantity"]): one for one in found["not_determined"]}
    for j, joint in enumerate(("hip", "knee")):
        own = found["joints"][joint]
        for quantity, name, in_mujoco, key, isaac in (
            ("armature", "armature_kgm2", model.dof_armature[j], "armature", "armature"),
            ("coulomb_friction", "coulomb_Nm", model.dof_frictionloss[j], "frictionloss", "friction"),
            ("viscous_damping", "viscous_Nms_per_rad", model.dof_damping[j], "viscous_damping", "viscous_friction"),
        ):  # fmt: skip
            p = fitted[joint, name]
            assert (quantity in own) == p["determined"] == ((joint, quantity) not in lost)
            if p["determined"]:
                assert (own[quantity]["mean"], own[quantity]["standard_error"]) == (p["value"], p["se"])
                assert own[quantity]["source"] == "logs"
                assert own[quantity]["mean"] == pytest.approx(in_mujoco, rel=1e-5)  # six digits
                assert found["mjlab"]["ideal_pd"][joint][key] == p["value"]
                assert found["isaaclab"]["implicit"][joint][isaac] == p["value"]
            else:
                assert lost[joint, quantity]["prior_range"] == [
                    0.0,
                    pytest.approx(p["model"] + 2 * p["prior_se"]),
                ]
                assert key not in found["mjlab"]["ideal_pd"][joint]
        given = {quantity: own[quantity]["mean"] for quantity in ("stiffness", "damping", "effort_limit")}
        assert given == {"stiffness": KP, "damping": KD, "effort_limit": LIMIT_NM}
        assert {own[quantity]["source"] for quantity in given} == {"map"}
        assert found["isaaclab"]["implicit"][joint]["joint_effort_limit"] == LIMIT_NM
        assert lost[joint, "velocity_limit"]["prior_range"] is None
        assert found["missing"][joint] == ["saturation_effort", "velocity_limit"]
        assert set(found["mjlab"]["ideal_pd"][joint]) <= MJLAB
        assert set(found["isaaclab"]["implicit"][joint]) <= ISAAC
    assert any(
        quantity in own for own in found["joints"].values() for quantity in ("armature", "coulomb_friction")
    )
    assert found["mjlab"]["dc_motor"] == found["isaaclab"]["dc_motor"] == {}


def test_ranges_covariance_and_a_motor(leg):
    """Moments of the log-normal are those of the posterior; rows are named; what is free is not told."""
    calibration = mocobot.calibrate(leg / "log.csv", leg / "leg.xml")
    (drive, *_) = calibration.drives
    more = [
        Parameter("hip", name, value, value, se, 10.0 * value, determined=True)
        for name, value, se in (
            ("position_gain_Nm_per_rad", 21.0, 2.0), ("stall_Nm", 30.0, 1.0), ("no_load_rad_per_s", 25.0, 0.5),
        )
    ]  # fmt: skip
    parameters = [
        replace(p, determined=True, value=0.3, se=0.1) if p.name == "coulomb_Nm"
        else replace(p, determined=True, value=0.0, se=0.02) if p.name == "viscous_Nms_per_rad"
        else replace(p, determined=True, value=0.004, se=0.0007) if p.name == "command_delay_s" else p
        for p in (*calibration.found.parameters, *more)
    ]  # fmt: skip
    found = replace(calibration.found, parameters=tuple(parameters))
    root = np.random.default_rng(0).normal(size=(len(parameters), len(parameters)))
    covariance = root @ root.T
    free = replace(drive, gain_within=np.array([[np.inf, np.inf], [2.0, 1.0]]))
    told = to_dict(found, [free], covariance)
    own = told["joints"]["hip"]
    assert own["stiffness"]["mean"] == 21.0
    sigma = scipy.optimize.brentq(
        lambda s: scipy.stats.lognorm(s).std() / scipy.stats.lognorm(s).mean() - 1 / 3, 0.1, 1
    )
    law = scipy.stats.lognorm(sigma, scale=0.3 / scipy.stats.lognorm(sigma).mean())
    assert own["coulomb_friction"]["range"] == pytest.approx(law.ppf([0.025, 0.975]), rel=1e-6)
    assert own["viscous_damping"]["range"] == [0.0, 0.04]
    assert own["delay"]["range"] == pytest.approx([0.0026, 0.0054])
    assert told["mjlab"]["ideal_pd"]["hip"]["delay_min_lag"] == 1  # steps of 2 ms
    assert told["mjlab"]["ideal_pd"]["hip"]["delay_max_lag"] == 3
    rows = told["covariance"]["rows"]
    at = [
        next(k for k, p in enumerate(parameters) if p.place == j and quantity_of(p.name) == q)
        for j, q in rows
    ]
    np.testing.assert_array_equal(told["covariance"]["matrix"], covariance[np.ix_(at, at)])
    assert ["hip", "stiffness"] in rows
    assert told["mjlab"]["dc_motor"]["hip"]["saturation_effort"] == 30.0
    assert told["isaaclab"]["dc_motor"]["hip"]["actuator_velocity_limit"] == 25.0
    assert set(told["mjlab"]["dc_motor"]["hip"]) <= MJLAB
    assert set(told["isaaclab"]["dc_motor"]["hip"]) <= ISAAC
    lost = {(one["joint"], one["quantity"]): one["prior_range"] for one in told["not_determined"]}
    assert lost["hip", "damping"] is None
    assert lost["knee", "stiffness"] == [KP / 2, KP * 2]
    assert "stiffness" not in told["mjlab"]["ideal_pd"]["knee"]
    assert "stiffness" in told["missing"]["knee"]


def test_logs_with_torques_make_no_actuators(leg, tmp_path):
    columns = np.genfromtxt(leg / "log.csv", delimiter=",", names=True)
    both = np.column_stack([*(columns[n] for n in columns.dtype.names), np.full(len(columns), 3.0)])
    np.savetxt(tmp_path / "log.csv", both, delimiter=",", comments="", header=f"{HEADER},hip torque")
    own = '[joint.hip.channels]\ntorque = { column = "hip torque", unit = "Nm" }\n[control]'
    (tmp_path / "log.toml").write_text(MAP.replace("[control]", own), encoding="utf-8")
    (log,) = mocobot.serial.read_logs(tmp_path / "log.csv", leg / "leg.xml")
    assert not log.by_command
    assert log.asked is not None
    assert log.asked.tolist() == [False, True]


def test_a_delay_is_that_of_the_drive(leg, tmp_path):
    """The drive follows 8 ms after the stamps of the commands; the map tells all of it, a part, or nothing."""
    columns = np.genfromtxt(leg / "log.csv", delimiter=",", skip_header=1)
    late = np.column_stack([columns[:-4, :3], columns[4:, 3:]])
    np.savetxt(tmp_path / "log.csv", late, delimiter=",", comments="", header=HEADER, fmt="%.8g")
    for known in ("", "delay_s = 0.008\n", "delay_s = 0.005\n"):
        (tmp_path / "log.toml").write_text(f"{MAP}{known}", encoding="utf-8")
        found = mocobot.calibrate(tmp_path / "log.csv", leg / "leg.xml", map=tmp_path / "log.toml")
        told = to_dict(found.found, found.drives)["joints"]
        for joint in ("hip", "knee"):
            assert told[joint]["delay"]["mean"] == pytest.approx(0.008, abs=3e-4)


def test_the_diagnosis_names_late_commands_until_the_map_has_the_delay_found(leg, tmp_path):
    columns = np.genfromtxt(leg / "log.csv", delimiter=",", skip_header=1)
    late = np.column_stack([columns[:-4, :3], columns[4:, 3:]])  # 8 ms
    np.savetxt(tmp_path / "log.csv", late, delimiter=",", comments="", header=HEADER, fmt="%.8g")
    found = mocobot.calibrate(tmp_path / "log.csv", leg / "leg.xml", map=leg / "log.toml")
    found.write(tmp_path / "found")
    model, told = tmp_path / "found" / "as_found.xml", {}
    for map_ in (leg / "log.toml", tmp_path / "found" / "log.toml"):
        verdict = mocobot.diagnose(tmp_path / "log.csv", model, map=map_, closed_loop=False).to_dict()
        told[map_.parent.name] = {cause["cause"] for cause in verdict["causes"]}
    assert told.pop("found") == set()
    assert [*told.values()] == [{"torque_delay"}]


def test_a_robot_at_rest_is_refused(leg, tmp_path, capsys):
    columns = np.genfromtxt(leg / "log.csv", delimiter=",", skip_header=1)
    columns[:, 1:] = columns[0, 1:]
    np.savetxt(tmp_path / "log.csv", columns, delimiter=",", comments="", header=HEADER, fmt="%.8g")
    said = refused(capsys, "calibrate", tmp_path / "log.csv", "--model", leg / "leg.xml")
    assert "no joint moves by 10 mrad" in said


def test_commands_of_the_wrong_sign_are_doubted(leg, tmp_path):
    columns = np.genfromtxt(leg / "log.csv", delimiter=",", skip_header=1)
    columns[:, 3:] *= -1.0
    np.savetxt(tmp_path / "log.csv", columns, delimiter=",", comments="", header=HEADER, fmt="%.8g")
    found = mocobot.calibrate(tmp_path / "log.csv", leg / "leg.xml", map=leg / "log.toml")
    assert any(said.startswith("It does not follow the motion") for said in found.findings)


# Friction that deviates from Coulomb and viscous friction.


def test_drag_with_the_square_of_the_speed_is_in_the_model_as_found(tmp_path):
    """MuJoCo's own polynomial damping is the truth; the curve of friction over speed is compared, not its terms."""
    drag = 0.015
    folder = write_leg(tmp_path, 20.0, drag=(drag, 0.0))
    calibration = mocobot.calibrate(folder / "log.csv", folder / "leg.xml")
    assert any("deviates from Coulomb and viscous friction" in note for note in calibration.found.notes)
    found = as_found(calibration.found)[0].compile()
    values = {(p.place, p.name): p.value for p in calibration.found.parameters}
    data, log = mujoco.MjData(found), np.genfromtxt(folder / "log.csv", delimiter=",", names=True)
    for j, joint in enumerate(("hip", "knee")):
        speeds = np.linspace(0.3, 0.8, 9) * np.abs(np.gradient(log[f"{joint}_q"], log["t"])).max()
        true = DRY_NM[j] + VISCOUS[j] * speeds + drag * speeds**2
        nearest = values[joint, "coulomb_Nm"] + values[joint, "viscous_Nms_per_rad"] * speeds
        held = []
        for speed in speeds:
            data.qvel[:], data.qpos[:], data.ctrl[:] = np.eye(2)[j] * speed, 0.0, 0.0
            mujoco.mj_forward(found, data)
            held.append(
                found.dof_frictionloss[j] - data.qfrc_passive[j] - found.actuator_biasprm[j, 2] * speed
            )
        # All torques share the error of the gain, and the loop's own damping is no friction.
        gain = found.actuator_gainprm[j, 0] / KP
        off, off_nearest = (
            np.abs(x / true - 1.0).max() for x in (np.array(held) / gain - KD * speeds, nearest / gain)
        )
        assert off < min(0.02, 0.6 * off_nearest)


def test_friction_nearest_to_a_polynomial_is_that_polynomial():
    span = Span(torque=1.0, speed=2.0, acceleration=1.0, travel=1.0, middle=0.0, until_s=1.0)
    v = np.concatenate([np.linspace(-3.0, -0.1, 40), np.linspace(0.1, 3.0, 40)])
    none = np.zeros_like(v)
    signals = JointSignals(none, v, none, np.sign(v), none, none, none, none, none, span)

    def nearest(c: float, b: float, d: float, e: float) -> np.ndarray:
        return polynomial([signals], [c * np.sign(v) + b * v + d * v * np.abs(v) + e * v**3], -0.2)

    assert nearest(0.4, -0.1, 0.05, 0.02) == pytest.approx([0.4, -0.1, 0.05, 0.02])
    at_bounds = nearest(0.1, -0.3, 0.2, -0.05)
    assert at_bounds[1] >= -0.2
    assert at_bounds[3] >= 0.0
    assert at_bounds[0] >= 0.0
