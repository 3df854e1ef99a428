"""Rollouts of robots simulated by MuJoCo, or known in closed form: what models leave, and what they cannot say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from discrepancy.evidence.findings import Event, Finding, Member
from discrepancy.joints.mechanics import Tree, inverse_torque
from discrepancy.joints.model import SerialModel, load_model
from discrepancy.joints.rolled import (
    LoggedTorques,
    Robot,
    diverged,
    in_neither,
    laws_without,
    longest,
    rms,
    rolled_out,
    starts,
    usable,
)
from discrepancy.joints.signals import Signals
from discrepancy.result.tables import rollout_lines
from mocobot_logs.joints.joint_log import Drive, JointLog
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import step
from serial_made import simulated

TWO_LINKS = """
<mujoco><compiler angle="radian"/><option timestep="0.0005" integrator="Euler"/><worldbody>
  <body><inertial mass="3" pos="0.2 0 0" diaginertia="0.01 0.05 0.05"/>
    <joint name="shoulder" axis="0 1 0" armature="0.2"/>
    <body pos="0.4 0 0"><inertial mass="2" pos="0.15 0 0" diaginertia="0.01 0.02 0.02"/>
      <joint name="elbow" axis="0 1 0" armature="0.1"/></body></body>
</worldbody></mujoco>"""
TURNTABLE = """
<mujoco><compiler angle="radian"/><worldbody><body>
  <inertial mass="1" pos="0 0 0" diaginertia="0.5 0.5 0.5"/><joint name="table" axis="0 0 1"/></body></worldbody>
</mujoco>"""
INERTIA, RUBS = 0.5, 0.2


def read(folder: Path, text: str) -> SerialModel:
    path = folder / "robot.xml"
    path.write_text(text, encoding="utf-8")
    return load_model(path)


def drive(joints: int, **changed: object) -> Drive:
    one, unknown = np.ones(joints), np.full(joints, np.nan)
    plain = Drive(one, np.eye(joints), one, np.zeros(joints, dtype=bool), "none", unknown, unknown, "torque",
                  np.full(joints, np.inf))  # fmt: skip
    return replace(plain, **changed)  # type: ignore[arg-type]


def turning(rubs: float = RUBS, seconds: float = 6.0, rate_hz: float = 500.0) -> JointLog:
    """A table that swings to and fro by 0.6 rad at 0.4 Hz; its drive also bears dry friction."""
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    w = 2.0 * np.pi * 0.4
    q, dq, ddq = 0.6 * np.sin(w * time), 0.6 * w * np.cos(w * time), -0.6 * w**2 * np.sin(w * time)
    torque = INERTIA * ddq + rubs * np.sign(dq)
    return JointLog(
        "table", time, rate_hz, q[:, None], torque[:, None], None, None, ("table",), drive(1), np.zeros(1),
        np.ones(len(time), dtype=bool), rate_hz,
    )  # fmt: skip


@pytest.fixture
def few_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Enough where only who is rolled out matters."""
    monkeypatch.setattr("discrepancy.joints.rolled.MOST_STARTS", 10)


def signals(model: SerialModel, log: JointLog) -> Signals:
    return Signals.of(log, Tree.of(model.model), partial(inverse_torque, model.model))


def finding(cause: str, place: str, joint: int | None, values: dict[str, float], **more: Any) -> Finding:
    return Finding(cause, place, joint, (Member(place, joint, values, {}),), 0.99, 50.0, 0.0, 0.0, **more)


def verdict(
    model: SerialModel,
    parts: Sequence[Signals],
    findings: Sequence[Finding] = (),
    by_the_others: Callable[[int], tuple[Finding, ...]] | None = None,
) -> Any:
    """What rollouts read of a verdict."""
    lasting = tuple(f for f in findings if f.event is None)
    return SimpleNamespace(
        model=model, parts=parts, trials=tuple(f"trial {k + 1}" for k in range(len(parts))), motors=(), reference=(),
        findings=tuple(findings), by_the_others=by_the_others or (lambda _: lasting),
    )  # fmt: skip


def halves(s: Signals, number: int = 2) -> list[Signals]:
    """Trials of one log."""
    out = []
    for here in np.array_split(np.arange(len(s.time)), number):
        names = ("time", "q", "dq", "ddq", "torque", "usable", "inverse")
        out.append(replace(s, **{name: getattr(s, name)[here] for name in names}))
    return out


def let_go(model: SerialModel, s: Signals, first: int, ahead: int) -> np.ndarray:
    """Errors of the given model from one start."""
    robot = Robot.of(model, (), s.rate_hz)
    torques = LoggedTorques.of(s.log, robot.readings)
    return robot.errors(s, slice(first, first + ahead + 1), torques, np.full(s.q.shape[1], np.pi))


