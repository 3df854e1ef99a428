"""Faults of robots that tell no torque, simulated by MuJoCo: play, a stand that yields, a joint that sticks."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import mocobot
from commanded.bodies import add_play
from commanded.machine import addresses, arriving
from commanded_arm import Arm

SECONDS, RATE_HZ, STEP_S = 16.0, 100.0, 5e-4
STIFFNESS, DAMPING = (
    np.array([900.0, 900.0, 900.0, 25.0, 25.0, 25.0]),
    np.array([4.0, 4.0, 4.0, 0.1, 0.1, 0.1]),
)
BASE = '<body name="base" pos="0 0 0.6"><inertial pos="0 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>'
AXES = ("1 0 0", "0 1 0", "0 0 1")


def diagnosed(folder: Path, arm: Arm, spec: mujoco.MjSpec, commands: np.ndarray):
    """Causes by name and joint that a diagnosis finds in the motion of a robot; the model is the healthy arm."""
    stamps = np.arange(len(commands)) / RATE_HZ
    for name, kp, kd in zip(arm.joints, arm.kp, arm.kd, strict=True):
        drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        drive.gainprm[0], drive.biasprm[:3] = kp, [0.0, -kp, -kd]
    spec.option.timestep, spec.option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
    machine = spec.compile()
    at, _, adds = addresses(machine, arm.joints)
    data, times = mujoco.MjData(machine), np.arange(-2.0, stamps[-1] + STEP_S, STEP_S)
    control = arriving(stamps, commands, arm.late_s, np.append(times, times[-1] + STEP_S))
    data.qpos[at], q = control[0], np.empty((len(times), 2))
    for k in range(len(times)):
        q[k], data.ctrl[:] = adds @ data.qpos, control[k]
        mujoco.mj_step(machine, data)
    q = np.column_stack([np.interp(stamps, times, x) for x in q.T])
    q += 1e-4 * np.random.default_rng(3).standard_normal(q.shape)
    log = arm.write(folder, arm.map(f"delay_s = {arm.late_s}\n"), t=stamps, q=q, command=commands)
    (folder / "arm.xml").write_text(arm.spec().to_xml(), encoding="utf-8")
    told = mocobot.diagnose(log, folder / "arm.xml", closed_loop=False).to_dict()
    return {
        (c["cause"], c["joint"]): {name: p["value"] for name, p in c["parameters"].items()}
        for c in told["causes"]
    }


@pytest.fixture
def arm() -> Arm:
    return Arm()


def test_play_of_a_gear_is_named_with_its_width(arm, tmp_path):
    spec = arm.spec()
    add_play(spec, "elbow", 0.008)
    found = diagnosed(tmp_path, arm, spec, arm.commands(np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ))
    assert list(found) == [("backlash", 2)]
    assert found["backlash", 2]["width_rad"] == pytest.approx(0.008, rel=0.35)


def test_a_stand_that_yields_is_named_with_its_springs(arm, tmp_path):
    springs = "".join(
        f'<joint name="stand_{k}" type="{"slide" if k < 3 else "hinge"}" axis="{AXES[k % 3]}" '
        f'stiffness="{STIFFNESS[k]}" damping="{DAMPING[k]}"/>'
        for k in range(6)
    )
    head, tail = arm.spec().to_xml().split('<body name="upper" pos="0 0 0.6">')
    text = f'{head}{BASE}{springs}<body name="upper">{tail.replace("</worldbody>", "</body></worldbody>")}'
    spec = mujoco.MjSpec.from_string(text)
    found = diagnosed(tmp_path, arm, spec, arm.commands(np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ))
    assert list(found) == [("soft_stand", None)]
    for name, true, share in (
        ("stiffness_x_N_per_m", STIFFNESS[0], 0.4), ("stiffness_y_Nm_per_rad", STIFFNESS[4], 0.25),
    ):  # fmt: skip
        assert found["soft_stand", None][name] == pytest.approx(true, rel=share)


def test_a_command_that_steps_while_a_joint_sticks_is_no_push(arm, tmp_path):
    stamps = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    commands = arm.commands(stamps)
    still = (stamps > 8.0) & (stamps < 13.0)
    commands[still] = commands[np.argmax(still)] + 0.03 * np.sign(
        np.sin(2.0 * np.pi * stamps[still, None] / [0.9, 0.7])
    )
    spec = arm.spec()
    spec.joint("elbow").frictionloss *= 3.0
    spec.joint("shoulder").frictionloss *= 3.0
    found = diagnosed(tmp_path, arm, spec, commands)
    assert {cause for cause, _ in found} == {"friction"}
