"""Drives that are known by their commands: keys of [control], commands that hold, and torques that are asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from estimator.errors import InputError
from joint_logs import JOINTS, MAP, columns, motion, parsed, read, write_csv
from mocobot_logs.joints.joint_log import JointLog

TIME = np.arange(1500) / 500.0
COMMANDS = """
[channels.command]
column = "{joint}.goal"
unit = "rad"
"""
LIFT = """command.unit = "m"
"""
NO_TORQUE = MAP.replace('[channels.torque]\ncolumn = "{joint}.tau"\nunit = "Nm"\n', "").replace(
    'torque.unit = "N"\n', LIFT
)


def commanded(control: str, more: str = "") -> str:
    """A map of positions and commands."""
    head, lift = NO_TORQUE.split("[joint.lift.channels]")
    return (
        f'{head}{COMMANDS}{more}\n[joint.lift.channels]{lift}\n[control]\ncommand = "position"\n{control}\n'
    )


def staircase(time: np.ndarray) -> np.ndarray:
    """Commands that change every 20 ms, shape (Q, 3)."""
    return motion(np.floor(time / 0.02 + 1e-6) * 0.02)[0]


def log_of(path: Path, text: str, time: np.ndarray = TIME, **more: np.ndarray) -> JointLog:
    told = {f"{joint}.goal": staircase(time)[:, k] for k, joint in enumerate(JOINTS)}
    (log,) = read(write_csv(path / "log.csv", columns(time) | told | more), text)
    return log


def test_what_a_map_says_of_a_loop(tmp_path) -> None:
    control = """
gain_of = "torque"
position_gain = [20.0, "free", 900.0]
velocity_gain = "free"
gain_known_within = 2
delay_s = 0.004
between_commands = "interpolated"
"""
    drive = log_of(tmp_path, commanded(control) + "[joint.lift]\ngain_known_within = 1\n").drive
    assert drive.position_gain.tolist()[::2] == [20.0, 900.0]
    assert np.isnan(drive.position_gain[1])
    assert np.isnan(drive.velocity_gain).all()
    assert drive.gain_free.tolist() == [[False, True], [True, True], [False, True]]
    assert drive.gain_within[:, 0].tolist() == [2.0, np.inf, 1.0]
    assert drive.delay_s.tolist() == [0.004] * 3
    assert not drive.held
    plain = log_of(tmp_path, commanded("position_gain = 20")).drive
    assert plain.held
    assert not plain.gain_free.any()
    assert plain.gain_within.tolist() == [[1.0, 1.0]] * 3
    assert np.isnan(plain.delay_s).all()
    assert plain.feedforward is None


REFUSED = {
    'position_gain = "free?"': "control: position_gain is 'free?'; it must be a positive number, or \"free\"",
    "velocity_gain = -1": "control: velocity_gain is -1; it must be a number, not negative, or \"free\"",
    "gain_known_within = 0.5": "control: gain_known_within is 0.5; it must be a factor of at least 1",
    "delay_s = -0.01": "control: delay_s is -0.01; it must be a number of seconds, not negative",
    'between_commands = "spline"': "between_commands is 'spline'; it must be one of 'held', 'interpolated'",
}  # fmt: skip


@pytest.mark.parametrize("key", REFUSED)
def test_what_is_refused(key: str) -> None:
    with pytest.raises(InputError) as refused:
        parsed(commanded(key))
    assert REFUSED[key] in str(refused.value)


@pytest.mark.parametrize(
    ("quantity", "unit", "needed"),
    [("feedforward", "Nm", "a position or velocity"), ("command_velocity", "rad/s", "a position")],
)
def test_what_goes_with_a_command(quantity: str, unit: str, needed: str) -> None:
    text = MAP.replace(
        "[joint.lift", f'[channels.{quantity}]\ncolumn = "{{joint}}.x"\nunit = "{unit}"\n[joint.lift'
    ).replace('q.unit = "mm"', f'q.unit = "mm"\n{quantity}.unit = "{"N" if unit == "Nm" else "m/s"}"')
    with pytest.raises(
        InputError, match=f"channels: {quantity} goes with a command of {needed}; control's key"
    ):
        parsed(text)


def test_commands_hold_between_uneven_stamps(tmp_path) -> None:
    """A spline through a staircase rings; positions are smooth and are interpolated as ever."""
    rng = np.random.default_rng(1)
    time = np.round(TIME + rng.uniform(0.0, 8e-4, len(TIME)), 7)
    log = log_of(tmp_path, commanded("position_gain = 20"), time)
    assert log.resampled
    assert log.command is not None
    known, at = staircase(time), log.start_s + time[0] + log.time
    period = float(np.median(np.diff(time)))
    ends = np.append(time, time[-1] + 1.0)
    integral = np.concatenate([np.zeros((1, 3)), np.cumsum(known * np.diff(ends)[:, None], axis=0)])
    a, b = (np.column_stack([np.interp(t, ends, x) for x in integral.T]) for t in (at, at + period))
    np.testing.assert_allclose(log.command, (b - a) / period, rtol=0, atol=1e-5)
    np.testing.assert_allclose(log.q[50:-50], motion(at)[0][50:-50], atol=2e-5)
    rung = log_of(tmp_path, commanded('position_gain = 20\nbetween_commands = "interpolated"'), time).command
    assert rung is not None
    assert np.abs(rung - (b - a) / period).max() > 0.01
    low, high = known.min(axis=0), known.max(axis=0)
    assert np.all((log.command >= low - 1e-9) & (log.command <= high + 1e-9))


def test_commands_hold_at_a_lower_rate(tmp_path) -> None:
    text = commanded("position_gain = 20").replace(
        '[time]\ncolumn = "t"', '[time]\nrate_hz = 100\ncolumn = "t"'
    )
    log = log_of(tmp_path, text)
    assert log.rate_hz == 100.0
    rows = np.rint((log.start_s + log.time) * 500).astype(int)
    np.testing.assert_array_equal(log.command, staircase(TIME)[rows])


def test_commands_have_rows_of_their_own(tmp_path) -> None:
    """Positions at 500 Hz; commands at 50 Hz between them."""
    goal = np.arange(0.0051, 3.0, 0.02)
    told = motion(goal)[0]
    time = np.sort(np.concatenate([TIME, goal]))
    is_goal = np.isin(time, goal)
    values = {name: np.where(is_goal, np.nan, x) for name, x in columns(time).items()} | {"t": time}
    for k, joint in enumerate(JOINTS):
        column = np.full(len(time), np.nan)
        column[is_goal] = told[:, k]
        values[f"{joint}.goal"] = column
    (log,) = read(write_csv(tmp_path / "log.csv", values), commanded("position_gain = 20"))
    rows = goal[0] < TIME
    np.testing.assert_allclose(log.q, motion(TIME[rows])[0], rtol=0, atol=1e-12)
    # Each sample has the mean of what holds for its period.
    ends = np.append(goal, 3.1)
    passed = np.concatenate([np.zeros((1, 3)), np.cumsum(told * np.diff(ends)[:, None], axis=0)])
    a, b = (
        np.column_stack([np.interp(t, ends, x) for x in passed.T]) for t in (TIME[rows], TIME[rows] + 0.002)
    )
    np.testing.assert_allclose(log.command, (b - a) / 0.002, rtol=0, atol=1e-9)
    assert not log.resampled


def test_torques_that_a_loop_is_asked_for(tmp_path) -> None:
    """kp (q_d - q) + kd (dq_d - dq) + tau, as Unitree's motors have it, two samples after the command.

    At a sample, what has held changes to what will hold: the mean of both acts.
    """
    rng = np.random.default_rng(2)
    extra = {f"{joint}.{name}": rng.normal(size=len(TIME)) for joint in JOINTS for name in ("ff", "dgoal")}
    more = """
