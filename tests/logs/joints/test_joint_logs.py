"""Logs of one robot's joints: drives, units, supplies, full turns, and the even grid."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.errors import InputError
from joint_logs import (
    JOINTS,
    MAP,
    TURNS,
    columns,
    motion,
    read,
    torques,
    write_csv,
    write_lerobot,
    write_table,
)
from mocobot_logs.joints.read import unwrapped

TIME = np.arange(1500) / 500.0


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_tables_are_read_as_they_are(tmp_path, suffix) -> None:
    (log,) = read(write_table(tmp_path / f"log{suffix}", columns(TIME)))
    q, dq = motion(TIME)
    assert log.joints == JOINTS
    assert log.rate_hz == log.native_hz == 500.0
    assert not log.resampled
    assert log.usable.all()
    assert log.notes == ()
    np.testing.assert_allclose(log.q, q, rtol=1e-14)
    np.testing.assert_array_equal(log.dq, dq)
    np.testing.assert_array_equal(log.torque, torques(TIME))
    np.testing.assert_allclose(log.time, TIME, atol=1e-12)
    assert log.command is None
    assert log.drive.command == "none"
    assert not log.drive.link_side.any()


def test_joints_come_in_the_models_order_whatever_the_maps(tmp_path) -> None:
    """A map that lists the joints as the log numbers them."""
    time, (q, _) = TIME, motion(TIME)
    order = (2, 0, 1)
    values = {"t": time} | {f"x{n}": q[:, k] for n, k in enumerate(order)}
    values |= {f"f{n}": torques(time)[:, k] for n, k in enumerate(order)}
    text = """
joints = ["lift", "hip", "knee"]
time = { column = "t", unit = "s" }
channels.q = { column = "x{index}", unit = "rad" }
channels.torque = { column = "f{index}", unit = "Nm" }
joint.lift.channels = { q.unit = "m", torque.unit = "N" }
drive.zero = [0.01, 0.2, -0.3]
"""
    (log,) = read(write_csv(tmp_path / "log.csv", values), text)
    np.testing.assert_allclose(log.q, q + np.array([0.2, -0.3, 0.01]), rtol=1e-14)
    np.testing.assert_array_equal(log.torque, torques(time))


MOTORS = """
joints = ["hip", "knee", "lift"]
time = { column = "t", unit = "s" }
channels.motor_position = { column = "m{number}", unit = "turn", sign = -1, offset = 0.25 }
channels.motor_velocity = { column = "w{number}", unit = "rpm" }
channels.current = { column = "i{number}", unit = "mA" }
[drive]
zero = [0.1, -0.2, 0.03]
torque_constant = [0.05, 0.06, 0.07]
"""
SPARSE = MOTORS + "gear = [50, -40, 300]\ncoupling.knee = { hip = 20 }\n"
MATRIX = MOTORS + "coupling = [[50, 0, 0], [20, -40, 0], [0, 0, 300]]\n"


def motor_columns(time: np.ndarray) -> dict[str, np.ndarray]:
    """Motors by the gears' own kinematics, torques by their power."""
    q, dq = motion(time)
    position, speed = q @ TURNS.T, dq @ TURNS.T
    torque = torques(time) @ np.linalg.inv(TURNS)  # power: motor torque . TURNS dq = torque . dq
    np.testing.assert_allclose(
        (torque * speed).sum(axis=1), (torques(time) * dq).sum(axis=1), rtol=1e-9, atol=1e-9
    )
    found = {"t": time}
    for k in range(3):
        found[f"m{k + 1}"] = -position[:, k] / (2 * np.pi) - 0.25
        found[f"w{k + 1}"] = speed[:, k] * 30 / np.pi
        found[f"i{k + 1}"] = 1e3 * torque[:, k] / (0.05, 0.06, 0.07)[k]
    return found


