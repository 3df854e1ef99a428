"""How time and memory of `estimate` and `diagnose` grow with samples, robots and causes.

    python benchmarks/growth.py                       everything that has not been measured yet; may be interrupted
    python benchmarks/growth.py --most-minutes 15     without the long recordings
    python benchmarks/growth.py --tables              what there is

Rings of 4 kg a robot are carried at random with friction in one joint; every measurement is a command in a process of
its own, which may use one core: seconds of CPU, seconds of the clock, and the largest memory it ever had.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

import mocobot
from discrepancy.team.causes import CAUSES

MASS_KG, APART_M, VIA_S = 4.0, 1.1, 1.31
"""Mass of the ring for each robot, distance along its rim to the next, and time of one random via and the way there."""
FRICTION = {"coulomb_Nm": 0.05, "viscous_Nms_per_rad": 0.02}
ALL = len(CAUSES)
MINUTES, ROBOTS, KINDS = (1, 5, 15, 60), (2, 3, 6, 10), (1, 6, 12, ALL)
"""A diagnosis needs two robots."""


@dataclass(frozen=True)
class Point:
    """What is measured.

    Attributes:
        command: ``estimate``, ``diagnose`` (rows alone), or ``simulated``: diagnose with its closed loop.
        robots: how many.
        minutes: of the recording, at 100 Hz.
        kinds: of causes that are looked for; the true one is among them.
    """

    command: str
    robots: int = 3
    minutes: int = 1
    kinds: int = ALL


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        out: where recordings and results are kept.
        most_minutes: of a recording; longer ones are left for another time.
        most_s: seconds of the clock after which a command is given up, and counted as such.
        again: measure what was measured, too.
        tables: print what there is instead.
    """

    out: Path = Path("out/growth")
    most_minutes: int = 60
    most_s: float = 3600.0
    again: bool = False
    tables: bool = False


def points() -> Iterator[Point]:
    """What there is to measure, small things first."""
    yield from (Point(command, n, 1) for n in ROBOTS for command in ("estimate", "diagnose"))
    yield from (Point("diagnose", 3, 1, kinds) for kinds in KINDS)
    yield from (Point(command, 3, m) for m in MINUTES for command in ("estimate", "diagnose"))
    yield Point("estimate", 1, 1)
    yield Point("simulated", 3, 1)
    yield Point("diagnose", 10, 10)
    yield Point("estimate", 10, 10)
    yield Point("simulated", 10, 10)
    yield Point("simulated", 3, 60)


def ring_mjcf(robots: int) -> str:
    """A thin ring with its grasps evenly around it, {1} at the first; of one or two robots it hangs."""
    radius, height = (robots * APART_M / (2.0 * np.pi), 0.06) if robots > 2 else (0.35 * (robots - 1), -0.1)
    angles = 2.0 * np.pi * np.arange(robots) / robots
    sites = "\n".join(
        f'<site name="grasp{i + 1}" pos="{radius * (np.cos(a) - 1.0)} {radius * np.sin(a)} 0" euler="0 0 {a}"/>'
        for i, a in enumerate(angles)
    )
    mass = MASS_KG * robots
    across = 0.5 * mass * max(radius, 0.2) ** 2
    return f"""<mujoco model="ring">
  <compiler angle="radian"/>
  <worldbody>
    <body name="payload">
      <inertial pos="{-radius} 0 {height}" mass="{mass}" diaginertia="{across} {across} {2.0 * across}"/>
      <geom name="rim" type="cylinder" mass="0" contype="0" conaffinity="0"
            size="{max(radius, 0.2)} 0.02" pos="{-radius} 0 {height}"/>
      {sites}
    </body>
  </worldbody>
</mujoco>
"""


def recordings(robots: int, minutes: int, out: Path) -> list[Path]:
    """Simulated recordings of half an hour at most that last so long together; made once."""
    count = -(-minutes // 30)
    paths = [out / f"{robots}-robots-{minutes}-min-{k + 1}.parquet" for k in range(count)]
    payload = out / f"ring-{robots}.xml"
    payload.write_text(ring_mjcf(robots), encoding="utf-8")
    friction = mocobot.make_effect("joint_friction", FRICTION, robot=min(2, robots), joint=1)
    vias = round(60.0 * minutes / count / VIA_S)
    for k, path in enumerate(paths):
        if not path.is_file():
            trial = mocobot.simulate(payload, "random", vias=vias, seed=1, number=k, effects=[friction])
            mocobot.write_recording(trial, path)
    return paths


def words(point: Point, paths: Sequence[Path]) -> list[str]:
    """The command line."""
    if point.command == "estimate":
        return ["estimate", *map(str, paths)]
    others = [name for name in CAUSES if name != "joint_friction"]
    excluded = others[point.kinds - 1 :]
    out = ["diagnose", *map(str, paths), "--jobs", "1"]
    out += [] if point.command == "simulated" else ["--no-closed-loop"]
    return [*out, "--exclude", *excluded] if excluded else out


def measure(point: Point, paths: Sequence[Path], most_s: float) -> dict[str, Any]:
    """CPU [s], clock [s] and largest memory [MB] of one command, and whether it ended well."""
    begin = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "mocobot", *words(point, paths)],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    largest = 0
    while True:
        largest = max(largest, memory_kB(process.pid))
        pid, status, used = os.wait4(process.pid, os.WNOHANG)
        if pid:
            break
        if time.perf_counter() - begin > most_s:
            process.kill()
        time.sleep(0.05)
    assert process.stdout is not None
    said = process.stdout.read()
    return asdict(point) | {
        "cpu_s": round(used.ru_utime + used.ru_stime, 2),
        "clock_s": round(time.perf_counter() - begin, 2),
        "memory_MB": round(largest / 1024),
        "code": os.waitstatus_to_exitcode(status),
        "said": said[:120].split("\n")[0],
    }


def memory_kB(pid: int) -> int:
    """Largest resident memory of a process so far; what its resource usage says includes that of its parent."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("VmHWM:")), 0)


def read(path: Path) -> list[dict[str, Any]]:
    """All results; of what was measured several times the last."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return list({key_of(result): result for result in map(json.loads, lines)}.values())


def key_of(result: dict[str, Any]) -> Point:
    """What was measured."""
    return Point(*(result[name] for name in ("command", "robots", "minutes", "kinds")))


def table(results: Sequence[dict[str, Any]]) -> str:
    """All of it."""
    lines = [
        "| command | robots | minutes | kinds of causes | CPU [s] | memory [MB] |",
        "|---|---|---|---|---|---|",
    ]
    for r in sorted(results, key=lambda r: (r["command"], r["kinds"], r["robots"], r["minutes"])):
        ended = "" if r["code"] == 0 else f" (ended with {r['code']})"
        lines.append(
            f"| {r['command']} | {r['robots']} | {r['minutes']} | {r['kinds']} "
            f"| {r['cpu_s']:.1f}{ended} | {r['memory_MB']} |"
        )
    return "\n".join(lines)


def main(options: Options) -> None:
    """Measure, or show what was measured."""
    file = options.out / "results.jsonl"
    if options.tables:
        print(table(read(file)))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    done = set() if options.again else {key_of(result) for result in read(file)}
    for point in dict.fromkeys(points()):
        if point in done or point.minutes > options.most_minutes:
            continue
        result = measure(point, recordings(point.robots, point.minutes, options.out), options.most_s)
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(result) + "\n")
        print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main(tyro.cli(Options))
