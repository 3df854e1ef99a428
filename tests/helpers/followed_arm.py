"""A small arm in MuJoCo that follows sums of sines under computed torque, and the log of its joints."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from discrepancy.joints.model import SerialModel, load_model
from mocobot_logs.joints.joint_log import Drive, JointLog

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.001"/><worldbody>
<body name="one" pos="0 0 0.3"><joint name="turn" axis="0 0 1"/>
  <inertial pos="0.02 0.01 0.1" mass="3" diaginertia="0.03 0.03 0.01"/>
<body name="two" pos="0 0 0.2"><joint name="shoulder" axis="0 1 0"/>
  <inertial pos="0.15 0 0.02" mass="2.5" diaginertia="0.01 0.04 0.04"/>
<body name="three" pos="0.35 0 0"><joint name="elbow" axis="0 1 0"/>
  <inertial pos="0.12 0.01 0" mass="1.2" diaginertia="0.003 0.012 0.012"/>
</body></body></body></worldbody></mujoco>"""
Change = Callable[[mujoco.MjSpec], None]
Torque = Callable[[np.ndarray, np.ndarray, float], np.ndarray]
"""Of positions, velocities and time."""
RATE_HZ, SECONDS, BANDWIDTH_PER_S = 250.0, 24.0, 20.0
TORQUE_NOISE_NM, STEP_RAD = 0.02, 2.0 * np.pi / 2**17


def arm_model(folder: Path, given: Change = lambda spec: None) -> SerialModel:
    """The arm as its owner describes it."""
    spec = mujoco.MjSpec.from_string(ARM)
    given(spec)
    spec.compile()
    path = folder / "arm.xml"
    path.write_text(spec.to_xml(), encoding="utf-8")
    return load_model(path)


@cache
def arm_log(true: Change, seed: int, besides: Torque | None = None, dry: Torque | None = None) -> JointLog:
    """A log of the arm with some changes, torques besides those of the drives, and dry friction besides MuJoCo's."""
    rng = np.random.default_rng(seed)
    spec = mujoco.MjSpec.from_string(ARM)
    true(spec)
    model = spec.compile()
    data, J = mujoco.MjData(model), model.nv
    f = np.sort(rng.uniform(0.08, 0.8, (4, J)), axis=0)
    size, phase = rng.uniform(0.5, 1.0, (4, J)) / f, rng.uniform(0.0, 2.0 * np.pi, (4, J))
    size *= 0.9 / size.sum(axis=0)
    every, steps = round(1.0 / RATE_HZ / model.opt.timestep), round(SECONDS / model.opt.timestep)
    t = model.opt.timestep * np.arange(steps)[:, None, None]
    w = 2.0 * np.pi * f
    x = (size * np.sin(w * t + phase)).sum(axis=1)
    x1, x2 = (
        (size * w * np.cos(w * t + phase)).sum(axis=1),
        -(size * w**2 * np.sin(w * t + phase)).sum(axis=1),
    )
    data.qpos[:], data.qvel[:] = x[0], x1[0]
    inertia, log = np.zeros((J, J)), []
    own = model.dof_frictionloss.copy()
    for k in range(steps):
        if dry is not None:
            model.dof_frictionloss[:] = own + dry(data.qpos, data.qvel, data.time)
        mujoco.mj_step1(model, data)
        if k % 10 == 0:
            mujoco.mj_fullM(model, data, inertia)
        e, e1 = x[k] - data.qpos, x1[k] - data.qvel
        torque = inertia @ (x2[k] + 2 * BANDWIDTH_PER_S * e1 + BANDWIDTH_PER_S**2 * e) + data.qfrc_bias
        data.qfrc_applied[:] = torque + (0.0 if besides is None else besides(data.qpos, data.qvel, data.time))
        if k % every == 0:
            log.append((data.qpos.copy(), torque.copy()))
        mujoco.mj_step2(model, data)
    q, torque = (np.array(part) for part in zip(*log, strict=True))
    q = np.round(q / STEP_RAD) * STEP_RAD
    torque += TORQUE_NOISE_NM * rng.standard_normal(torque.shape)
    none = np.full(J, np.nan)
    drive = Drive(np.ones(J), np.eye(J), np.ones(J), np.zeros(J, dtype=bool), "none", none, none, "torque",
                  np.full(J, np.inf))  # fmt: skip
    names = tuple(model.joint(j).name for j in range(J))
    return JointLog(
        f"log {seed}", np.arange(len(q)) / RATE_HZ, RATE_HZ, q, torque, None, None, names, drive, np.full(J, STEP_RAD),
        np.ones(len(q), dtype=bool), RATE_HZ,
    )  # fmt: skip


def both(*changes: Change) -> Change:
    """One after another."""

    def change(spec: mujoco.MjSpec) -> None:
        for one in changes:
            one(spec)

    return change


def rubs(level: float, viscous: float = 0.0, joint: str | None = None) -> Change:
    """Dry and viscous friction, by MuJoCo's own attributes, in one joint or in all."""

    def change(spec: mujoco.MjSpec) -> None:
        for j in spec.joints:
            if joint in (None, j.name):
                j.frictionloss, j.damping = level, [viscous, 0.0, 0.0]
                j.solref_friction, j.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]

    return change
