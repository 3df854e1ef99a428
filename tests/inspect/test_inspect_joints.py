"""Logs of a simulated arm whose masses are off by 30 %: each mistake is named, healthy oddities are not."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from estimator.errors import InputError
from joint_logs import write_csv
from made_arm import JOINTS, MAP, RATE_HZ, made, write_log, write_map, write_model
from mocobot import serial

COMMANDED = 'command = { column = "{joint} goal", unit = "rad" }\n[control]\ncommand = "position"\n'


@pytest.fixture(scope="module")
def healthy() -> dict[str, np.ndarray]:
    return made()


def inspected(folder, values, text: str = MAP) -> serial.JointInspection:
    log = write_log(folder, values)
    write_map(folder, text)
    return serial.inspect(log, folder / "arm.xml")


def sentences(found: serial.JointInspection) -> list[str]:
    return [finding.sentence for finding in found.findings]


@pytest.mark.parametrize("heavier", [0.6, 1.0, 1.6])
def test_a_healthy_log_has_nothing_wrong(tmp_path, heavier) -> None:
    found = inspected(tmp_path, made(heavier=heavier, seed=round(10 * heavier)))
    assert sentences(found) == []
    assert found.wiring is not None
    assert found.wiring.misfit.max() < 0.05
    assert found.ready_for == "ready for: a diagnosis from torques of 3 joints"
    assert "[[Wrong]]" not in str(found)
    for one in found.velocities:
        assert one.gain == pytest.approx(1.0, abs=0.01)
        assert abs(one.delay_s) < 1e-3
    assert found.delay is not None
    assert abs(found.delay.delay_s) < 2e-3


def changed(values: dict[str, np.ndarray], change) -> dict[str, np.ndarray]:
    values = {name: column.copy() for name, column in values.items()}
    change(values)
    return values


def exchange(*names):
    def change(values):
        for quantity in names:
            a, b = f"shoulder {quantity}", f"elbow {quantity}"
            values[a], values[b] = values[b], values[a]

    return change


def scale(name, factor):
    return lambda values: values.update({name: factor * values[name]})


def every(quantity, factor):
    return lambda values: values.update(
        {f"{joint} {quantity}": factor * values[f"{joint} {quantity}"] for joint in JOINTS}
    )


WIRING = {
    "sign of a torque": (scale("shoulder torque", -1), "torque of shoulder has the wrong sign"),
    "sign of a position": (
        lambda v: (scale("elbow q", -1)(v), scale("elbow dq", -1)(v)),
        "q of elbow has the wrong sign",
    ),
    "torques exchanged": (exchange("torque"), "torques of shoulder and elbow are exchanged"),
    "positions exchanged": (exchange("q", "dq"), "q of shoulder and elbow are exchanged"),
    "joints exchanged": (
        exchange("q", "dq", "torque"),
        "shoulder and elbow are exchanged, positions and torques",
    ),
    "all torques": (every("torque", -1), "torque of all joints has the wrong sign"),
    "degrees": (
        lambda v: (every("q", np.degrees(1.0))(v), every("dq", np.degrees(1.0))(v)),
        "q of all joints are degrees, taken for radians",
    ),
}


@pytest.mark.parametrize("case", list(WIRING))
def test_mistakes_against_the_model(tmp_path, healthy, case) -> None:
    change, said = WIRING[case]
    found = inspected(tmp_path, changed(healthy, change))
    assert found.wiring is not None
    assert [f"{s.partition(':')[0].partition(' (')[0]}" for s in sentences(found)] == [said]
    assert found.wiring.undone.max() < 0.05
    assert found.ready_for.startswith(
        "ready for: nothing as it is; with the mistake above undone in the map: "
    )


COLUMNS = {
    "velocity in degrees": (
        scale("elbow dq", np.degrees(1.0)),
        r"dq of elbow is 57\.\d+ times the derivative of its position: one of them is degrees, taken for radians",
    ),
    "velocity of another joint": (
        lambda v: v.update({"elbow dq": v["shoulder dq"]}),
        r"dq of elbow does not follow its position \(correlation 0\.\d+\): is it another joint's\?",
    ),
    "velocity with the wrong sign": (
        scale("elbow dq", -1),
        "dq of elbow runs against its position: one of them has the wrong sign",
    ),
    "filtered velocity": (
        lambda v: v.update({"elbow dq": np.roll(v["elbow dq"], 5)}),
        r"dq of elbow is (19\.\d+|20\.\d+) \+- 0\.\d+ ms later than its position: it is filtered",
    ),
    "late torques": (
        lambda v: v.update({f"{j} torque": np.roll(v[f"{j} torque"], 10) for j in JOINTS}),
        r"torques run (3\d|4\d)\.\d+ \+- \d\.\d+ ms behind the motion: .* left unexplained without .*, .* with it",
    ),
    "coarse": (
        lambda v: v.update({"elbow q": 0.05 * np.round(v["elbow q"] / 0.05)}),
        r"q of elbow comes in steps of 0\.05, \d\.?\d* % of all that it moves: .*",
    ),
    "no sign": (
        lambda v: v.update({"elbow torque": np.abs(v["elbow torque"])}),
        r"torque of elbow is never negative: has it lost its sign\?",
    ),
    "thousandths": (
        scale("shoulder torque", 1e3),
        r"torque of shoulder is 1[23]\d\d times what the model asks for; are its unit, gear .*",
    ),
    "clipped": (
        lambda v: v.update({"shoulder torque": np.clip(v["shoulder torque"], -9.0, 9.0)}),
        r"torque of shoulder is cut off at -?9: it stays there \d+ times, .*",
    ),
    "stuck": (
        lambda v: v["turret q"].__setitem__(slice(900, 1100), v["turret q"][900]),
        r"q of turret is stuck from 3\.60 s for 0\.80 s while others move",
    ),
    "limit": (
        lambda v: v.update({"shoulder torque": np.clip(4 * v["shoulder torque"], -60.0, 60.0)}),
        r"torque of shoulder is at the model's limit of 60 N m in \d\.?\d* % of the samples",
    ),
    "NaN": (
        lambda v: v["turret torque"].__setitem__(slice(3, 5), np.nan),
        r"torque of turret: 2 NaN of 2000 samples",
    ),
    "range": (
        lambda v: v.update({"shoulder q": v["shoulder q"] + 3.0}),
        r"q of shoulder reaches .* rad, beyond the model's range of -2 to 2",
    ),
}


@pytest.mark.parametrize("case", list(COLUMNS))
def test_mistakes_in_columns(tmp_path, healthy, case) -> None:
    change, said = COLUMNS[case]
    found = inspected(tmp_path, changed(healthy, change))
    assert any(re.fullmatch(said, sentence) for sentence in sentences(found)), sentences(found)


def test_a_duty_that_lost_its_sign(tmp_path, healthy) -> None:
    """A servo that logs a signed number of 16 bits as an unsigned one, and tells no torque."""
    values = changed(healthy, lambda _: None)
    for joint in JOINTS:
        duty = np.round(values.pop(f"{joint} torque") * 20)
        values[f"{joint} pwm"] = np.where(duty < 0, duty + 65536, duty)
    text = (
        MAP[: MAP.index("torque =")]
        + 'duty = { column = "{joint} pwm", unit = "counts", full_scale = 885 }\n'
    )
    lost = inspected(tmp_path, values, text)
    assert len(lost.signs_lost) == 3
    assert "is it a signed number of 16 bits without its sign (bits = 16 in the map)?" in lost.signs_lost[0]
    right = inspected(tmp_path, values, text.replace("full_scale", "bits = 16, full_scale"))
    assert sentences(right) == []
    assert right.ready_for == "ready for: a diagnosis from duties"
    assert right.wiring is not None
    assert right.wiring.misfit.max() < 0.05


def test_commands_that_are_exchanged_or_reversed(tmp_path, healthy) -> None:
    late = round(0.02 * RATE_HZ)
    text = MAP + COMMANDED
    values = healthy | {f"{joint} goal": np.roll(healthy[f"{joint} q"], -late) for joint in JOINTS}
    found = inspected(tmp_path, values, text)
    assert sentences(found) == []
    assert [round(1e3 * one.delay_s) for one in found.commands] == [20, 20, 20]
    crossed = changed(values, exchange("goal"))
    assert "shoulder and elbow follow each other's command: are the two exchanged?" in sentences(
        inspected(tmp_path, crossed, text)
    )
    reversed_ = changed(values, scale("elbow goal", -1))
    assert "q of elbow runs against its command: one of them has the wrong sign" in sentences(
        inspected(tmp_path, reversed_, text)
    )


def test_the_json_says_the_same(tmp_path, healthy) -> None:
    found = inspected(tmp_path, changed(healthy, scale("shoulder torque", -1)))
    found.write(tmp_path / "found.json")
    told = json.loads((tmp_path / "found.json").read_text(), parse_constant=pytest.fail)
    assert told["format"] == "mocobot-joint-inspection"
    assert [entry["kind"] for entry in told["mistakes"]] == ["torque_sign"]
    assert told["mistakes"][0]["joints"] == ["shoulder"]
    assert told["joints"]["elbow"]["moves"] is True
    assert [entry["sentence"] for entry in told["findings"]] == sentences(found)
    assert told["ready"] == found.ready_for


def test_logs_that_cannot_be_resampled_are_looked_at_all_the_same(tmp_path, healthy) -> None:
    values = changed(healthy, lambda v: v["time"].__setitem__(700, 0.0))
    found = inspected(tmp_path, values)
    assert found.unchecked is not None
    assert "time runs back" in found.unchecked
    assert "time runs backwards 1 time by 2.8 s after 2.80 s" in sentences(found)
    assert found.ready_for.startswith("ready for: nothing (")


def test_map_beside_the_log_comes_first(tmp_path, healthy) -> None:
    (tmp_path / "logs").mkdir()
    write_model(tmp_path)
    log = write_csv(tmp_path / "logs" / "log.csv", healthy)
    with pytest.raises(InputError, match=r"no map was given \(--map\)"):
        serial.inspect(log, tmp_path / "arm.xml")
    write_map(tmp_path)
    assert serial.inspect(log, tmp_path / "arm.xml").log_map.name == str(tmp_path / "log.toml")
    write_map(tmp_path / "logs")
    assert serial.inspect(log, tmp_path / "arm.xml").log_map.name == str(tmp_path / "logs" / "log.toml")


def test_a_torque_that_oscillates(tmp_path, healthy) -> None:
    def change(values):
        values["elbow torque"] = values["elbow torque"] + 2.0 * np.sin(2.0 * np.pi * 20.0 * values["time"])

    found = inspected(tmp_path, changed(healthy, change))
    (line,) = [c.oscillation for c in found.channels if c.name == "torque of elbow"]
    assert line is not None
    assert line.frequency_hz == pytest.approx(20.0, abs=0.3)
    assert line.amplitude == pytest.approx(2.0, rel=0.1)
    assert line.duration_s == pytest.approx(7.5)


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
