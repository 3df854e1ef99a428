"""Joint logs of simulated arms, healthy ones and ones with a fault: what does `inspect --model` say?

    python benchmarks/inspect_joints.py --healthy 30 --faulty 36

Healthy arms have 3 to 7 axes, masses that are off, payloads and friction that the model lacks, idle and slow joints,
dwells, noise of 0.1 to 5 %, rates of 20 to 1000 Hz, and latencies that all joints share. MuJoCo computes the torques.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import tyro

from mocobot import serial
from mocobot.progress import bar

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


OFF_S = 2e-3
"""A stated latency that is farther from the true one than this and three standard errors is wrong."""
FILTERED = re.compile(r"dq of .* is .* ms later than its position: it is filtered")


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        healthy: logs of healthy robots.
        faulty: logs with a fault, spread over the kinds.
        seed: of the first one.
        show: print what is said of every log that counts against the inspection.
    """

    healthy: int = 30
    faulty: int = 36
    seed: int = 0
    show: bool = True


def inspected(log: Made, columns: Columns, folder: Path) -> serial.JointInspection:
    """The inspection of a log, by way of its files."""
    names = ", ".join(f'"{joint}"' for joint in log.joints)
    units = (("q", "rad"), ("dq", "rad/s"), ("torque", "Nm"), ("command", "rad"))
    channels = "\n".join(
        f'{name} = {{ column = "{{joint}} {"goal" if name == "command" else name}", unit = "{unit}" }}'
        for name, unit in units
    )
    (folder / "arm.xml").write_text(log.model)
    (folder / "log.toml").write_text(
        f'joints = [{names}]\ntime = {{ column = "time", unit = "s" }}\n[channels]\n{channels}\n[control]\n'
        'command = "position"\n'
    )
    np.savez(folder / "log.npz", **columns)  # type: ignore[arg-type]
    return serial.inspect(folder / "log.npz", folder / "arm.xml")


def alarms(log: Made, found: serial.JointInspection) -> list[str]:
    """What is said against a healthy log, and stated latencies that are wrong."""
    said = [f.sentence for f in found.findings]
    if log.latency_s:  # the velocities are late, and that may be said
        said = [s for s in said if not FILTERED.match(s)]
    if found.ready_for.startswith("ready for: nothing"):
        said.append(found.ready_for)
    for what, every in (("dq", found.velocities), ("q after its command", found.commands)):
        for one in every:
            error = abs(one.delay_s - log.latency_s)
            if error > OFF_S + 3.0 * getattr(one, "delay_se_s", 0.0):  # NaN: not determined
                said.append(f"latency of {what} of {log.joints[one.joint]}: {1e3 * one.delay_s:.1f} ms")
    return said


def with_fault(kind: str, log: Made, rng: np.random.Generator) -> tuple[Columns, str]:
    """Columns of the log with a fault, and the sentence that says so."""
    out = {name: x.copy() for name, x in log.columns.items()}
    time, j = out["time"], log.loudest
    one, other = (f"j{k}" for k in sorted((j, j + 1 if j + 1 < len(log.joints) else j - 1)))
    name, row = log.joints[j], int(rng.integers(len(time) // 3, len(time) // 2))
    rate_hz = (len(time) - 1) / (time[-1] - time[0])
    if kind == "stuck":  # a joint that rests hides it
        row = len(time) // 4 + int(
            np.argmax(np.abs(log.columns[f"{name} goal"][len(time) // 4 : -len(time) // 4]))
        )
    if kind == "degrees":
        for joint in log.joints:
            for what in ("q", "dq"):
                out[f"{joint} {what}"] *= 180.0 / np.pi
        return out, "q of all joints are degrees|q of .* are degrees, taken for radians"
    if kind == "sign":
        out[f"{name} torque"] *= -1.0
        return out, f"torque of {name} has the wrong sign|torque of {name} .*hardly follow"
    if kind == "swapped":
        for what in ("q", "dq", "torque"):
            out[f"{one} {what}"], out[f"{other} {what}"] = out[f"{other} {what}"], out[f"{one} {what}"]
        return out, f"{one} and {other} (are exchanged|follow each other)"
    if kind == "stuck":
        out[f"{name} q"][row : row + round(1.5 * rate_hz)] = out[f"{name} q"][row]
        return out, f"q of {name} is stuck"
    if kind == "late":
        for joint in log.joints:
            out[f"{joint} torque"] = np.interp(time - 0.04, time, out[f"{joint} torque"])
        return out, r"torques run .* ms behind the motion"
    if kind == "NaN":
        out[f"{name} torque"][row : row + 2] = np.nan
        return out, f"torque of {name}: 2 NaN"
    if kind == "1e300":
        out[f"{name} dq"][row] = 1e300
        return out, f"dq of {name}.*1e\\+300"
    keep = np.ones(len(time), dtype=bool)
    keep[row : row + max(2, round(0.7 * rate_hz))] = False
    return {column: x[keep] for column, x in out.items()}, r"missing in 1 gap"


KINDS = ("degrees", "sign", "swapped", "stuck", "late", "NaN", "1e300", "gap")
BLOCKING = ("degrees", "swapped", "1e300")
"""Kinds of fault with which a log is ready for nothing as it is."""


def main(options: Options) -> None:
    """Make, inspect, count."""
    said: Counter[str] = Counter()
    with (
        bar(options.healthy + options.faulty, "inspecting", "log") as advance,
        tempfile.TemporaryDirectory() as made_in,
    ):
        folder, clean, wrong = Path(made_in), 0, []
        for seed in range(options.seed, options.seed + options.healthy):
            log = made(seed)
            against = alarms(log, inspected(log, log.columns, folder))
            clean += not against
            said.update(re.sub(r"[\d.e+-]+", "#", sentence)[:60] for sentence in against)
            wrong += [f"\nlog {seed}: {log.about}", *(f"    - {sentence}" for sentence in against)] * bool(
                against
            )
            advance(1)
        got: Counter[str] = Counter()
        for k in range(options.faulty):
            kind, seed = KINDS[k % len(KINDS)], 1000 + options.seed + k
            log = made(seed)
            columns, sentence = with_fault(kind, log, np.random.default_rng(seed))
            found = inspected(log, columns, folder)
            every = [f.sentence for f in found.findings] + [found.ready_for]
            hit = any(re.search(sentence, s) for s in every)
            blocked = kind not in BLOCKING or found.ready_for.startswith("ready for: nothing")
            got[kind] += hit and blocked
            if not (hit and blocked):
                wrong += [
                    f"\nlog {seed} with fault {kind!r}, not found: {log.about}",
                    *(f"    - {s}" for s in every),
                ]
            advance(1)
    if options.show:
        print("\n".join(wrong))
    print(f"\nhealthy logs without an alarm: {clean} of {options.healthy}; alarms: {said.total()}")
    for what, number in said.most_common():
        print(f"    {number:4}  {what}")
    each = Counter(KINDS[k % len(KINDS)] for k in range(options.faulty))
    print("faults found: " + ", ".join(f"{kind} {got[kind]} of {each[kind]}" for kind in each))


if __name__ == "__main__":
    main(tyro.cli(Options))