[channels.feedforward]
column = "{joint}.ff"
unit = "Nm"
[channels.command_velocity]
column = "{joint}.dgoal"
unit = "rad/s"
"""
    units = LIFT + 'feedforward.unit = "N"\ncommand_velocity.unit = "m/s"\n'
    gains = 'gain_of = "torque"\nposition_gain = [20, 30, 900]\nvelocity_gain = [1.5, 0, 40]\ndelay_s = 0.004'
    log = log_of(tmp_path, commanded(gains, more).replace(LIFT, units), **extra)
    now, before = (np.maximum(np.arange(len(TIME)) - k, 0) for k in (2, 3))
    q, dq = motion(TIME)
    ff, dgoal = (np.column_stack([extra[f"{joint}.{name}"] for joint in JOINTS]) for name in ("ff", "dgoal"))
    goal, dgoal_acts, ff_acts = (0.5 * (x[now] + x[before]) for x in (staircase(TIME), dgoal, ff))
    wanted = np.array([20, 30, 900]) * (goal - q) + np.array([1.5, 0, 40]) * (dgoal_acts - dq)
    assert log.torque is not None
    np.testing.assert_allclose(log.torque, wanted + ff_acts, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(log.drive.feedforward, ff)
    np.testing.assert_array_equal(log.drive.command_velocity, dgoal)


def test_gains_that_nobody_knows_ask_for_no_torque(tmp_path) -> None:
    assert log_of(tmp_path, commanded('position_gain = "free"\nvelocity_gain = 1')).torque is None
    damped = log_of(tmp_path, commanded('position_gain = 20\nvelocity_gain = "free"'))
    bare = log_of(tmp_path, commanded("position_gain = 20"))
    np.testing.assert_array_equal(damped.torque, bare.torque)
    assert damped.notes[-1].endswith(" The velocity gains are free, so they count as viscous friction.")
    rough = log_of(tmp_path, commanded("position_gain = 20\ngain_known_within = 2"))
    assert rough.torque is not None
    assert "The gains are known within a factor of 2, and so are these torques." in rough.notes[-1]


def test_positions_in_percent_of_a_range(tmp_path) -> None:
    text = NO_TORQUE.split("[joint.lift")[0].replace('unit = "deg"', 'unit = "%"\nrated = 1.5')
    text += COMMANDS + '[control]\ncommand = "position"\n[joint.lift.channels]\nq.rated = 0.25\n'
    text += 'dq.unit = "m/s"\ncommand.unit = "m"\n'
    log = log_of(tmp_path, text)
    raw = np.column_stack([columns(TIME)[f"{joint}.pos"] for joint in JOINTS])
    np.testing.assert_allclose(log.q, raw * [0.015, 0.015, 0.0025], rtol=1e-14)
