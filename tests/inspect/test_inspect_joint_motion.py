"""What an inspection says of a robot that rests, of torques in a wrong unit, and of delays beside friction."""

from __future__ import annotations

import numpy as np
import pytest

from joint_logs import write_csv
from made_arm import JOINTS, RATE_HZ, made, write_map, write_model
from mocobot import serial
from mocobot_inspect.findings import percent
from mocobot_inspect.report import later


def inspected(folder, values) -> serial.JointInspection:
    write_model(folder)
    return serial.inspect(write_csv(folder / "log.csv", values), folder / "arm.xml", map=write_map(folder))


def sticking(dq: np.ndarray, over_rad: float) -> np.ndarray:
    """Direction of dry friction that gives way by an angle before it slips (Dahl), in [-1, 1], shape (Q,)."""
    out = np.zeros(len(dq))
    for k in range(1, len(dq)):
        step = dq[k] / RATE_HZ / over_rad
        out[k] = np.clip(out[k - 1] + step - out[k - 1] * abs(step), -1.0, 1.0)
    return out


@pytest.mark.parametrize("noise", [0.0, 1e-5, 1e-3])
def test_a_robot_that_rests_does_not_move_however_its_encoders_hum(tmp_path, noise: float) -> None:
    rng, count = np.random.default_rng(0), 2000
    values = {"time": np.arange(count) / RATE_HZ}
    for joint in JOINTS:
        values[f"{joint} q"] = 0.3 + noise * rng.standard_normal(count)
        values[f"{joint} dq"] = 1e-3 * rng.standard_normal(count)
        values[f"{joint} torque"] = 5.0 + 0.05 * rng.standard_normal(count)
    found = inspected(tmp_path, values)
    assert not found.moves.any()
    assert found.ready_for == "ready for: nothing (no joint that moves has a torque, a command or a duty)"
    assert not [f.sentence for f in found.findings if "sign" in f.sentence or "follow" in f.sentence]
    assert "signs and order are not compared with the model" in str(found)


@pytest.mark.parametrize("late_s", [0.0, 0.008])
def test_friction_at_reversals_is_no_delay_and_hides_none(tmp_path, late_s: float) -> None:
    values = made(seconds=12.0)
    for joint, size in zip(JOINTS, (3.0, 9.0, 4.5), strict=True):
        name = f"{joint} torque"
        values[name] = values[name] + size * sticking(values[f"{joint} dq"], 0.001)
        values[name] = np.roll(values[name], round(late_s * RATE_HZ))
    found = inspected(tmp_path, values)
    assert found.delay is not None
    assert found.delay.delay_s == pytest.approx(late_s, abs=2e-3)
    assert bool([f for f in found.findings if f.sentence.startswith("torques run")]) == (late_s > 0)


def test_a_log_whose_torques_are_in_a_wrong_unit_is_not_ready(tmp_path) -> None:
    values = made()
    values |= {f"{joint} torque": 1e3 * values[f"{joint} torque"] for joint in JOINTS}
    found = inspected(tmp_path, values)
    assert found.ready_for.startswith(
        "ready for: nothing as it is; with the mistake above undone in the map: "
    )
    assert any("% of the samples" in f.sentence and "e+" not in f.sentence for f in found.findings)


def test_shares_and_delays() -> None:
    assert [percent(x) for x in (0.0, 0.00123, 0.0449, 0.994, 0.996, 1.0, 12.34)] == [
        "0", "0.12", "4.5", "99", "100", "100", "1234"
    ]  # fmt: skip
    assert [later(*x) for x in ((0.0123, 0.00021), (-0.0031, 0.0012), (np.nan, 0.1))] == [
        "12.30 +- 0.21 ms later", "3.1 +- 1.2 ms earlier", "by a delay that noise hides",
    ]  # fmt: skip


def test_a_slide_in_millimetres_may_be_the_mistake_behind_a_force(tmp_path) -> None:
    model = '<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/><geom size=".1" mass="10"/></body>'
    (tmp_path / "axis.xml").write_text(f"{model}</worldbody></mujoco>")
    time = np.arange(2000) / RATE_HZ
    position = 0.3 * np.sin(2.0 * time) + 0.1 * np.sin(5.0 * time)
    force = 10.0 * (-1.2 * np.sin(2.0 * time) - 2.5 * np.sin(5.0 * time))
    log = write_csv(tmp_path / "log.csv", {"time": time, "x": 1e3 * position, "force": force})
    text = 'joints = ["x"]\ntime = { column = "time", unit = "s" }\n[channels]\nq = { column = "x", unit = "m" }\n'
    (tmp_path / "log.toml").write_text(f'{text}torque = {{ column = "force", unit = "N" }}\n')
    (said,) = (f.sentence for f in serial.inspect(log, tmp_path / "axis.xml").findings)
    assert said.endswith(
        " times what the model asks for; is it in whole units, taken for thousandths, or its position in thousandths, "
        "taken for whole units?"
    )
