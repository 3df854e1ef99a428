"""Rollouts of robots simulated by MuJoCo, or known in closed form: what models leave, and what they cannot say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from discrepancy.candidate import Transient
from discrepancy.result.diagnosed import Diagnosed
from discrepancy.result.text_rollouts import rollout_lines
from discrepancy.serial.diagnosis import diagnose_serial
from discrepancy.serial.laws.rig import LawfulSerialRig
from discrepancy.serial.model import SerialModel, load_model
from discrepancy.serial.recording.joint_log import Drive, JointLog
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.rolled.closed import closed_loop
from discrepancy.serial.rolled.fitted import nominal, steps_per
from discrepancy.serial.rolled.free import Horizon, bounds, compared, diverged, free_rollouts, rms
from discrepancy.serial.rolled.readings import LoggedTorques, Readings
from discrepancy.serial.rolled.starts import starts, usable, without
from discrepancy.serial.rolled.told import rolled_out
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import step
from mocobot_sim.serial.rollout import Start
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


def let_go(rig: SerialRig, first: int, ahead: int) -> np.ndarray:
    """Errors of the given model from one start."""
    s = rig.parts[0].signals
    every = steps_per(1.0 / s.rate_hz)
    robot = nominal(rig, 1.0 / s.rate_hz / every)
    start = Start(float(s.time[first]), s.q[first], s.dq[first], s.ddq[first])
    torques = LoggedTorques.of(s.log, robot.readings)
    return compared(start, robot, torques, s.q[first : first + ahead + 1], every, bounds(rig))


def test_friction_that_a_model_lacks_turns_it_by_half_of_torque_over_inertia_times_time_squared(
    tmp_path: Path,
) -> None:
    """In closed form; from 2.55 s on the table turns one way for 0.5 s."""
    rig = LawfulSerialRig.of(read(tmp_path, TURNTABLE), [turning()])
    s = rig.parts[0].signals
    first, ahead = int(np.searchsorted(s.time, 2.55)), round(0.5 * s.rate_hz)
    assert (s.dq[first : first + ahead + 1] > 0.2).all()
    time = np.arange(ahead + 1) / s.rate_hz
    error = let_go(rig, first, ahead)[:, 0]
    np.testing.assert_allclose(error, RUBS / INERTIA * time**2 / 2.0, atol=1.2e-4)
    assert error[-1] > 0.049


def test_the_true_model_leaves_integration_errors(tmp_path: Path) -> None:
    rig = LawfulSerialRig.of(read(tmp_path, TURNTABLE), [turning(0.0)])
    assert np.abs(let_go(rig, 300, round(0.5 * rig.parts[0].signals.rate_hz))).max() < 5e-5


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


@pytest.fixture(scope="module")
def found(two_links: SerialModel, rubbing: JointLog) -> Diagnosed:
    return diagnose_serial(two_links, [rubbing])


def test_before_is_what_plain_mujoco_does(
    two_links: SerialModel, rubbing: JointLog, found: Diagnosed
) -> None:
    """One rollout by ``mj_step`` and ``np.interp``, with MuJoCo's own integrator."""
    rig = LawfulSerialRig.of(two_links, [rubbing])
    s, first, ahead = rig.parts[0].signals, 400, 50
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
    error = let_go(rig, first, ahead)
    assert np.abs(error[-1]).max() > 0.01
    np.testing.assert_allclose(error, expected, atol=1e-9)


def test_what_is_found_foretells_blocks_left_out(found: Diagnosed) -> None:
    rolled = found.to_dict()["rollouts"]
    assert rolled["validated"]
    assert [h["seconds"] for h in rolled["horizons"]] == [0.1, 0.2, 0.5]
    assert rolled["why_not"] is None
    assert rolled["commanded"]["why_not"] == "the log has no commands"
    for horizon, most in zip(rolled["horizons"], (1e-3, 2e-3, 6e-3), strict=True):
        assert 40 <= horizon["starts"] <= 70
        assert horizon["before"]["diverged"] == horizon["after"]["diverged"] == [0, 0]
        assert max(horizon["after"]["rms"]) < most
        assert horizon["removed"][1] > 0.95
    said = str(found)
    assert "Rolled out from measured states under the logged torques (on blocks left out of the fit)" in said
    assert max(map(len, said.splitlines())) <= 100