@pytest.mark.parametrize("text", [SPARSE, MATRIX], ids=["gears and coupling", "matrix"])
def test_coupled_drives_become_joints(tmp_path, text) -> None:
    (log,) = read(write_csv(tmp_path / "log.csv", motor_columns(TIME)), text)
    q, dq = motion(TIME)
    np.testing.assert_allclose(log.q, q + np.array([0.1, -0.2, 0.03]), atol=1e-12)
    np.testing.assert_allclose(log.dq, dq, atol=1e-11)
    np.testing.assert_allclose(log.torque, torques(TIME), atol=1e-10)
    np.testing.assert_allclose(log.drive.coupling @ TURNS, np.eye(3), atol=1e-14)
    np.testing.assert_array_equal(log.drive.gear, [50, -40, 300])
    np.testing.assert_array_equal(log.drive.torque_constant, [0.05, 0.06, 0.07])


def test_a_free_torque_constant_leaves_amperes_times_gear(tmp_path) -> None:
    text = MOTORS.replace("[0.05, 0.06, 0.07]", '[0.05, 0.06, "free"]') + "gear = [50, -40, 300]\n"
    values = motor_columns(TIME)
    (log,) = read(write_csv(tmp_path / "log.csv", values), text)
    assert np.isnan(log.drive.torque_constant).tolist() == [False, False, True]
    np.testing.assert_allclose(log.torque[:, 2], 300 * values["i3"] * 1e-3, rtol=1e-12)
    np.testing.assert_allclose(log.torque[:, 0], 50 * 0.05 * values["i1"] * 1e-3, rtol=1e-12)


def test_a_joint_without_a_torque_has_none(tmp_path) -> None:
    text = MAP + "torque = false\n"
    (log,) = read(write_csv(tmp_path / "log.csv", columns(TIME)), text.replace('torque.unit = "N"\n', ""))
    assert np.isnan(log.torque[:, 2]).all()
    np.testing.assert_array_equal(log.torque[:, :2], torques(TIME)[:, :2])


def test_lerobot_states_and_actions(tmp_path) -> None:
    """Positions and commands in degrees at 50 frames a second; the loop's gains tell the torques."""
    time = np.arange(300) / 50.0
    (q, _), (late, _) = motion(time), motion(time - 0.04)
    text = """
joints = ["hip", "knee", "lift"]
channels.q = { column = "observation.state.{joint}.pos", unit = "deg" }
channels.command = { column = "action.{joint}.pos", unit = "deg" }
joint.lift.channels = { q.unit = "m", command.unit = "m" }
control = { command = "position", position_gain = [30, 20, 900] }
"""
    scale = np.array([np.degrees(1), np.degrees(1), 1.0])
    folder = write_lerobot(tmp_path / "set", late * scale, q * scale, 50.0)
    (log,) = read(folder, text)
    assert log.rate_hz == 50.0
    assert log.torque is not None
    assert log.command is not None
    held = 0.5 * (
        log.command + np.concatenate([log.command[:1], log.command[:-1]])
    )  # before and after a sample
    np.testing.assert_allclose(log.torque, [30, 20, 900] * (held - log.q), atol=1e-9)
    np.testing.assert_allclose(log.q, late, atol=1e-6)
    np.testing.assert_allclose(log.command, q, atol=1e-6)
    assert log.drive.command == "position"
    assert log.drive.position_gain.tolist() == [30, 20, 900]
    assert np.isnan(log.drive.velocity_gain).all()


SERVO = """
joints = ["hip", "knee", "lift"]
time = { column = "t", unit = "s" }
[channels]
q = { column = "{joint}.pos", unit = "deg" }
duty = { column = "{joint}.pwm", unit = "counts", bits = 16, full_scale = 885 }
command = { column = "{joint}.goal", unit = "deg" }
supply = { column = "volts", unit = "V" }
enabled = { column = "on" }
[joint.lift.channels]
q.unit = "mm"
command.unit = "mm"
duty = false
motor_voltage = { column = "lift.volts", unit = "mV" }
[control]
command = "position"
gain_of = "firmware"
position_gain = 100
[[log]]
match = "kp400_*"
position_gain = 400
velocity_gain = [1, 2, 3]
"""


