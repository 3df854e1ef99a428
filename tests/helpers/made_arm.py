"""A simulated three-joint arm: its logs, made by MuJoCo from a heavier arm that rubs, and the map that reads them."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from joint_logs import write_csv

MODEL = """
<mujoco model="arm">
  <compiler angle="radian"/>
  <worldbody>
    <body name="turret" pos="0 0 0.3">
      <inertial mass="4" pos="0.02 0 -0.05" diaginertia="0.05 0.05 0.04"/>
      <joint name="turret" axis="0 0 1" range="-2.5 2.5"/>
      <geom type="capsule" fromto="0 0 -0.2 0 0 0" size="0.05" mass="0"/>
      <body name="upper">
        <inertial mass="3" pos="0 0.03 0.2" diaginertia="0.04 0.04 0.01"/>
        <joint name="shoulder" axis="0 1 0" range="-2 2" actuatorfrcrange="-60 60"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.4" size="0.04" mass="0"/>
        <body name="fore" pos="0 0 0.4">
          <inertial mass="2" pos="0.02 0 0.15" diaginertia="0.02 0.02 0.005"/>
          <joint name="elbow" axis="0 1 0" range="-2.4 2.4" actuatorfrcrange="-40 40"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" mass="0"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
JOINTS = ("turret", "shoulder", "elbow")
MAP = """
version = 1
joints = ["turret", "shoulder", "elbow"]
time = { column = "time", unit = "s" }
[channels]
q = { column = "{joint} q", unit = "rad" }
dq = { column = "{joint} dq", unit = "rad/s" }
torque = { column = "{joint} torque", unit = "Nm" }
"""
RATE_HZ = 250.0


def write_model(folder: Path) -> Path:
    """The arm as its maker describes it."""
    path = folder / "arm.xml"
    path.write_text(MODEL, encoding="utf-8")
    return path


def write_map(folder: Path, text: str = MAP) -> Path:
    """The map of its logs."""
    path = folder / "log.toml"
    path.write_text(text, encoding="utf-8")
    return path


def made(
    seconds: float = 8.0,
    seed: int = 0,
    heavier: float = 1.3,
    rate_hz: float = RATE_HZ,
    payload_kg: float = 0.0,
) -> dict[str, np.ndarray]:
    """Columns of a log: the arm's masses are off, and its joints rub and have rotors.

    Args:
        seconds: how long.
        seed: of motion and noise.
        heavier: factor of masses and inertias.
        rate_hz: of the log.
        payload_kg: of what the fore arm carries at its end, a point.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    held = f'<body pos="0 0 0.3"><geom size="0.001" mass="{payload_kg}"/></body>' if payload_kg else ""
    model = mujoco.MjModel.from_xml_string(MODEL.replace("        </body>", f"        {held}</body>", 1))
    model.body_mass[:4] *= heavier
    model.body_inertia[:4] *= heavier
    rate = 2.0 * np.pi * rng.uniform(0.2, 0.7, (3, 3))
    size = np.array([0.6, 0.5, 0.7]) * rng.uniform(0.4, 0.8, (3, 3))
    phase = np.multiply.outer(time, rate) + rng.uniform(0.0, 6.0, (3, 3))
    q = (size * np.sin(phase)).sum(axis=1)
    dq = (size * rate * np.cos(phase)).sum(axis=1)
    ddq = -(size * rate**2 * np.sin(phase)).sum(axis=1)
    data = mujoco.MjData(model)
    torque = np.empty_like(q)
    for k in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(model, data)
        torque[k] = data.qfrc_inverse
    torque += np.array([1.5, 2.0, 1.0]) * np.tanh(dq / 0.01) + np.array([1.0, 1.5, 0.5]) * dq
    torque += np.array([0.2, 0.2, 0.1]) * ddq + 0.1
    values = {"time": time}
    for j, joint in enumerate(JOINTS):
        values[f"{joint} q"] = q[:, j] + 1e-5 * rng.standard_normal(len(time))
        values[f"{joint} dq"] = dq[:, j] + 1e-3 * rng.standard_normal(len(time))
        values[f"{joint} torque"] = torque[:, j] + 0.05 * rng.standard_normal(len(time))
    return values


def write_log(folder: Path, values: dict[str, np.ndarray], name: str = "log.csv") -> Path:
    """A log, model and map beside it."""
    write_model(folder)
    write_map(folder)
    return write_csv(folder / name, values)


def chain(joints: int) -> str:
    """MJCF of an arm of so many joints."""
    bodies = ""
    for j in range(joints, 0, -1):
        axis = ("0 1 0", "1 0 0", "0 0 1")[j % 3] if joints > 1 else "0 1 0"
        bodies = (
            f'<body name="link{j}" pos="{0.02 * j} 0 0.25"><inertial mass="{3.3 - 0.3 * j}" pos="0.03 0.02 0.1" '
            f'diaginertia="0.03 0.03 0.02"/><joint name="joint{j}" axis="{axis}"/>{bodies}</body>'
        )
    return f'<mujoco model="chain"><compiler angle="radian"/><worldbody>{bodies}</worldbody></mujoco>'


def write_chain_log(folder: Path, joints: int, rubbing: int, seconds: float = 6.5) -> Path:
    """A log of ``chain(joints)``, model and map beside it; joint ``rubbing`` has Coulomb friction of 2 N m."""
    text, rng = chain(joints), np.random.default_rng(0)
    (folder / "arm.xml").write_text(text, encoding="utf-8")
    names = [f"joint{j + 1}" for j in range(joints)]
    write_map(folder, MAP.replace(repr(list(JOINTS)).replace("'", '"'), repr(names).replace("'", '"')))
    time = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    rate, size = 2.0 * np.pi * rng.uniform(0.2, 0.7, (3, joints)), rng.uniform(0.24, 0.48, (3, joints))
    phase = np.multiply.outer(time, rate) + rng.uniform(0.0, 6.0, (3, joints))
    q, dq, ddq = (
        (size * part).sum(axis=1)
        for part in (np.sin(phase), rate * np.cos(phase), -(rate**2) * np.sin(phase))
    )
    model = mujoco.MjModel.from_xml_string(text)
    data, torque = mujoco.MjData(model), np.empty_like(q)
    for k in range(len(time)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(model, data)
        torque[k] = data.qfrc_inverse
    torque[:, rubbing - 1] += 2.0 * np.tanh(dq[:, rubbing - 1] / 0.01)
    values = {"time": time}
    for name, *each in zip(names, q.T, dq.T, torque.T, strict=True):
        for what, column, noise in zip(("q", "dq", "torque"), each, (1e-5, 1e-3, 0.05), strict=True):
            values[f"{name} {what}"] = column + noise * rng.standard_normal(len(time))
    return write_csv(folder / "log.csv", values)
