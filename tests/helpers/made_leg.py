"""A leg whose drives tell no torque: MuJoCo simulates position loops, and the log has commands and positions only."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

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


def write_leg(
    folder: Path, seconds: float = 30.0, rate_hz: float = RATE_HZ, drag: tuple[float, float] = (0.0, 0.0)
) -> Path:
    """Write ``leg.xml`` without rotors and friction, ``log.toml`` and ``log.csv``; return the folder.

    ``drag`` has MuJoCo's damping of second and third degree in the speed.
    """
    (folder / "leg.xml").write_text(LEG, encoding="utf-8")
    (folder / "log.toml").write_text(MAP, encoding="utf-8")
    spec = mujoco.MjSpec.from_string(LEG)
    for joint, rotor, dry, viscous in zip(spec.joints, ROTOR_KGM2, DRY_NM, VISCOUS, strict=True):
        joint.armature, joint.frictionloss, joint.damping = rotor, dry, [viscous, *drag]
        joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
        actuator = spec.add_actuator(name=joint.name, target=joint.name, forcerange=[-LIMIT_NM, LIMIT_NM])
        actuator.trntype, actuator.biastype = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.gainprm[0], actuator.biasprm[:3] = KP, [0.0, -KP, -KD]
    spec.option.timestep, spec.option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = spec.compile()
    data, every, rng = mujoco.MjData(model), round(1.0 / rate_hz / STEP_S), np.random.default_rng(4)
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    sweep = 2.0 * np.pi * (0.2 * t + 0.5 * 2.8 / seconds * t**2)
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
