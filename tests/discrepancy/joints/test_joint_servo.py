"""A position servo simulated by MuJoCo, told by duties alone: its motor, its back-EMF, its friction and its loop."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from discrepancy.joints.model import SerialModel, load_model
from discrepancy.joints.servo import loop_laws, with_torques
from discrepancy.joints.verdict import JointVerdict, judged
from estimator.errors import InputError
from mocobot_logs.joints.joint_log import Drive, JointLog

PENDULUM = """
<mujoco><compiler angle="radian"/><option timestep="0.0005" integrator="implicitfast"/><worldbody>
  <body><inertial mass="0.5" pos="0 0 -0.1" diaginertia="2e-4 2e-4 2e-4"/>
    <joint name="servo" axis="0 1 0" armature="0.002"/></body>
</worldbody></mujoco>"""
PER_VOLT, PER_SPEED, GAIN, VOLTS, RATE_HZ = 0.12, 0.05, 0.8, 7.0, 200.0
"""Torque per volt [N m/V], lost to the speed [N m s/rad], duty per rad of error at gain 1, supply, rate of the log."""


def run(seed: int, gain: float, rubs: float = 0.0, off_from: float = np.inf) -> JointLog:
    """A log of 8 s under sums of sines; from some time on the drive is off and the pendulum falls."""
    spec = mujoco.MjSpec.from_string(PENDULUM)
    if rubs:
        joint = spec.joint("servo")
        joint.frictionloss = rubs
        joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    model, rng = spec.compile(), np.random.default_rng(seed)
    data, every = mujoco.MjData(model), round(1.0 / RATE_HZ / model.opt.timestep)
    f, size, phase = rng.uniform(0.2, 1.0, 4), rng.uniform(0.3, 0.6, 4), rng.uniform(0.0, 2.0 * np.pi, 4)
    rows = []
    for k in range(round(8.0 * RATE_HZ) * every):
        wanted = float(np.sum(size * np.sin(2.0 * np.pi * f * data.time + phase)))
        on = data.time < off_from
        duty = float(np.clip(GAIN * gain * (wanted - data.qpos[0]), -1.0, 1.0)) if on else 0.0
        data.qfrc_applied[0] = on * (PER_VOLT * duty * VOLTS - PER_SPEED * data.qvel[0])
        if k % every == 0:
            rows.append((data.qpos[0], wanted, duty, on))
        mujoco.mj_step(model, data)
    q, command, duty, on = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    step = 2.0 * np.pi / 2**14
    one, unknown = np.ones(1), np.full(1, np.nan)
    drive = Drive(
        one, np.eye(1), one, np.zeros(1, dtype=bool), "position", np.full(1, gain), unknown, "firmware",
        np.full(1, np.inf), np.full(len(q), VOLTS), duty[:, None],
    )  # fmt: skip
    return JointLog(
        f"gain {gain:g}", np.arange(len(q)) / RATE_HZ, RATE_HZ, np.round(q / step)[:, None] * step, None, None,
        command[:, None], ("servo",), drive, np.full(1, step), np.ones(len(q), dtype=bool), RATE_HZ, enabled=on > 0.5,
    )  # fmt: skip


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> SerialModel:
    path = tmp_path_factory.mktemp("servo") / "servo.xml"
    path.write_text(PENDULUM, encoding="utf-8")
    return load_model(path)


@pytest.fixture(scope="module")
def logs() -> list[JointLog]:
    return [run(0, 2.0, 0.03), run(1, 4.0, 0.03), run(2, 8.0, 0.03, off_from=4.0)]


def test_what_a_volt_is_worth(model: SerialModel, logs: list[JointLog]) -> None:
    told, (motor,) = with_torques(model, logs)
    assert motor.unit == "V"
    assert motor.torque_per_unit == pytest.approx(PER_VOLT, rel=0.03)
    for log in told:
        assert log.torque is not None
        assert log.drive.duty is not None
        np.testing.assert_allclose(log.torque, log.drive.duty * VOLTS * motor.torque_per_unit)


def test_drives_that_tell_torques_are_left_alone(model: SerialModel, logs: list[JointLog]) -> None:
    log = replace(logs[0], torque=np.ones((len(logs[0].time), 1)))
    (same,), motors = with_torques(model, [log])
    assert same is log
    assert not motors


def test_a_duty_of_another_sign_is_refused(model: SerialModel, logs: list[JointLog]) -> None:
    duty = logs[0].drive.duty
    assert duty is not None
    turned = replace(logs[0], drive=replace(logs[0].drive, duty=-duty))
    with pytest.raises(InputError, match="joint servo does not go with the torque"):
        with_torques(model, [turned])


def test_law_of_the_loop(logs: list[JointLog]) -> None:
    laws = loop_laws(logs)
    assert [law.gain for law in laws] == [2.0, 4.0, 8.0]
    for law in laws:
        assert law.per_rad == pytest.approx(GAIN * law.gain, rel=2e-3)
        assert abs(law.late_s) < 1e-3
        assert law.share < 1e-3
    # The weakest loop has the largest errors, and one of these is beyond what the supply gives.
    assert laws[0].limit == pytest.approx(1.0)
    (soft,) = loop_laws([run(5, 0.3)])
    assert np.isinf(soft.limit)
    assert soft.per_rad == pytest.approx(GAIN * 0.3, rel=2e-3)


def named(verdict: JointVerdict) -> dict[str, dict[str, float]]:
    """Values by cause."""
    return {f.cause: dict(f.members[0].values) for f in verdict.findings}


def test_friction_and_back_emf_are_told_apart_by_one_fall(model: SerialModel, logs: list[JointLog]) -> None:
    """In one log of three."""
    verdict = judged(model, logs)
    values = named(verdict)
    assert set(values) == {"friction", "back_emf"}
    assert values["back_emf"]["braking_Nms_per_rad"] == pytest.approx(PER_SPEED, rel=0.1)
    assert values["friction"]["coulomb_Nm"] == pytest.approx(0.03, abs=0.006)
    assert abs(values["friction"]["viscous_Nms_per_rad"]) < 0.01
    alone = {f.cause: f.members[0].values for f in verdict.by_the_others(len(verdict.trials))}
    assert alone["back_emf"]["braking_Nms_per_rad"] == pytest.approx(PER_SPEED, rel=0.1)
    assert any("N m, or N of a slide) per V" in note for note in verdict.notes)
    assert any(note.startswith("Loop of joint servo") for note in verdict.notes)
    assert "Rows are what torques have below 3.5 Hz." in verdict.notes


def test_without_a_fall_speed_costs_torque_as_viscous_friction_does(model: SerialModel) -> None:
    values = named(judged(model, [run(3, 4.0), run(4, 8.0)]))
    assert "back_emf" not in values
    assert values["friction"]["viscous_Nms_per_rad"] == pytest.approx(PER_SPEED, rel=0.1)