def test_friction_that_a_model_lacks_turns_it_by_half_of_torque_over_inertia_times_time_squared(
    tmp_path: Path,
) -> None:
    """In closed form; from 2.55 s on the table turns one way for 0.5 s."""
    model = read(tmp_path, TURNTABLE)
    s = signals(model, turning())
    first, ahead = int(np.searchsorted(s.time, 2.55)), round(0.5 * s.rate_hz)
    assert (s.dq[first : first + ahead + 1] > 0.2).all()
    time = np.arange(ahead + 1) / s.rate_hz
    error = let_go(model, s, first, ahead)[:, 0]
    np.testing.assert_allclose(error, RUBS / INERTIA * time**2 / 2.0, atol=1.2e-4)
    assert error[-1] > 0.049


def test_the_true_model_leaves_integration_errors(tmp_path: Path) -> None:
    model = read(tmp_path, TURNTABLE)
    s = signals(model, turning(0.0))
    assert np.abs(let_go(model, s, 300, round(0.5 * s.rate_hz))).max() < 5e-5


@pytest.fixture(scope="module")
def two_links(tmp_path_factory: pytest.TempPathFactory) -> SerialModel:
    return read(tmp_path_factory.mktemp("arm"), TWO_LINKS)


@pytest.fixture(scope="module")
def rubbing(two_links: SerialModel) -> JointLog:
    """An arm with friction at the elbow, by MuJoCo's own."""
    hidden = mujoco.MjSpec.from_string(TWO_LINKS)
    elbow = hidden.joint("elbow")
    elbow.frictionloss, elbow.damping = 0.8, [0.4, 0.0, 0.0]
    elbow.solref_friction, elbow.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    return simulated(hidden.compile(), 4, seconds=12.0)


RUB = {"coulomb_Nm": 0.8, "viscous_Nms_per_rad": 0.4}


def rubs(share: float = 1.0) -> Finding:
    return finding("friction", "elbow", 2, {name: share * value for name, value in RUB.items()})


def test_before_is_what_plain_mujoco_does(two_links: SerialModel, rubbing: JointLog) -> None:
    """One rollout by ``mj_step`` and ``np.interp``, with MuJoCo's own integrator."""
    s, first, ahead = signals(two_links, rubbing), 400, 50
    model = mujoco.MjModel.from_xml_string(TWO_LINKS)
    model.opt.integrator, model.opt.timestep = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST), 1e-3
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = s.q[first], s.dq[first] - 0.5e-3 * s.ddq[first]
    assert rubbing.torque is not None
    expected = [np.zeros(2)]
    for k in range(1, ahead + 1):
        for _ in range(round(1.0 / s.rate_hz / 1e-3)):
            now = s.time[first] + data.time
            data.qfrc_applied[:] = [np.interp(now, rubbing.time, rubbing.torque[:, j]) for j in range(2)]
            mujoco.mj_step(model, data)
        expected.append(data.qpos - s.q[first + k])
    error = let_go(two_links, s, first, ahead)
    assert np.abs(error[-1]).max() > 0.01
    np.testing.assert_allclose(error, expected, atol=1e-9)


def test_what_is_found_predicts_the_other_trial(two_links: SerialModel, rubbing: JointLog) -> None:
    """Two trials of one log; each with what the other one gave, and a line of progress for each."""
    asked, said = [], []

    def others(trial: int) -> tuple[Finding, ...]:
        asked.append(trial)
        return (rubs(),)

    rolled = rolled_out(
        verdict(two_links, halves(signals(two_links, rubbing)), [rubs()], others), said.append
    )
    assert rolled is not None
    assert asked == [0, 1]
    assert "rolling out trial 2 (trial 2 of 2)" in said
    assert rolled["validated"]
    assert rolled["why_not"] is None
    assert [h["seconds"] for h in rolled["horizons"]] == [0.1, 0.2, 0.5]
    assert rolled["commanded"]["why_not"] == "the log has no commands"
    for horizon, most in zip(rolled["horizons"], (1e-3, 2e-3, 6e-3), strict=True):
        assert 40 <= horizon["starts"] <= 70
        assert horizon["before"]["diverged"] == horizon["after"]["diverged"] == [0, 0]
        assert max(horizon["after"]["rms"]) < most
        assert horizon["removed"][1] > 0.95
    text = "\n".join(rollout_lines({"rollouts": rolled}))
    assert "Rolled out from measured states under the logged torques (on blocks left out of the fit)" in text


