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

import numpy as np
import tyro

from inspection.arms import Columns, Made, made
from mocobot import serial
from mocobot.progress import bar

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