def servo_columns() -> dict[str, np.ndarray]:
    values = columns(TIME)
    duty = np.round(800 * np.sin(3 * TIME))
    values |= {f"{joint}.goal": values[f"{joint}.pos"] for joint in JOINTS}
    values |= {f"{joint}.pwm": np.where(duty < 0, duty + 65536, duty) for joint in JOINTS[:2]}
    values |= {"volts": 7.0 + 0.1 * np.cos(TIME), "on": (TIME < 1.0) * 1.0, "lift.volts": 500 * np.sin(TIME)}
    return values


def test_duty_supply_and_gains_by_the_name_of_the_file(tmp_path) -> None:
    values = servo_columns()
    (log,) = read(write_csv(tmp_path / "kp400_up.csv", values), SERVO)
    np.testing.assert_allclose(log.drive.duty[:, 0], np.round(800 * np.sin(3 * TIME)) / 885, atol=1e-15)
    # A supply is read as its mean, which follows this one of 0.16 Hz within its ends.
    np.testing.assert_allclose(log.drive.supply_V, values["volts"], atol=0.05)
    np.testing.assert_allclose(log.drive.duty[:, 2] * log.drive.supply_V, 0.5 * np.sin(TIME), atol=1e-12)
    np.testing.assert_array_equal(log.enabled, TIME < 1.0)
    assert log.drive.position_gain.tolist() == [400.0] * 3
    assert log.drive.velocity_gain.tolist() == [1.0, 2.0, 3.0]
    (other,) = read(write_csv(tmp_path / "kp100_up.csv", values), SERVO)
    assert other.drive.position_gain.tolist() == [100.0] * 3
    assert np.isnan(other.drive.velocity_gain).all()


def test_torques_of_analogue_drives_come_in_volts(tmp_path) -> None:
    """Of a hinge at its motor, and of a slide."""
    text = MAP.replace("[channels.torque]", "[channels.motor_torque]").replace(
        'unit = "Nm"', 'unit = "V"\nrated = 0.3'
    )
    text = text.replace('torque.unit = "N"', "motor_torque.rated = 2.5\n[drive]\ngear = [20, -10, 4]")
    (log,) = read(write_csv(tmp_path / "log.csv", columns(TIME)), text)
    newtons = torques(TIME) * np.array([20 * 0.3, -10 * 0.3, 4 * 2.5])
    np.testing.assert_allclose(log.torque, newtons, rtol=1e-13)


def test_rated_torques_and_counts(tmp_path) -> None:
    """What a drive on a field bus tells: counts of an encoder, and torque in thousandths of the rated one."""
    q, _ = motion(TIME)
    values = {"t": TIME} | {f"c{k}": np.round((q @ TURNS.T)[:, k] / (2 * np.pi) * 2**20) for k in range(3)}
    values |= {f"r{k}": torques(TIME)[:, k] for k in range(3)}
    text = """
joints = ["hip", "knee", "lift"]
time = { column = "t", unit = "s" }
channels.motor_position = { column = "c{index}", unit = "counts", counts_per_turn = 1048576 }
channels.motor_torque = { column = "r{index}", unit = "permille", rated = 2.4 }
[drive]
gear = [50, -40, 300]
coupling.knee = { hip = 20 }
"""
    (log,) = read(write_csv(tmp_path / "log.csv", values), text)
    np.testing.assert_allclose(log.q, q, atol=1e-6)
    np.testing.assert_allclose(log.torque, torques(TIME) * 0.0024 @ TURNS, rtol=1e-12, atol=1e-12)
    # One count of each motor; the knee's reading holds the rounding of two.
    step = 2 * np.pi / 2**20
    inverse = np.linalg.inv(TURNS)
    np.testing.assert_allclose(log.position_step, step * np.sqrt((inverse**2).sum(axis=1)), rtol=1e-6)