def test_rollouts_are_left_out_on_request(two_links: SerialModel, rubbing: JointLog) -> None:
    left = diagnose_serial(two_links, [rubbing], closed_loop=False, laws="never")
    assert left.to_dict()["rollouts"] is None
    assert "Rolled out" not in str(left)


def test_no_start_where_something_is_not_known(two_links: SerialModel, rubbing: JointLog) -> None:
    holes = rubbing.usable.copy()
    holes[2000:2020] = False
    torque = np.array(rubbing.torque)
    torque[3000:3010, 1] = np.nan
    s = LawfulSerialRig.of(two_links, [replace(rubbing, usable=holes, torque=torque)]).parts[0].signals
    good = usable(s)
    seen = starts(slice(0, len(s.time)), good, 7, 125, 25)
    assert len(seen) > 20
    for start in seen:
        span = (s.time[start.sample], s.time[start.sample + start.reach])
        for low, high in ((4.0, 4.04), (6.0, 6.02)):
            assert span[1] < low or span[0] > high
    event = without(s, good, [Transient(0, 1.0, 0.5)])
    assert not event[(s.time >= 1.0) & (s.time <= 1.5)].any()


def test_starts_reach_no_farther_than_their_block() -> None:
    good = np.ones(100, dtype=bool)
    assert starts(slice(10, 30), good, 5, 50, 25) == []
    assert [(s.sample, s.reach) for s in starts(slice(10, 40), good, 10, 15, 5)] == [
        (10, 15),
        (20, 15),
        (30, 9),
    ]
    good[22] = False
    assert [(s.sample, s.reach) for s in starts(slice(10, 40), good, 10, 15, 5)] == [(10, 11), (30, 9)]


def test_a_log_with_holes_every_so_often_has_no_horizon_that_is_longer(tmp_path: Path) -> None:
    """Known for 0.32 s at a time, smoothing left out: none of 0.5 s; known for less than 0.1 s, none at all."""
    log = turning()
    rig = LawfulSerialRig.of(read(tmp_path, TURNTABLE), [log])
    explanation = diagnose_serial(rig.model, [log], laws="never", closed_loop=False).diagnosis.explanation
    s = rig.parts[0].signals

    def with_holes(apart_s: float) -> SerialRig:
        known = np.ones((len(s.time), 1), dtype=bool)
        known[:: round(apart_s * s.rate_hz)] = False
        part = replace(rig.parts[0], signals=replace(s, usable=known))
        return replace(rig, parts=(part,), _seen={})

    assert {h.seconds for h in free_rollouts(with_holes(0.4), explanation).horizons} == {0.1, 0.2}
    whole, none = rolled_out(rig, explanation), rolled_out(with_holes(0.15), explanation)
    assert whole is not None
    assert whole["why_not"] is None
    assert none is not None
    assert none["why_not"].startswith("nowhere in a block")


def test_what_diverges_is_counted_and_in_no_error() -> None:
    before = np.array([[0.1, 0.3], [np.nan, 0.4], [0.2, np.nan], [0.2, 0.0]])
    horizon = Horizon(0.1, before, before / 2.0)
    np.testing.assert_array_equal(diverged(before), [1, 1])
    np.testing.assert_allclose(rms(before), [np.sqrt(0.09 / 3.0), np.sqrt(0.25 / 3.0)])
    np.testing.assert_allclose(horizon.removed(), 0.5)
    assert np.isnan(rms(np.full((4, 1), np.nan))).all()
    assert np.isnan(rms(np.array([[0.1], [np.nan], [np.nan]]))).all()


def test_a_joint_that_is_half_a_turn_off_has_diverged(tmp_path: Path) -> None:
    log = turning(0.0)
    assert log.torque is not None
    rig = LawfulSerialRig.of(read(tmp_path, TURNTABLE), [log])
    s = rig.parts[0].signals
    every = steps_per(1.0 / s.rate_hz)
    robot = nominal(rig, 1.0 / s.rate_hz / every)
    strong = LoggedTorques.of(replace(log, torque=log.torque + 20.0), robot.readings)
    start = Start(float(s.time[300]), s.q[300], s.dq[300], s.ddq[300])
    error = compared(start, robot, strong, s.q[300:426], every, bounds(rig))[:, 0]
    # Half of 20 N m over 0.5 kg m^2 times time squared is pi at 0.396 s.
    gone = np.flatnonzero(np.isnan(error))
    assert gone[0] / s.rate_hz == pytest.approx(np.sqrt(2.0 * np.pi * INERTIA / 20.0), abs=2.0 / s.rate_hz)
    assert np.isnan(error[gone[0] :]).all()


