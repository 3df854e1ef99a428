"""Logs of a made-up arm, simulated by MuJoCo step by step; nothing here knows how the diagnosis looks for causes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from discrepancy.joints.model import SerialModel, load_model
from mocobot_logs.joints.joint_log import Drive, JointLog

Rubbing = Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray]
"""Torques against the joints from positions, velocities, drive torques and time."""
ARM = """
<mujoco model="made">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.0005" integrator="Euler"/>
  <worldbody>
    <body name="trunk" pos="0 0 0.3">
      <inertial mass="4" pos="0 0.01 -0.05" fullinertia="0.05 0.05 0.03 0 0 0.002"/>
      <joint name="waist" axis="0 0 1" armature="0.2"/>
      <body name="upper" pos="0 0.05 0.1" euler="1.5707963 0 0">
        <inertial mass="3" pos="0.16 0.01 0.02" fullinertia="0.008 0.05 0.05 0.001 0 0"/>
        <joint name="shoulder" axis="0 0 1" armature="0.25"/>
        <body name="fore" pos="0.35 0 0.02">
          <inertial mass="2" pos="0.12 -0.01 0.0" fullinertia="0.004 0.02 0.02 0 0.0005 0"/>
          <joint name="elbow" axis="0 0 1" armature="0.12"/>
          <body name="hand" pos="0.28 0 0" euler="0 1.5707963 0">
            <inertial mass="0.8" pos="0.01 0 0.06" fullinertia="0.0022 0.002 0.001 0 0 0"/>
            <joint name="roll" axis="0 0 1" armature="0.03"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
RATE_HZ = 500.0


def nominal_file(folder: Path, text: str = ARM) -> Path:
    """The nominal arm as a file."""
    path = folder / "arm.xml"
    path.write_text(text, encoding="utf-8")
    return path


def nominal(folder: Path) -> SerialModel:
    """The nominal arm."""
    return load_model(nominal_file(folder))


def nothing(q: np.ndarray, v: np.ndarray, torque: np.ndarray, time: float) -> np.ndarray:
    """No friction."""
    return np.zeros_like(q)


def spec(text: str = ARM) -> mujoco.MjSpec:
    """For changes before it is compiled."""
    return mujoco.MjSpec.from_string(text)


def simulated(
    model: mujoco.MjModel,
    seed: int,
    rubbing: Rubbing = nothing,
    seconds: float = 24.0,
    *,
    name: str = "made",
    torque_noise: float = 0.02,
    step_rad: float = 2.0 * np.pi / 2**17,
    read: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] = lambda q, torque: (q, torque),
    rest: tuple[float, float] | None = None,
) -> JointLog:
    """A log of an arm that follows sums of sines under a stiff controller.

    Args:
        model: of the real arm.
        seed: of motion and noise.
        rubbing: torques that act on the joints besides.
        seconds: length.
        name: of the log.
        torque_noise: standard deviation over a typical torque of the arm of 10 N m, times 10 [N m].
        step_rad: of the encoders.
        read: what sensors make of true positions and drive torques.
        rest: from when to when the reference stands still [s].
    """
    rng = np.random.default_rng(seed)
    data, J = mujoco.MjData(model), model.nv
    f = 0.1 + np.sort(rng.uniform(0.0, 0.9, (6, J)), axis=0)
    size, phase = rng.uniform(0.5, 1.0, (6, J)) * 0.4 / np.sqrt(6.0 * f), rng.uniform(0, 2 * np.pi, (6, J))
    centre = rng.uniform(-0.4, 0.4, J)
    dt = model.opt.timestep
    every = round(1.0 / RATE_HZ / dt)
    steps = round(seconds / dt)
    q_log, torque_log = np.empty((steps // every, J)), np.empty((steps // every, J))
    inertia = np.zeros((J, J))

    def reference(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        phase_time, rate, slope = flow(t)
        w = 2.0 * np.pi * f
        angle = w * phase_time + phase
        first, second = (size * w * np.cos(angle)).sum(0), -(size * w**2 * np.sin(angle)).sum(0)
        return centre + (size * np.sin(angle)).sum(0), first * rate, second * rate**2 + first * slope

    def flow(t: float) -> tuple[float, float, float]:
        """Time along the motion, its rate and the rate's slope: it slows down to a rest, and goes on."""
        if rest is None or t < rest[0] - 1.0:
            return t, 1.0, 0.0
        begin = rest[0] - 1.0
        if t < rest[0]:
            x = t - begin
            return begin + x - x**2 / 2, 1.0 - x, -1.0
        if t < rest[1]:
            return begin + 0.5, 0.0, 0.0
        x = min(t - rest[1], 1.0)
        return begin + 0.5 + x**2 / 2 + max(t - rest[1] - 1.0, 0.0), x, 1.0 if x < 1.0 else 0.0

    data.qpos[:], data.qvel[:], _ = reference(0.0)
    for k in range(steps):
        mujoco.mj_step1(model, data)
        if k % 20 == 0:
            mujoco.mj_fullM(model, data, inertia)
        r, dr, ddr = reference(data.time)
        wanted = ddr + 2.0 * 12.0 * (dr - data.qvel) + 144.0 * (r - data.qpos)
        torque = inertia @ wanted + data.qfrc_bias
        if k % every == 0:
            q_log[k // every], torque_log[k // every] = data.qpos, torque
        data.qfrc_applied[:] = torque - rubbing(data.qpos, data.qvel, torque, data.time)
        mujoco.mj_step2(model, data)
    q, torque = read(q_log, torque_log)
    q = np.round(q / step_rad) * step_rad if step_rad else q
    scale = np.sqrt(np.mean(torque**2, axis=0)) / 10.0
    torque = torque + torque_noise * scale * rng.standard_normal(torque.shape)
    names = tuple(model.joint(j).name for j in range(J))
    unknown = np.full(J, np.nan)
    drive = Drive(
        np.full(J, 100.0), np.eye(J) / 100.0, np.ones(J), np.zeros(J, dtype=bool), "none", unknown, unknown, "torque",
        np.full(J, np.inf),
    )  # fmt: skip
    return JointLog(
        name, np.arange(len(q)) / RATE_HZ, RATE_HZ, q, torque, None, None, names, drive, np.full(J, step_rad),
        np.ones(len(q), dtype=bool), RATE_HZ,
    )  # fmt: skip
