"""Calibrations from positions and commands alone, of small arms that MuJoCo simulates: values, errors, forecasts."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import mocobot
from commanded.machine import arriving
from commanded_arm import ARM, LIFT, STEP_S, Arm
from discrepancy.joints.calibration import ArmCalibration

NOISE, RATE_HZ, SECONDS, WRONG = 2e-4, 100, 9, 3.0
TWO = Arm()
STAMPS = np.arange(RATE_HZ * SECONDS) / RATE_HZ
FRICTION = ("coulomb", "viscous")


def noisy(q: np.ndarray, seed: int = 0, size: float | np.ndarray = NOISE) -> np.ndarray:
    """Readings of positions."""
    return q + size * np.random.default_rng(seed).standard_normal(q.shape)


def calibrated(
    folder: Path, arm: Arm, text: str | None = None, mass: float = 1.0, **columns: np.ndarray
) -> ArmCalibration:
    """Calibrate from a model whose rotors and friction are three times too large or too small."""
    (folder / "arm.xml").write_text(arm.spec(WRONG, mass).to_xml(), encoding="utf-8")
    return mocobot.calibrate(arm.write(folder, text, **columns), folder / "arm.xml").found


def assert_honest(found: ArmCalibration, arm: Arm) -> None:
    """Every value is within four standard errors or 1.5 % of the truth, and errors of friction are below 25 %."""
    values = {(p.place, p.name): p for p in found.parameters}
    for key, true in arm.truth().items():
        p = values[key]
        assert abs(p.value - true) < max(4.0 * p.se, 0.015 * true), key
        if not key[1].startswith("armature"):
            assert p.determined, key
            assert p.se < 0.25 * true, key


@pytest.fixture(scope="module")
def commands() -> np.ndarray:
    return TWO.commands(STAMPS)


@pytest.fixture(scope="module")
def motion(commands) -> np.ndarray:
    """True positions of the arm under the commands."""
    return TWO.positions(STAMPS, commands)


@pytest.fixture(scope="module")
def plain(commands, motion, tmp_path_factory) -> tuple[Path, ArmCalibration]:
    """Folder of a calibration and what was found."""
    folder = tmp_path_factory.mktemp("arm")
    (folder / "arm.xml").write_text(TWO.spec(WRONG).to_xml(), encoding="utf-8")
    log = TWO.write(folder, t=STAMPS, q=noisy(motion), command=commands)
    done = mocobot.calibrate(log, folder / "arm.xml")
    done.write(folder / "out")
    return folder / "out", done.found


def test_values_are_found_from_a_start_that_is_three_times_wrong(plain):
    assert_honest(plain[1], TWO)


def test_forecasts_err_by_the_noise_of_the_readings(plain):
    """One second from commands alone, in the part that was not fitted."""
    assert plain[1].validated
    for part in plain[1].held_out:
        assert (part.calibrated < 3.0 * NOISE).all()
        assert (part.model > 50.0 * NOISE).all()


def test_the_model_as_found_follows_the_log_by_its_own_actuators(plain, commands, motion):
    """Plain MuJoCo, from where the log begins to its end, commands at the controls as late as they were found."""
    folder, found = plain
    late = [p.value for p in found.parameters if p.name == "command_delay_s"]
    spec = mujoco.MjSpec.from_file(str(folder / "as_found.xml"))
    spec.option.timestep, spec.option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
    model = spec.compile()
    assert model.nu == 2
    data, every = mujoco.MjData(model), round(1.0 / RATE_HZ / STEP_S)
    control = arriving(STAMPS, commands, np.array(late), STEP_S * np.arange(every * len(STAMPS) + 1))
    data.qpos[:], q = motion[0], np.empty_like(motion)
    for k in range(len(q)):
        q[k] = data.qpos
        for n in range(every):
            data.ctrl[:] = control[every * k + n]
            mujoco.mj_step(model, data)
    error = np.sqrt(np.mean((q - motion)[RATE_HZ:] ** 2, axis=0))
    assert (error < 2e-3).all()
    assert (error < 0.01 * motion.std(axis=0)).all()


def test_ranges_of_actuators_hold_the_truth(plain):
    told = json.loads((plain[0] / "actuators.json").read_text())
    truth, values = TWO.truth(), {(p.place, p.name): p for p in plain[1].parameters}
    for joint in TWO.joints:
        own = told["joints"][joint]
        for quantity, name in (
            ("coulomb_friction", "coulomb_Nm"), ("viscous_damping", "viscous_Nms_per_rad"),
            ("delay", "command_delay_s"),
        ):  # fmt: skip
            low, high = own[quantity]["range"]
            assert low < own[quantity]["mean"] < high
            assert low - 0.01 * truth[joint, name] < truth[joint, name] < high + 0.01 * truth[joint, name]
        assert own["stiffness"]["mean"] == TWO.kp[TWO.joints.index(joint)]
    matrix, rows = np.array(told["covariance"]["matrix"]), told["covariance"]["rows"]
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-6)
    assert np.linalg.eigvalsh(matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))).min() > 0.0
    names = {
        "coulomb_friction": "coulomb_Nm",
        "delay": "command_delay_s",
        "viscous_damping": "viscous_Nms_per_rad",
    }
    for k, (joint, quantity) in enumerate(rows):
        if quantity in names:
            assert np.sqrt(matrix[k, k]) == pytest.approx(values[joint, names[quantity]].se, rel=1e-6)


def test_commands_that_hold_for_long_and_a_delay_between_samples(commands, tmp_path):
    late = replace(TWO, late_s=0.0137)
    told = commands[np.arange(len(commands)) // 4 * 4]
    q = noisy(late.positions(STAMPS, told))
    for known in ("", "delay_s = 0.01\n"):
        found = calibrated(tmp_path, late, late.map(known), t=STAMPS, q=q, command=told)
        assert_honest(found, late)


def test_a_log_with_a_gap(tmp_path):
    t = np.arange(11 * RATE_HZ) / RATE_HZ
    told = TWO.commands(t)
    q, kept = noisy(TWO.positions(t, told)), (t < 5.0) | (t > 6.2)
    found = calibrated(tmp_path, TWO, t=t[kept], q=q[kept], command=told[kept])
    assert_honest(found, TWO)
    assert any("cut the log into 2 parts" in note for note in found.notes)


def test_missing_positions_cost_no_commands(plain, commands, motion, tmp_path):
    q, lost = noisy(motion), np.random.default_rng(3).random(len(motion)) < 0.05
    q[lost, 0], q[300:303] = np.nan, np.nan
    found = calibrated(tmp_path, TWO, t=STAMPS, q=q, command=commands)
    assert_honest(found, TWO)
    delays, whole = (
        [p.se for p in own.parameters if p.name == "command_delay_s"] for own in (found, plain[1])
    )
    assert (np.array(delays) < 1.5 * np.array(whole)).all()
    assert all((part.calibrated < 4.0 * NOISE).all() for part in found.held_out)


def test_drives_that_are_off_for_a_while(commands, tmp_path):
    on = ((STAMPS < 3.0) | (STAMPS > 4.0)) & ((STAMPS < 6.0) | (STAMPS > 6.4))
    q, text = noisy(TWO.positions(STAMPS, commands, on)), TWO.map(channels='enabled = { column = "on" }\n')
    found = calibrated(tmp_path, TWO, text, t=STAMPS, q=q, command=commands, on=on.astype(float))
    assert_honest(found, TWO)
    # The arm falls and swings freely while the drives are off.
    assert all((part.calibrated < 20.0 * NOISE).all() for part in found.held_out)


def test_a_slide_among_the_joints(tmp_path):
    lift = Arm(
        LIFT, (3000.0, 12.0), (60.0, 0.4), (0.8, 0.008), (6.0, 0.2), (15.0, 0.1), (0.08, 0.7), (0.0, 0.4)
    )  # fmt: skip
    told = lift.commands(STAMPS)
    q = noisy(lift.positions(STAMPS, told), size=np.array([3e-5, NOISE]))
    found = calibrated(tmp_path, lift, t=STAMPS, q=q, command=told)
    assert_honest(found, lift)
    assert all((part.calibrated < 2.5 * np.array([3e-5, NOISE])).all() for part in found.held_out)


def test_torques_told_beside_the_commands(commands, tmp_path):
    added = np.column_stack(
        [2.0 * np.sin(2.0 * np.pi * 0.7 * STAMPS), np.sin(2.0 * np.pi * 1.3 * STAMPS + 1.0)]
    )
    q = noisy(TWO.positions(STAMPS, commands, added=added))
    text = TWO.map(channels='feedforward = { column = "{joint} ff", unit = "Nm" }\n')
    found = calibrated(tmp_path, TWO, text, t=STAMPS, q=q, command=commands, ff=added)
    values = {(p.place, p.name): p for p in found.parameters}
    for key, true in TWO.truth().items():
        assert abs(values[key].value - true) < max(4.0 * values[key].se, 0.02 * true)
    assert all((part.calibrated < 2.0 * NOISE).all() for part in found.held_out)


def test_the_largest_torque_of_drives_that_reach_it(commands, tmp_path):
    """The map has limits off by a tenth; the shoulder reaches its own, the elbow never."""
    arm = replace(TWO, most=(5.0, 60.0))
    q = noisy(arm.positions(STAMPS, commands))
    text = arm.map("limit = [5.5, 54.0]\n")
    (tmp_path / "arm.xml").write_text(arm.spec(WRONG).to_xml(), encoding="utf-8")
    log = arm.write(tmp_path, text, t=STAMPS, q=q, command=commands)
    done = mocobot.calibrate(log, tmp_path / "arm.xml")
    assert_honest(done.found, arm)
    limits = {p.place: p for p in done.found.parameters if p.name == "limit_Nm"}
    assert set(limits) == {"shoulder"}
    assert abs(limits["shoulder"].value - 5.0) < 4.0 * limits["shoulder"].se < 0.2
    assert all((part.calibrated < 3.0 * NOISE).all() for part in done.found.held_out)
    done.write(tmp_path / "out")
    told = json.loads((tmp_path / "out/actuators.json").read_text())["joints"]["shoulder"]["effort_limit"]
    assert told["source"] == "logs"
    assert told["mean"] == limits["shoulder"].value
    gain = next(p.value for p in done.found.parameters if (p.place, p.name) == ("shoulder", "gain"))
    found_map = tomllib.loads((tmp_path / "out/log.toml").read_text())["control"]["limit"]
    assert found_map[0] == pytest.approx(told["mean"] * (1.0 + gain), rel=1e-6)


def test_positions_that_are_read_late_at_random(commands, tmp_path):
    """Up to 1 ms: the mean is a delay less, the rest is told, and delays keep honest errors."""
    ten = np.arange(10 * len(STAMPS)) / (10.0 * RATE_HZ)
    q = TWO.positions(ten, np.repeat(commands, 10, axis=0))
    early = replace(TWO, late_s=TWO.late_s - 5e-4)
    off = []
    for seed in range(3):
        late = np.random.default_rng(seed).uniform(0.0, 1e-3, commands.shape)
        read = np.column_stack([np.interp(STAMPS + late[:, j], ten, q[:, j]) for j in range(2)])
        found = calibrated(tmp_path, TWO, t=STAMPS, q=noisy(read, seed, 0.5 * NOISE), command=commands)
        assert_honest(found, early)
        assert any(
            "as if they were read up to 0.3 ms (rms) beside their stamps" in note for note in found.notes
        )
        off += [(p.value - early.late_s) / p.se for p in found.parameters if p.name == "command_delay_s"]
    assert np.sqrt(np.mean(np.square(off))) < 1.8


def test_a_free_velocity_gain_is_told_as_a_sum(commands, motion, tmp_path):
    text = TWO.map(velocity_gain='"free"')
    found = calibrated(tmp_path, TWO, text, t=STAMPS, q=noisy(motion), command=commands)
    both = [p for p in found.parameters if p.name.startswith("viscous")]
    for p, kd, viscous in zip(both, TWO.kd, TWO.viscous, strict=True):
        assert abs(p.value - kd - viscous) < max(4.0 * p.se, 0.01 * (kd + viscous))
    assert any("only their sum is determined" in note for note in found.notes)


def test_gains_that_are_known_within_a_factor(commands, motion, tmp_path):
    """Position and velocity gain are off by a factor of 1.5, up and down."""
    off = np.array([1.5, 0.7])
    gains = {"position_gain": (off * TWO.kp).tolist(), "velocity_gain": (off * TWO.kd).tolist()}
    text = TWO.map("gain_known_within = 2\n", **gains)
    found = calibrated(tmp_path, TWO, text, t=STAMPS, q=noisy(motion), command=commands)
    gains = [p for p in found.parameters if p.name.startswith("position_gain")]
    for p, told, true in zip(gains, off * TWO.kp, TWO.kp, strict=True):
        assert p.model == pytest.approx(told)
        assert abs(p.value - true) < max(2.5 * p.se, 0.01 * true)
        assert p.se < 0.6 * told
    assert not any("mean torque gain is held" in note for note in found.notes)


def test_gravity_tells_a_free_position_gain(tmp_path):
    """Gains follow from the masses of the model, which are right here."""
    heavy = ARM.replace('mass="1.1"', 'mass="2.4"').replace('mass="0.4"', 'mass="1.6"')
    arm = Arm(heavy, kp=(60.0, 30.0), kd=(0.6, 0.3))
    told = arm.commands(STAMPS)
    q = noisy(arm.positions(STAMPS, told))
    found = calibrated(tmp_path, arm, arm.map(position_gain='"free"'), t=STAMPS, q=q, command=told)
    gains = [p for p in found.parameters if p.name == "position_gain_Nm_per_rad"]
    assert len(gains) == 2
    for p, true in zip(gains, arm.kp, strict=True):
        assert abs(p.value - true) < min(2.5 * p.se, 0.15 * true)
    assert not any("mean torque gain is held" in note for note in found.notes)


@pytest.mark.slow
def test_errors_over_standard_errors_are_one(tmp_path):
    """Noise of twelve logs. What friction might deviate from its law counts as an error, so it errs by less here."""
    rate_hz, off = 50, {"armature": [], "command": [], "friction": []}
    t = np.arange(8 * rate_hz) / rate_hz
    told = TWO.commands(t)
    q = TWO.positions(t, told)
    for seed in range(12):
        found = calibrated(tmp_path, TWO, t=t, q=noisy(q, seed, 3e-4), command=told)
        values = {(p.place, p.name): p for p in found.parameters}
        for (place, name), true in TWO.truth().items():
            p = values[place, name]
            if p.determined:
                stem = name.split("_")[0]
                off[stem if stem in off else "friction"].append((p.value - true) / p.se)
    rms = {name: np.sqrt(np.mean(np.square(each))) for name, each in off.items()}
    assert len(off["command"]) == 24
    assert 0.6 < rms["armature"] < 1.4
    assert 0.6 < rms["command"] < 1.9  # delays scatter by half more than is told
    assert len(off["friction"]) == 48
    assert rms["friction"] < 1.4