def test_errors_of_the_log_are_taken_out_of_its_torques() -> None:
    read_wrong = [
        RobotEffect("torque_offset", 1, None, {"offset_Nm": 0.3}),
        RobotEffect("torque_scale", 1, None, {"scale": 0.1, "bend": 0.0, "typical_load": 2.0}),
        RobotEffect("back_emf", 1, None, {"braking_Nms_per_rad": 0.05}),
    ]
    readings = Readings.of(read_wrong, 1)
    # 2 N m at standstill, read as 1.1 times that plus 0.3 N m.
    assert readings.real(np.array([2.5]), np.zeros(1), 1.0) == pytest.approx(2.0)
    assert readings.real(np.array([2.5]), np.array([4.0]), 1.0) == pytest.approx(1.8)
    # Of what saturates: 1.3 times it at 4 N m, 20 % less of the 0.3 at twice that.
    bent = Readings.of(
        [RobotEffect("torque_scale", 1, None, {"scale": 0.3, "bend": -0.2, "typical_load": 4.0})], 1
    )
    for real, told in ((4.0, 4.0 * 1.3), (-8.0, -8.0 * 1.24), (0.0, 0.0)):
        assert bent.real(np.array([told]), np.zeros(1), 1.0) == pytest.approx(real)
    late = Readings.of([RobotEffect("torque_delay", 1, None, {"delay_s": 0.02})], 1)
    log = turning()
    assert log.torque is not None
    shifted = replace(log, torque=np.sin(log.time - 0.02)[:, None])
    assert LoggedTorques.of(shifted, late)(1.0, np.zeros(1), np.zeros(1)) == pytest.approx(
        np.sin(1.0), abs=1e-5
    )


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
    for k in range(round(12.0 * rate_hz) * 2):
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


def test_closed_loop_of_mujocos_own_servo(tmp_path: Path) -> None:
    """Where the model is right the loop follows the log; friction that it lacks shows, and is gone once it is named."""
    model = read(tmp_path, TURNTABLE)
    right = diagnose_serial(model, [commanded(0.0)], laws="never").to_dict()["rollouts"]["commanded"]
    assert right["joints"] == [1]
    assert right["before"][0] < 2e-4
    found = diagnose_serial(model, [commanded(1.0)], laws="never")
    loop = found.to_dict()["rollouts"]["commanded"]
    assert loop["before"][0] > 5e-3
    assert loop["removed"][0] > 0.9
    assert len(loop["blocks"]) == len(found.to_dict()["recordings"])
    assert "loops closed (on blocks left out of the fit)" in "\n".join(rollout_lines(found.to_dict()))


def test_loops_that_the_map_does_not_tell_are_not_closed(tmp_path: Path) -> None:
    model = read(tmp_path, TURNTABLE)
    log = commanded(1.0)
    no_gain = replace(log, drive=replace(log.drive, position_gain=np.full(1, np.nan)))
    rig = LawfulSerialRig.of(model, [no_gain])
    explanation = diagnose_serial(model, [no_gain], laws="never", closed_loop=False).diagnosis.explanation
    assert closed_loop(rig, explanation) == "joint table: the map has no position_gain"


def test_dry_friction_of_the_stepper_stops_a_joint_and_never_drives_it() -> None:
    """In closed form: it slows down by friction over inertia, and stands."""
    model = mujoco.MjModel.from_xml_string(TURNTABLE)
    model.opt.timestep, model.opt.integrator = 1e-3, int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    model.dof_solref[:], model.dof_solimp[:] = (0.002, 1.0), (0.99, 0.999, 0.001, 0.5, 2.0)
    data = mujoco.MjData(model)
    rubs = RobotEffect("stribeck", 1, None, {"excess_Nm": 0.4, "fade_per_s": 1e9})
    data.qvel[0] = 1.0
    for k in range(1, 2001):
        step(model, data, [rubs], np.zeros(1))
        expected = max(1.0 - 0.4 / INERTIA * k * 1e-3, 0.0)
        assert data.qvel[0] == pytest.approx(expected, abs=2e-3)
    assert model.dof_frictionloss[0] == 0.0
    less = RobotEffect("load_friction", 1, None, {"share": 0.5, "load_Nm": 2.0})  # -1 N m without load
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
