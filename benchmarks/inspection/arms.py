"""Logs of simulated arms, by MuJoCo: masses are off, payloads and friction are missing from the model."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

RATES_HZ = (20.0, 50.0, 100.0, 250.0, 500.0, 1000.0)
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 0 1")
GIVE_RAD = 5e-4
"""Dry friction gives way by about this angle before a joint slips."""
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Made:
    """One log.

    Attributes:
        model: MJCF of the robot as its maker describes it.
        columns: of the log.
        joints: names.
        loudest: the joint of the strongest motion.
        latency_s: of velocities and of positions after their commands [s].
        about: what the robot and its motion are like.
    """

    model: str
    columns: Columns
    joints: tuple[str, ...]
    loudest: int
    latency_s: float
    about: str


def model_text(rng: np.random.Generator, count: int) -> str:
    """A chain of links that become shorter and lighter."""
    lengths, text = np.linspace(0.35, 0.12, count), ""
    for k, length in enumerate(lengths):
        mass, at = 12.0 * length * rng.uniform(0.7, 1.3), length * rng.uniform(0.3, 0.6)
        size = mass * (length**2 / 12.0 + 1e-3)
        text += (
            f'<body name="b{k}" pos="0 0 {lengths[k - 1] if k else 0.2}">'
            f'<joint name="j{k}" axis="{AXES[k]}" range="-3 3"/>'
            f'<inertial mass="{mass}" pos="{0.02 * rng.standard_normal()} {0.02 * rng.standard_normal()} {at}" '
            f'diaginertia="{size} {size} {0.4 * size}"/>'
        )
    return f'<mujoco><compiler angle="radian"/><worldbody>{text}{"</body>" * count}</worldbody></mujoco>'


def motion(rng: np.random.Generator, time: np.ndarray, count: int, dwells: bool) -> np.ndarray:
    """Commanded positions at times, shape (Q, J): sums of sines, or moves from rest to rest and dwells between them."""
    size = rng.uniform(0.3, 0.9, count) * np.where(rng.random(count) < 0.25, 0.05, 1.0)
    if not dwells:
        rate, phase = 2.0 * np.pi * rng.uniform(0.08, 0.5, (4, count)), rng.uniform(0.0, 6.0, (4, count))
        return 0.6 * (size * np.sin(np.multiply.outer(time, rate) + phase)).sum(axis=1)
    out, now, at = np.empty((len(time), count)), size * rng.uniform(-1.5, 1.5, count), float(time[0])
    while at < time[-1]:
        goal, lasts, rests = (
            size * rng.uniform(-1.5, 1.5, count),
            rng.uniform(1.0, 2.0),
            rng.uniform(0.8, 2.5),
        )
        x = np.clip((time - at) / lasts, 0.0, 1.0)
        inside = time >= at
        out[inside] = (now + (goal - now) * (x**3 * (10 - 15 * x + 6 * x**2))[:, None])[inside]
        now, at = goal, at + lasts + rests
    return out


def friction(dq: np.ndarray, period_s: float) -> np.ndarray:
    """Direction of friction of joints that give way before they slip (Dahl), shape (Q, J)."""
    out = np.zeros_like(dq)
    for k in range(1, len(dq)):
        share = np.abs(dq[k]) * period_s / GIVE_RAD
        out[k] = np.sign(dq[k]) + (out[k - 1] - np.sign(dq[k])) * np.exp(-share)
    return out


def made(seed: int) -> Made:
    """A healthy log."""
    rng = np.random.default_rng(seed)
    count, rate_hz = int(rng.integers(3, 8)), RATES_HZ[seed % len(RATES_HZ)]
    noise, latency_s = float(10.0 ** rng.uniform(-3.0, np.log10(0.05))), (0.0, 0.012)[seed % 2]
    dwells, idle = bool(rng.random() < 0.5), int(rng.integers(count)) if rng.random() < 0.4 else None
    payload_kg = float(rng.uniform(0.5, 3.0)) if rng.random() < 0.5 else 0.0
    text = model_text(rng, count)
    real = mujoco.MjModel.from_xml_string(text)
    real.body_mass[:] *= rng.uniform(0.8, 1.3)
    real.body_inertia[:] *= rng.uniform(0.8, 1.3)
    if payload_kg:
        last, at = real.nbody - 1, np.array([0.05, -0.03, 0.2]) * rng.uniform(0.5, 1.5)
        total = real.body_mass[last] + payload_kg
        lever = at - real.body_ipos[last]
        share = real.body_mass[last] * payload_kg / total
        real.body_inertia[last] += share * (lever @ lever - lever**2) + 2e-3 * payload_kg
        real.body_ipos[last] += payload_kg / total * lever
        real.body_mass[last] = total
    finer = max(1, round(1000.0 / rate_hz))
    period_s = 1.0 / rate_hz / finer
    time = np.arange(-1.0, 16.0, period_s)
    q = motion(rng, time, count, dwells)
    if idle is not None:
        q[:, idle] = rng.uniform(-1.0, 1.0)
    dq = np.gradient(q, period_s, axis=0)
    ddq = np.gradient(dq, period_s, axis=0)
    rub = friction(dq, period_s)
    rows, data = np.arange(round(1.0 / period_s), len(time), finer), mujoco.MjData(real)
    torque = np.empty((len(rows), count))
    for k, row in enumerate(rows):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[row], dq[row], ddq[row]
        mujoco.mj_inverse(real, data)
        torque[k] = data.qfrc_inverse
    size = np.maximum(np.sqrt(np.mean(torque**2, axis=0)), 0.2)
    moved = np.sqrt(np.mean(dq**2, axis=0))
    torque += rng.uniform(0.05, 0.4) * size * rub[rows] + 0.1 * size * dq[rows] / max(moved.max(), 1e-9)
    late = np.stack([np.interp(time - latency_s, time, x) for x in dq.T], axis=1)
    goal = np.stack([np.interp(time + latency_s, time, x) for x in q.T], axis=1)
    step, shape = 2.0 * np.pi / 2**17, torque.shape
    hum = noise * rng.standard_normal((3, *shape))
    read = {
        "q": step * np.round((q[rows] + 2e-3 * hum[0]) / step),
        "dq": late[rows] + moved.max() * hum[1],
        "torque": torque + size * hum[2],
        "goal": goal[rows],
    }
    joints = tuple(f"j{k}" for k in range(count))
    columns = {"time": time[rows] - time[rows[0]]}
    columns |= {f"{joint} {what}": x[:, k] for what, x in read.items() for k, joint in enumerate(joints)}
    about = (
        f"{count} axes, {rate_hz:g} Hz, noise {100 * noise:.2g} %, {'dwells' if dwells else 'sines'}, payload "
        f"{payload_kg:.1f} kg, latency {1e3 * latency_s:g} ms, {'no joint' if idle is None else f'j{idle}'} idle"
    )
    return Made(text, columns, joints, int(np.argmax(moved)), latency_s, about)
