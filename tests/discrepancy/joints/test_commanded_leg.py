"""A leg whose drives tell no torque: MuJoCo simulates position loops, and the log has commands and positions only."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import mocobot
from command import refused, run
from estimator.errors import InputError

KP, KD, LIMIT_NM, RATE_HZ, STEP_S = 20.0, 1.5, 23.7, 500.0, 2e-4
ROTOR_KGM2, DRY_NM, VISCOUS = (0.012, 0.03), (0.25, 0.5), (0.2, 0.15)
HEADER = "t,hip q,knee q,hip command,knee command"
LEG = """<mujoco><compiler angle="radian"/><worldbody>
<body name="thigh" pos="0 0 0.6"><joint name="hip" axis="0 1 0"/>
  <inertial pos="0.004 0.02 -0.03" mass="1.15" diaginertia="0.006 0.006 0.001"/>
<body name="shin" pos="0 0 -0.213"><joint name="knee" axis="0 1 0"/>
  <inertial pos="0.006 0 -0.12" mass="0.25" diaginertia="0.003 0.003 0.0001"/>
</body></body></worldbody></mujoco>"""
MAP = f"""version = 1
joints = ["hip", "knee"]
time = {{ column = "t", unit = "s" }}
[channels]
q = {{ column = "{{joint}} q", unit = "rad" }}
command = {{ column = "{{joint}} command", unit = "rad" }}
[control]
command = "position"
gain_of = "torque"
position_gain = {KP}
velocity_gain = {KD}
limit = {LIMIT_NM}
"""


@pytest.fixture(scope="module")
def leg(tmp_path_factory) -> Path:
    """Folder with model, map and log."""
    folder = tmp_path_factory.mktemp("leg")
    (folder / "leg.xml").write_text(LEG, encoding="utf-8")
    (folder / "log.toml").write_text(MAP, encoding="utf-8")
    spec = mujoco.MjSpec.from_string(LEG)
    for joint, rotor, dry, viscous in zip(spec.joints, ROTOR_KGM2, DRY_NM, VISCOUS, strict=True):
        joint.armature, joint.frictionloss, joint.damping = rotor, dry, [viscous, 0.0, 0.0]
        joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
        actuator = spec.add_actuator(name=joint.name, target=joint.name, forcerange=[-LIMIT_NM, LIMIT_NM])
        actuator.trntype, actuator.biastype = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.gainprm[0], actuator.biasprm[:3] = KP, [0.0, -KP, -KD]
    spec.option.timestep, spec.option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    data, every, rng = mujoco.MjData(model), round(1.0 / RATE_HZ / STEP_S), np.random.default_rng(4)
    t = np.arange(round(30.0 * RATE_HZ)) / RATE_HZ
    sweep = 2.0 * np.pi * (0.2 * t + 0.5 * 2.8 / 30.0 * t**2)
    command = np.column_stack([0.5 + 0.4 * np.sin(sweep), -1.0 + 0.5 * np.sin(1.13 * sweep + 0.4)])
    data.qpos[:] = command[0]
    q = np.empty_like(command)
    for k in range(len(t)):
        q[k] = data.qpos
        data.ctrl[:] = command[k]
        for _ in range(every):
            mujoco.mj_step(model, data)
    q += 2e-5 * rng.standard_normal(q.shape)
    columns = np.column_stack([t, q, command])
    np.savetxt(folder / "log.csv", columns, delimiter=",", header=HEADER, comments="", fmt="%.8g")
    return folder


def test_commands_and_gains_tell_rotors_and_friction(leg):
    found = mocobot.calibrate(leg / "log.csv", leg / "leg.xml").found
    values = {(p.place, p.name): p for p in found.parameters}
    for joint, rotor, dry, viscous in zip(("hip", "knee"), ROTOR_KGM2, DRY_NM, VISCOUS, strict=True):
        for name, true, share in (
            ("coulomb_Nm", dry, 0.1), ("viscous_Nms_per_rad", viscous, 0.15), ("armature_kgm2", rotor, 0.2),
        ):  # fmt: skip
            p = values[joint, name]
            assert abs(p.value - true) < max(4.0 * p.se, share * true)
    assert any("are those asked for by the position loop" in note for note in found.notes)


def test_the_commands_take_such_a_log(leg, capsys, tmp_path):
    lines = (leg / "log.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    log = tmp_path / "short.csv"
    log.write_text("".join(lines[: round(10.0 * RATE_HZ)]), encoding="utf-8")
    code, out, _ = run(capsys, "inspect", log, "--model", leg / "leg.xml")
    assert code == 0
    assert "ready for: a diagnosis from torques of 2 joints" in out
    code, out, _ = run(capsys, "diagnose", log, "--model", leg / "leg.xml", "--no-closed-loop")
    assert code == 0
    assert "friction" in out


def test_without_gains_such_a_log_is_refused(leg, capsys, tmp_path):
    bare = tmp_path / "bare.toml"
    bare.write_text("\n".join(line for line in MAP.splitlines() if "_gain" not in line), encoding="utf-8")
    said = refused(capsys, "calibrate", leg / "log.csv", "--model", leg / "leg.xml", "--map", bare)
    assert "nor commands with known gains" in said


def test_logged_torques_are_not_replaced(leg, tmp_path):
    columns = np.genfromtxt(leg / "log.csv", delimiter=",", names=True)
    both = np.column_stack([*(columns[n] for n in columns.dtype.names), np.full(len(columns), 3.0)])
    np.savetxt(
        tmp_path / "log.csv",
        both,
        delimiter=",",
        comments="",
        header="t,hip q,knee q,hip command,knee command,hip torque",
    )
    (tmp_path / "log.toml").write_text(
        MAP.replace(
            "[control]", '[joint.hip.channels]\ntorque = { column = "hip torque", unit = "Nm" }\n[control]'
        ),
        encoding="utf-8",
    )
    (log,) = mocobot.serial.read_logs(tmp_path / "log.csv", leg / "leg.xml")
    assert log.torque is not None
    assert np.all(log.torque[:, 0] == 3.0)
    assert np.ptp(log.torque[:, 1]) > 0.1


def test_a_draft_says_which_joints_the_log_lacks(leg, tmp_path, capsys):
    more = LEG.replace(
        "</worldbody>", '<body name="tail"><joint name="tail"/><geom size="0.1"/></body></worldbody>'
    )
    (tmp_path / "more.xml").write_text(more, encoding="utf-8")
    code, out, _ = run(capsys, "map", leg / "log.csv", "--model", tmp_path / "more.xml")
    assert code == 0
    assert 'joints = ["hip", "knee"]' in out
    assert "joint tail is in no column; if it does not move, name it by --lock" in out
    (tmp_path / "draft.toml").write_text(
        out.replace('position_gain = "free"', f"position_gain = {KP}").replace('velocity_gain = "free"\n', "")
    )
    locked = mocobot.serial.read_model(tmp_path / "more.xml", lock=["tail=0"])
    (log,) = mocobot.serial.read_logs(leg / "log.csv", locked, map=tmp_path / "draft.toml")
    assert log.torque is not None
    with pytest.raises(InputError, match="--lock"):
        mocobot.serial.read_logs(leg / "log.csv", tmp_path / "more.xml", map=tmp_path / "draft.toml")
