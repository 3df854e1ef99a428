"""What an inspection says of healthy joint logs that look odd: nothing; and numbers come with standard errors."""

from __future__ import annotations

import numpy as np
import pytest

from joint_logs import write_csv
from made_arm import JOINTS, MAP, RATE_HZ, made, write_map, write_model
from mocobot import serial

COMMANDED = 'command = { column = "{joint} goal", unit = "rad" }\n[control]\ncommand = "position"\n'


@pytest.fixture(scope="module")
def healthy() -> dict[str, np.ndarray]:
    return made()


def inspected(folder, values, text: str = MAP) -> serial.JointInspection:
    write_model(folder)
    return serial.inspect(
        write_csv(folder / "log.csv", values), folder / "arm.xml", map=write_map(folder, text)
    )


def sentences(found: serial.JointInspection) -> list[str]:
    return [finding.sentence for finding in found.findings]


@pytest.mark.parametrize("value", [1e300, -1e99, 1e6, np.inf])
@pytest.mark.parametrize("column", ["turret q", "elbow dq", "shoulder torque"])
def test_one_absurd_value_is_named_and_does_no_harm(tmp_path, healthy, column: str, value: float) -> None:
    values = healthy | {column: healthy[column].copy()}
    values[column][700] = value
    found = inspected(tmp_path, values)
    (said,) = sentences(found)
    joint, quantity = column.split()
    what = "infinite" if np.isinf(value) else "absurd"
    assert said.startswith(f"{quantity} of {joint}: 1 {what} of 2000 samples")
    assert found.ready_for == (
        "ready for: nothing as it is; with the absurd values left out of the log: a diagnosis from torques of 3 joints"
    )
    values[column][700] = np.nan  # the advice
    assert inspected(tmp_path, values).ready_for == (
        "ready for: a diagnosis from torques of 3 joints; rows that lack a value are left out"
    )


@pytest.mark.parametrize("payload_kg", [2.0, 6.0])
def test_a_payload_that_the_model_lacks_is_no_mistake(tmp_path, payload_kg: float) -> None:
    values = made(payload_kg=payload_kg, heavier=1.0)
    found = inspected(tmp_path, values)
    assert sentences(found) == []
    assert found.ready_for == "ready for: a diagnosis from torques of 3 joints"
    assert found.wiring is not None
    assert (found.wiring.payload is not None) == ("carry something" in str(found))


def test_a_payload_hides_no_mistake_and_no_wrong_unit(tmp_path) -> None:
    values = made(payload_kg=3.0, heavier=1.0)
    turned = values | {"shoulder torque": -values["shoulder torque"]}
    assert [s.partition(":")[0].partition(" (")[0] for s in sentences(inspected(tmp_path, turned))] == [
        "torque of shoulder has the wrong sign"
    ]
    scaled = values | {"shoulder torque": 1e3 * values["shoulder torque"]}
    assert any("times what the model asks for" in s for s in sentences(inspected(tmp_path, scaled)))


@pytest.mark.parametrize("noise", [0.0, 2e-5, 5e-5, 2e-4])
def test_a_joint_that_only_hums_is_neither_stuck_nor_cut_off(tmp_path, healthy, noise: float) -> None:
    rng, step = np.random.default_rng(2), 2.0 * np.pi / 2**17
    hums = 0.5 + noise * rng.standard_normal(2000)
    values = healthy | {
        "turret q": step * np.round(hums / step),
        "turret dq": 1e-3 * rng.standard_normal(2000),
    }
    found = inspected(tmp_path, values)
    assert not found.moves[0]
    assert sentences(found) == []


def dwelling(healthy: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The turret runs at one speed and stops within a sample for the last two seconds."""
    time = healthy["time"]
    q = 0.3 * np.minimum(time, 6.0) - 0.9
    values = healthy | {"turret q": 1e-5 * np.round(q / 1e-5), "turret dq": np.where(time < 6.0, 0.3, 0.0)}
    return values | {f"{joint} goal": values[f"{joint} q"] for joint in JOINTS}


def test_a_joint_that_dwells_is_not_stuck(tmp_path, healthy) -> None:
    values = dwelling(healthy)
    assert not [s for s in sentences(inspected(tmp_path, values, MAP + COMMANDED)) if "stuck" in s]
    values["turret goal"] = 0.3 * values["time"] - 0.9
    said = sentences(inspected(tmp_path, values, MAP + COMMANDED))
    assert any(s.startswith("q of turret is stuck from 6") for s in said)


def test_a_latency_that_all_joints_share(tmp_path, healthy) -> None:
    """Joints that are slow or noisy do not know it, and say so."""
    late, rng = round(0.012 * RATE_HZ), np.random.default_rng(1)
    values = dict(healthy)
    values["turret q"] = 0.02 * values["turret q"] + 1e-4 * rng.standard_normal(2000)
    values["turret dq"] = 0.02 * values["turret dq"]
    for joint in JOINTS:
        noise = 0.3 if joint == "turret" else 0.01
        values[f"{joint} dq"] = np.roll(values[f"{joint} dq"], late) + noise * rng.standard_normal(2000)
    found = inspected(tmp_path, values)
    delays = {JOINTS[one.joint]: (one.delay_s, one.delay_se_s) for one in found.velocities}
    assert np.isnan(delays["turret"][0])
    for joint in ("shoulder", "elbow"):
        delay, se = delays[joint]
        assert se < 1e-3
        assert abs(delay - 0.012) < 4.0 * se
    said = [s for s in sentences(found) if "dq" in s]
    assert len(said) == 1
    assert said[0].startswith("dq of every joint is 1")
    assert "turret: dq follows q" in str(found)
    assert "by a delay that noise hides" in str(found)
