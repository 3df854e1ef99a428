"""Machines with one fault each, diagnosed with the model of their healthy days: a table by fault.

    python benchmarks/commanded/faults.py FOLDER --first 560 --machines 6
    python benchmarks/commanded/faults.py FOLDER --show

For each machine, ``calibrate`` fits the two runs of its healthy days. Then each fault is put into it, and ``diagnose``
reads the held-out run of that machine with ``as_found.xml`` and the ``log.toml`` beside it. A fault is **named** if it
is among the causes named, at its joint. A diagnosis is **falsely certain** if it has a cause at 90 % or more that the
machine does not have. Machines of the laws M4 to M6 have friction that no MJCF holds beside the fault; causes of
friction are true of these. What was done is kept in the sets' folders.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import tyro

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # also runs as a file

from commanded import score
from commanded.campaign import calibrated
from commanded.make import Fault, make

CAUSE = {
    "backlash": "backlash", "soft_stand": "soft_stand", "half_gain": "torque_scale", "friction_tripled": "friction",
    "extra_delay": "torque_delay",
}  # fmt: skip
FRICTION = (
    "friction", "stribeck", "sublinear_friction", "load_friction", "asymmetric_coulomb", "asymmetric_viscous",
    "unlisted",
)  # fmt: skip
"""True of a gear that rubs otherwise when the load drives it: its friction differs by direction, too."""
CERTAIN = 0.9


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        folder: where sets are written, a folder each.
        first: seed of the first machine; the others follow.
        machines: how many machines, legs (200 Hz) and arms (50 Hz) in turn.
        faults: which faults.
        show: print what the folder has.
    """

    folder: tyro.conf.Positional[Path]
    first: int = 0
    machines: int = 6
    faults: tuple[Fault, ...] = get_args(Fault)
    show: bool = False


def diagnosed(folder: Path, healthy: Path) -> dict[str, Any]:
    """Run the program; its exit code, CPU [s], and causes named as (cause, joint, probability, sentence)."""
    command = [
        sys.executable,
        "-m",
        "mocobot",
        "diagnose",
        "held_out.csv",
        "--model",
        healthy / "out/as_found.xml",
    ]
    command += ["--map", healthy / "out/log.toml", "--out", "out", "--force", "--no-closed-loop"]
    with (folder / "diagnose.txt").open("w", encoding="utf-8") as said:
        ran = subprocess.Popen([*map(str, command)], stdout=said, stderr=subprocess.STDOUT, cwd=folder)
        _, status, used = os.wait4(ran.pid, 0)
    ran.returncode = os.waitstatus_to_exitcode(status)
    out = {"exit": ran.returncode, "cpu_s": used.ru_utime + used.ru_stime, "peak_MiB": used.ru_maxrss / 1024}
    if ran.returncode:
        return out
    told = json.loads((folder / "out/diagnosis.json").read_text(encoding="utf-8"))
    out["causes"] = [[f["cause"], f["joint"], f["probability"], f["sentence"]] for f in told["causes"]]
    return out


def judged(truth: dict[str, Any], causes: list[list[Any]]) -> tuple[bool, list[str]]:
    """Whether the fault is named, and false causes at 90 % or more."""
    fault, joints = truth["fault"], [*truth["joints"]]
    where = {joints.index(fault["joint"]) + 1} if "joint" in fault else {None, *range(1, len(joints) + 1)}

    def right(cause: str, joint: int | None) -> bool:
        return cause == CAUSE[fault["name"]] and joint in where

    own = [right(cause, joint) for cause, joint, *_ in causes]
    law = truth["law"] != "M1"
    false = [
        sentence
        for is_own, (cause, _, p, sentence) in zip(own, causes, strict=True)
        if p >= CERTAIN and not is_own and not (law and cause in FRICTION)
    ]
    return any(own), false


def one(root: Path, kind: Literal["leg", "arm"], seed: int, fault: Fault) -> None:
    """Make, diagnose and judge a set."""
    rate, healthy, folder = (
        {"leg": 200.0, "arm": 50.0}[kind],
        root / f"{kind}_{seed}",
        root / f"{kind}_{seed}_{fault}",
    )
    if (folder / "fault.json").is_file():
        return
    if not (healthy / "out/as_found.xml").is_file():
        make(kind, seed, rate, healthy)
        print(
            f"{healthy.name}: calibrated in {calibrated(healthy)['cpu_s']:.0f} s", file=sys.stderr, flush=True
        )
    make(kind, seed, rate, folder, fault)
    out = diagnosed(folder, healthy)
    truth = score.read_truth(folder)
    out |= {"kind": kind, "seed": seed, "law": truth["law"], "fault": truth["fault"]}
    out["named"], out["false"] = judged(truth, out.get("causes", []))
    (folder / "fault.json").write_text(json.dumps(out, indent=1), encoding="utf-8")
    print(
        f"{folder.name}: {out['cpu_s']:.0f} s, named {out['named']}, false {out['false']}",
        file=sys.stderr,
        flush=True,
    )


def table(sets: list[dict[str, Any]]) -> str:
    """Counts by fault, and what was missed or false."""
    lines = [
        "| fault | sets | named | missed | falsely certain | CPU, median [s] |",
        "|---|---|---|---|---|---|",
    ]
    for fault in (*CAUSE, "all"):
        own = [s for s in sets if fault in ("all", s["fault"]["name"])]
        if own:
            named, false = sum(s["named"] for s in own), sum(bool(s["false"]) for s in own)
            cpu = sorted(s["cpu_s"] for s in own)[len(own) // 2]
            lines.append(f"| {fault} | {len(own)} | {named} | {len(own) - named} | {false} | {cpu:.0f} |")
    for s in sets:
        what = f"- {s['kind']} {s['seed']} ({s['law']}), {s['fault']['name']}: "
        lines += [] if s["named"] else [f"{what}missed; told: {[c[3] for c in s.get('causes', [])]}"]
        lines += [f"{what}false: {text}" for text in s["false"]]
    return "\n".join(lines)


def main(options: Options) -> None:
    """Make what is missing, and print the table of all that the folder has."""
    o = options
    for k in range(0 if o.show else o.machines):
        for fault in o.faults:
            one(o.folder, "arm" if k % 2 else "leg", o.first + k // 2, fault)
    print(table([json.loads(p.read_text("utf-8")) for p in sorted(o.folder.glob("*/fault.json"))]))


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