RATE_HZ, VOLTS = 200.0, 7.0
SUPPLY_TIME = np.arange(1600) / RATE_HZ
RINGS = np.random.default_rng(0).choice([-1.0, 0.0, 1.0], len(SUPPLY_TIME))
"""Readings of a bus at any instant of the drive's period: a volt less, as it is, or a volt more."""
SUPPLY_MAP = """
joints = ["hip", "knee", "lift"]
time = { column = "t", unit = "s" }
[channels]
q = { column = "{joint}.pos", unit = "rad" }
duty = { column = "{joint}.duty", unit = "1" }
supply = { column = "volts", unit = "V" }
[joint.lift.channels]
q.unit = "m"
[joint.knee.channels]
duty = false
motor_voltage = { column = "knee.volts", unit = "V" }
"""


def test_a_motors_voltage_does_not_ring_with_the_supply(tmp_path) -> None:
    """What a drive turns into torque is duty times supply: of a voltage that is told, that voltage."""
    told = 3.0 * np.sin(2.0 * SUPPLY_TIME)
    values = {"t": SUPPLY_TIME, "volts": VOLTS + RINGS, "knee.volts": told}
    values |= {f"{joint}.pos": SUPPLY_TIME for joint in JOINTS} | {
        f"{joint}.duty": told / VOLTS for joint in JOINTS
    }
    (log,) = read(write_csv(tmp_path / "log.csv", values), SUPPLY_MAP)
    assert log.drive.duty is not None
    assert log.drive.supply_V is not None
    np.testing.assert_allclose(log.drive.duty[:, 1] * log.drive.supply_V, told, atol=1e-12)
    np.testing.assert_allclose(log.drive.duty[:, 1], told / VOLTS, atol=0.05 * np.abs(told / VOLTS).max())
    assert log.drive.duty[:, 0] == pytest.approx(told / VOLTS)


def written(tmp_path, time: np.ndarray, **more: np.ndarray):
    return write_csv(tmp_path / "log.csv", columns(time) | more)


@pytest.mark.parametrize("rate_hz", [50.0, 333.0, 1000.0, 10_000.0])
def test_even_stamps_are_left_alone(tmp_path, rate_hz) -> None:
    time = np.arange(round(1.2 * rate_hz)) / rate_hz + 17.0
    (log,) = read(written(tmp_path, time))
    assert log.rate_hz == pytest.approx(rate_hz, rel=1e-6)
    assert not log.resampled
    assert log.start_s == 0.0
    np.testing.assert_allclose(log.q, motion(time)[0], rtol=1e-13)


def test_uneven_stamps_are_interpolated(tmp_path) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(1200) / 200.0 + rng.uniform(-0.3, 0.3, 1200) / 200.0
    (log,) = read(written(tmp_path, time))
    assert log.resampled
    assert log.rate_hz == pytest.approx(200.0, rel=0.05)
    at = log.time + log.start_s + time[0]
    np.testing.assert_allclose(log.q, motion(at)[0], atol=2e-5)
    assert "uneven" in log.notes[0]
    assert log.usable.all()


def test_a_rate_that_is_asked_for(tmp_path) -> None:
    time = np.arange(4000) / 2000.0
    (log,) = read(written(tmp_path, time), MAP.replace('column = "t"', 'column = "t"\nrate_hz = 500'))
    assert log.rate_hz == 500.0
    assert log.native_hz == 2000.0
    assert log.resampled
    np.testing.assert_allclose(log.q, motion(log.time + log.start_s)[0], atol=1e-5)
    with pytest.raises(InputError, match="rate_hz is 5000, but the log has 2000 samples a second"):
        read(written(tmp_path, time), MAP.replace('column = "t"', 'column = "t"\nrate_hz = 5000'))


def test_short_gaps_are_bridged_and_marked(tmp_path) -> None:
    time = np.arange(1500) / 500.0
    kept = np.ones(1500, bool)
    kept[[300, 301, 302, 900]] = False
    (log,) = read(written(tmp_path, time[kept]))
    np.testing.assert_array_equal(~log.usable, ~kept)
    np.testing.assert_allclose(log.q, motion(time)[0], atol=1e-7)
    assert log.notes == ("4 of 1500 samples are bridged gaps and are left out.",)