@pytest.mark.usefixtures("few_starts")
def test_values_are_those_of_the_other_trials(two_links: SerialModel, rubbing: JointLog) -> None:
    """Where these are wrong, the gain is gone, whatever all trials together say."""
    parts = halves(signals(two_links, rubbing))
    rolled = rolled_out(verdict(two_links, parts, [rubs()], lambda trial: (rubs(0.0),)))
    assert rolled is not None
    assert rolled["horizons"][1]["removed"][1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.usefixtures("few_starts")
def test_nothing_named_has_no_after(two_links: SerialModel, rubbing: JointLog) -> None:
    rolled = rolled_out(verdict(two_links, [signals(two_links, rubbing)]))
    assert rolled is not None
    assert not rolled["validated"]
    assert {(h["after"], h["removed"]) for h in rolled["horizons"]} == {(None, None)}


def test_no_rollouts_with_a_reference(two_links: SerialModel, rubbing: JointLog) -> None:
    made = verdict(two_links, [signals(two_links, rubbing)], [rubs()])
    made.reference = ("before",)
    assert rolled_out(made) is None


def test_what_rollouts_lack_is_listed(two_links: SerialModel, rubbing: JointLog) -> None:
    push = finding("push", "last link", None, {"x_N": 1.0}, event=Event(0, 2.0, 9.0))
    bends = finding("elasticity", "elbow", 2, {"compliance_rad_per_Nm": 1e-3})
    rolled = rolled_out(verdict(two_links, [signals(two_links, rubbing)], [rubs(), push, bends]))
    assert rolled is not None
    assert rolled["not_simulated"] == ["elasticity of elbow", "push on the last link"]
    assert 8 <= rolled["horizons"][0]["starts"] <= 15  # no start in the 9 s of the push


@pytest.mark.usefixtures("few_starts")
def test_what_mujoco_refuses_is_said(two_links: SerialModel, rubbing: JointLog) -> None:
    lost = finding("link_mass", "link of elbow", None, {"excess_kg": float("nan")})
    rolled = rolled_out(verdict(two_links, [signals(two_links, rubbing)], [lost]))
    assert rolled is not None
    assert rolled["refused"][0].startswith("trial 1: MuJoCo refuses the model")
    assert rolled["horizons"][0]["after"]["rms"] == [None, None]
    assert rolled["horizons"][0]["before"]["rms"] != [None, None]


@pytest.mark.usefixtures("few_starts")
def test_many_trials_have_no_more_starts(two_links: SerialModel, rubbing: JointLog) -> None:
    rolled = rolled_out(verdict(two_links, halves(signals(two_links, rubbing), 20)))
    assert rolled is not None
    assert 4 <= rolled["horizons"][0]["starts"] <= 11


def test_a_joint_without_torques_is_named(two_links: SerialModel, rubbing: JointLog) -> None:
    torque = np.array(rubbing.torque)
    torque[:, 1] = np.nan
    rolled = rolled_out(verdict(two_links, [signals(two_links, replace(rubbing, torque=torque))]))
    assert rolled is not None
    assert rolled["why_not"] == "no torque of joint elbow is known"
    assert rolled["horizons"] == []


def test_no_start_where_something_is_not_known(two_links: SerialModel, rubbing: JointLog) -> None:
    holes = rubbing.usable.copy()
    holes[2000:2020] = False
    torque = np.array(rubbing.torque)
    torque[3000:3010, 1] = np.nan
    s = signals(two_links, replace(rubbing, usable=holes, torque=torque))
    good = usable(s)
    seen = starts(good, 0, 7, 125, 25)
    assert len(seen) > 20
    for sample, reach in seen:
        span = (s.time[sample], s.time[sample + reach])
        for low, high in ((4.0, 4.04), (6.0, 6.02)):
            assert span[1] < low or span[0] > high
    event = usable(s, [Event(0, 1.0, 0.5)])
    assert not event[(s.time >= 1.0) & (s.time <= 1.5)].any()
    assert event.sum() > good.sum() - 0.55 * s.rate_hz


def test_starts_reach_no_farther_than_their_trial() -> None:
    good = np.ones(40, dtype=bool)
    assert starts(good[:30], 10, 5, 50, 25) == []
    assert starts(good, 10, 10, 15, 5) == [(10, 15), (20, 15), (30, 9)]
    good[22] = False
    assert starts(good, 10, 10, 15, 5) == [(10, 11), (30, 9)]


def test_a_log_with_holes_every_so_often_has_no_horizon_that_is_longer(tmp_path: Path) -> None:
    """Known for 0.32 s at a time, smoothing left out: none of 0.5 s; known for less than 0.1 s, none at all."""
    model = read(tmp_path, TURNTABLE)
    s = signals(model, turning())

    def with_holes(apart_s: float) -> Any:
        known = np.ones((len(s.time), 1), dtype=bool)
        known[:: round(apart_s * s.rate_hz)] = False
        return rolled_out(verdict(model, [replace(s, usable=known)]))

    assert {h["seconds"] for h in with_holes(0.4)["horizons"]} == {0.1, 0.2}
    none = with_holes(0.15)
    assert none["horizons"] == []
    assert none["why_not"].startswith("nowhere in a trial")


def test_what_diverges_is_counted_and_in_no_error() -> None:
    before = np.array([[0.1, 0.3], [np.nan, 0.4], [0.2, np.nan], [0.2, 0.0]])
    np.testing.assert_array_equal(diverged(before), [1, 1])
    np.testing.assert_allclose(rms(before), [np.sqrt(0.09 / 3.0), np.sqrt(0.25 / 3.0)])
    np.testing.assert_allclose(in_neither(before, before / 2.0)[2], 0.5)
    assert np.isnan(rms(np.full((4, 1), np.nan))).all()
    assert np.isnan(rms(np.array([[0.1], [np.nan], [np.nan]]))).all()


def test_a_joint_that_is_half_a_turn_off_has_diverged(tmp_path: Path) -> None:
    log, model = turning(0.0), read(tmp_path, TURNTABLE)
    assert log.torque is not None
    s = signals(model, replace(log, torque=log.torque + 20.0))
    error = let_go(model, s, 300, 125)[:, 0]
    # Half of 20 N m over 0.5 kg m^2 times time squared is pi at 0.396 s.
    gone = np.flatnonzero(np.isnan(error))
    assert gone[0] / s.rate_hz == pytest.approx(np.sqrt(2.0 * np.pi * INERTIA / 20.0), abs=2.0 / s.rate_hz)
    assert np.isnan(error[gone[0] :]).all()


def commanded(rubs: float, kp: float = 40.0, kv: float = 2.0) -> JointLog:
    """A turntable under MuJoCo's own position actuator, with friction of MuJoCo's; steps as long as the rollouts'."""
    spec = mujoco.MjSpec.from_string(TURNTABLE)
    spec.option.timestep, spec.option.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_EULER  # no implicit loop
    spec.add_actuator(name="servo", target="table", trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_position(
        kp=kp, kv=kv
    )
    joint = spec.joint("table")
    joint.frictionloss = rubs
    joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    model = spec.compile()
    data, rate_hz, rows = mujoco.MjData(model), 500.0, []
    for k in range(round(6.0 * rate_hz) * 2):
        if k % 2 == 0:
            data.ctrl[0] = 0.5 * np.sin(2.5 * data.time) + 0.3 * np.sin(5.3 * data.time)
            mujoco.mj_forward(model, data)
            rows.append((data.qpos[0], data.ctrl[0], data.actuator_force[0]))
        mujoco.mj_step(model, data)
    q, command, torque = (np.array(column)[:, None] for column in zip(*rows, strict=True))
    own = drive(1, command="position", position_gain=np.full(1, kp), velocity_gain=np.full(1, kv))
    return JointLog(
        "table", np.arange(len(q)) / rate_hz, rate_hz, q, torque, None, command, ("table",), own, np.zeros(1),
        np.ones(len(q), dtype=bool), rate_hz,
    )  # fmt: skip


@pytest.mark.usefixtures("few_starts")
def test_closed_loop_of_mujocos_own_servo(tmp_path: Path) -> None:
    """Where the model is right the loop follows the log; friction that it lacks shows, and is gone once it is named."""
    model = read(tmp_path, TURNTABLE)
    right = rolled_out(verdict(model, halves(signals(model, commanded(0.0)))))
    assert right is not None
    assert right["commanded"]["joints"] == [1]
    assert right["commanded"]["before"][0] < 2e-4
    assert right["commanded"]["after"] is None
    rub = finding("friction", "table", 1, {"coulomb_Nm": 1.0, "viscous_Nms_per_rad": 0.0})
    found = rolled_out(verdict(model, halves(signals(model, commanded(1.0))), [rub]))
    assert found is not None
    loop = found["commanded"]
    assert loop["before"][0] > 5e-3
    assert loop["removed"][0] > 0.9
    assert [(b["name"], round(b["seconds"])) for b in loop["blocks"]] == [("trial 1", 3), ("trial 2", 3)]
    assert "loops closed (on blocks left out of the fit)" in "\n".join(rollout_lines({"rollouts": found}))


@pytest.mark.usefixtures("few_starts")
def test_closed_loops_are_as_long_as_one_hundred_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("discrepancy.joints.rolled.MOST_LOOP_S", 4.0)
    model = read(tmp_path, TURNTABLE)
    rolled = rolled_out(verdict(model, halves(signals(model, commanded(0.0)))))
    assert rolled is not None
    assert [b["seconds"] for b in rolled["commanded"]["blocks"]] == pytest.approx([2.0, 2.0], abs=0.01)


@pytest.mark.usefixtures("few_starts")
def test_loops_that_the_map_does_not_tell_are_not_closed(tmp_path: Path) -> None:
    model, log = read(tmp_path, TURNTABLE), commanded(1.0)
    no_gain = replace(log, drive=replace(log.drive, position_gain=np.full(1, np.nan)))
    rolled = rolled_out(verdict(model, [signals(model, no_gain)]))
    assert rolled is not None
    assert rolled["commanded"]["why_not"] == "joint table: the map has no position_gain"


def test_the_law_of_a_firmware_is_that_of_the_other_trials(tmp_path: Path) -> None:
    """Duty per rad of error is 2 in the first half of a log and 3 in the second."""
    model, log = read(tmp_path, TURNTABLE), turning()
    rng = np.random.default_rng(0)
    error = rng.standard_normal((len(log.time), 1)) * 0.05
    gain = np.where(log.time < log.time[len(log.time) // 2], 2.0, 3.0)[:, None]
    drive_told = replace(log.drive, command="position", duty=gain * error, gain_of="firmware")
    s = signals(model, replace(log, command=log.q + error, drive=drive_told))
    parts = halves(s)
    assert [laws_without(parts, k)[0].per_rad for k in range(2)] == [
        pytest.approx(3.0, rel=1e-3),
        pytest.approx(2.0, rel=1e-3),
    ]
    assert 2.0 < laws_without([s], 0)[0].per_rad < 3.0  # of a single trial, its own
    apart = [replace(part, log=replace(s.log, name=f"log {k}")) for k, part in enumerate(parts)]
    assert len(laws_without(apart, 0)) == 1


def test_the_longest_run_of_what_is_known() -> None:
    good = np.array([1, 1, 0, 1, 1, 1, 0, 1], dtype=bool)
    assert longest(good) == slice(3, 6)
    assert longest(~np.ones(3, dtype=bool)) == slice(0, 0)


def test_dry_friction_of_the_stepper_stops_a_joint_and_never_drives_it() -> None:
    """In closed form: it slows down by friction over inertia, and stands."""
    model = mujoco.MjModel.from_xml_string(TURNTABLE)
    model.opt.timestep, model.opt.integrator = 1e-3, int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    model.dof_solref[:], model.dof_solimp[:] = (0.002, 1.0), (0.99, 0.999, 0.001, 0.5, 2.0)
    data = mujoco.MjData(model)
    rubs = RobotEffect("stribeck", 1, None, {"excess_Nm": 0.4, "fade_rad_per_s": 1e9})
    data.qvel[0] = 1.0
    for k in range(1, 2001):
        step(model, data, [rubs], np.zeros(1))
        expected = max(1.0 - 0.4 / INERTIA * k * 1e-3, 0.0)
        assert data.qvel[0] == pytest.approx(expected, abs=2e-3)
    assert model.dof_frictionloss[0] == 0.0
    less = RobotEffect("stribeck", 1, None, {"excess_Nm": -1.0, "fade_rad_per_s": 1e9})
    data.qvel[0] = 0.3
    step(model, data, [less], np.zeros(1))
    assert data.qvel[0] == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize("viscous", [-0.2, -0.05])
def test_viscous_friction_of_the_stepper_never_drives_a_joint(viscous: float) -> None:
    """What the model has and what it is found to have less: together never below zero."""
    model = mujoco.MjModel.from_xml_string(TURNTABLE)
    model.opt.timestep, model.opt.integrator = 1e-3, int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    model.dof_damping[:] = 0.1
    data = mujoco.MjData(model)
    data.qvel[0] = 1.0
    for _ in range(1000):
        step(model, data, [RobotEffect("friction", 1, None, {"coulomb_Nm": 0.0, "viscous_Nms_per_rad": viscous})],
             np.zeros(1))  # fmt: skip
    expected = np.exp(-max(0.1 + viscous, 0.0) / INERTIA)
    assert data.qvel[0] == pytest.approx(expected, rel=1e-3)