def test_rows_that_lack_a_value_are_gaps(tmp_path) -> None:
    time = np.arange(1500) / 500.0
    values = columns(time)
    values["knee.tau"][[40, 41]] = np.nan
    (log,) = read(write_csv(tmp_path / "log.csv", values))
    assert np.flatnonzero(~log.usable).tolist() == [40, 41]
    assert log.notes[0] == "2 rows lack a value (torque of knee first) and count as missing."


def test_long_gaps_cut_a_log(tmp_path) -> None:
    time = np.arange(5000) / 500.0
    kept = (time < 4) | ((time > 5) & (time < 5.3)) | (time > 7)
    one, two = read(written(tmp_path, time[kept]))
    assert one.name.endswith("log.csv (part 1)")
    assert two.start_s == pytest.approx(7.002)
    np.testing.assert_allclose(two.q, motion(two.time + two.start_s)[0], rtol=1e-9)
    assert "2 gaps of up to 1.7" in two.notes[0]
    assert "0.296 s are in none of them" in two.notes[0]


REFUSED = {
    "backwards": (
        lambda t: np.concatenate([t[:700], t[700:] - 0.5]),
        "time runs back by 0.498 s in row 700",
    ),
    "slow": (lambda t: t * 100, "at 5 Hz; 20 to 20000 Hz are allowed (is the unit of time right?)"),
    "fast": (lambda t: t / 100, "at 50000 Hz; 20 to 20000 Hz are allowed (is the unit of time right?)"),
    "scattered": (lambda t: t + 10 * np.floor(10 * t), "no part of it has samples for 1 s"),
    "one time": (lambda t: np.floor(t * 100) / 100, "at one time, in row 1"),
}


@pytest.mark.parametrize("case", list(REFUSED))
def test_stamps_that_cannot_be_used(tmp_path, case) -> None:
    change, said = REFUSED[case]
    time = np.arange(1500) / 500.0
    path = write_csv(tmp_path / "log.csv", columns(time) | {"t": change(time)})
    with pytest.raises(InputError) as refused:
        read(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert said in str(refused.value)


def test_values_that_cannot_be_used(tmp_path) -> None:
    time = np.arange(1500) / 500.0
    values = columns(time)
    values["hip.tau"][7] = np.inf
    with pytest.raises(InputError, match="torque of hip is inf in row 7"):
        read(write_csv(tmp_path / "log.csv", values))
    values["hip.tau"][:400] = np.nan
    with pytest.raises(InputError, match=r"torque of hip has no value in 26.7 % of the rows; at most 10 %"):
        read(write_csv(tmp_path / "log.csv", values))
    for joint in JOINTS:
        values[f"{joint}.tau"][:] = np.nan
    with pytest.raises(
        InputError, match=r"has no value in any row for torque of hip, knee, lift; without a torque"
    ):
        read(write_csv(tmp_path / "log.csv", values))
    with pytest.raises(InputError, match="has 20 samples; at least 32"):
        read(written(tmp_path, time[:20]))
    with pytest.raises(InputError, match="no part of it has samples for 1 s"):
        read(written(tmp_path, time[:400]))
    with pytest.raises(InputError, match=r"missing column 'knee.vel' for dq of knee by map my.toml"):
        read(write_csv(tmp_path / "log.csv", {k: v for k, v in columns(time).items() if k != "knee.vel"}))


def test_positions_within_one_turn_are_unwrapped() -> None:
    time = np.linspace(0.0, 10.0, 2001)
    true = np.column_stack([4.0 * np.sin(time), 0.5 * np.sin(time)])
    told = (true + np.pi) % (2.0 * np.pi) - np.pi
    told[7, 0] = np.nan
    out, notes = unwrapped(told, ["q of elbow", "q of wrist"])
    known = np.isfinite(told)
    assert np.allclose(out[known], true[known])
    assert len(notes) == 1
    assert notes[0].startswith("q of elbow is told within one turn; ")
