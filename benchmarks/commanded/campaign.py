"""Fresh sets of every kind, calibrated by the program and judged: one table per kind.

    python benchmarks/commanded/campaign.py FOLDER --first 300
    python benchmarks/commanded/campaign.py FOLDER --show

Each set's folder has a ``campaign.json``, from which ``--show`` prints the tables again; a set that has one is not
made again. Physical parameters are reflected inertia, command delay, Coulomb and viscous friction, where the truth has
them. CPU is user and system time of ``mocobot calibrate``.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # also runs as a file

from commanded import score
from commanded.make import make
from estimator.statistics import rms

ORACLE, FAR, UNSETTLED = 0.1, 4.0, "has not settled"
"""Standard error of an oracle (share of the value), |error| over standard error to list, and words of a note."""
PHYSICAL = (score.ARMATURE, f"command_{score.DELAY}", score.COULOMB, score.VISCOUS)
OVER = [(window, which) for window in ("1 s", "whole") for which in ("true.xml", "truth", "model.xml")]


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        folder: where sets are written, a folder each.
        first: seed of the first set of legs, and of arms; the others follow.
        leg_200, leg_500, arm_50, arm_30: how many sets, by rate [Hz].
        show: print what the folder has.
    """

    folder: tyro.conf.Positional[Path]
    first: int = 0
    leg_200: int = 5
    leg_500: int = 3
    arm_50: int = 5
    arm_30: int = 4
    show: bool = False


def calibrated(folder: Path) -> dict[str, Any]:
    """Run the program; its exit code, CPU [s], peak memory [MiB] and last line of errors."""
    command = [sys.executable, "-m", "mocobot", "calibrate", "fit_0.csv", "fit_1.csv", "--model", "model.xml"]
    command += ["--map", "log.toml", "--out", "out", "--force"]
    with (folder / "calibrate.txt").open("w", encoding="utf-8") as said:
        ran = subprocess.Popen(command, stdout=said, stderr=subprocess.STDOUT, cwd=folder)
        _, status, used = os.wait4(ran.pid, 0)
    ran.returncode = os.waitstatus_to_exitcode(status)
    out = {"exit": ran.returncode, "cpu_s": used.ru_utime + used.ru_stime, "peak_MiB": used.ru_maxrss / 1024}
    if ran.returncode:
        out["error"] = (folder / "calibrate.txt").read_text(encoding="utf-8").strip().split("\n")[-1]
    return out


def judged(folder: Path) -> dict[str, Any]:
    """What a calibrated set is worth: forecasts, parameters beside the truth, friction curves."""
    options = score.Options(folder, folder / "out/as_found.xml", folder / "out/calibration.json")
    found, listed = score.forecasts(folder, options), score.scored(folder, options)
    told = json.loads((folder / "out/calibration.json").read_text(encoding="utf-8"))
    left = [p for p in told["parameters"] if p["parameter"] in PHYSICAL and not p["determined"]]
    best = {key: se / x for key, (x, se) in score.oracle(folder).items()} if left else {}
    for p in left:
        p["oracle"] = best.get((p["place"], p["parameter"]), np.inf)
    return {
        "settled": not any(UNSETTLED in note for note in told["notes"]),
        "determined": sum(p["determined"] for p in told["parameters"]),
        "parameters": [asdict(s) | {"z": s.z} for s in listed],
        "missed": [p for p in left if p["oracle"] < ORACLE],
        "curve": score.curve_errors(folder, options).tolist(),
        "forecast_rad": {which: {w: x.tolist() for w, x in own.items()} for which, own in found.items()},
        "over": {f"{w}, over {which}": score.ratio(found["fitted"][w], found[which][w]) for w, which in OVER},
    }


def one(folder: Path, kind: Any, rate_hz: int, seed: int) -> None:
    """Make, calibrate and judge a set, and keep what comes of it."""
    make(kind, seed, float(rate_hz), folder)
    out = {"kind": f"{kind} {rate_hz} Hz", "seed": seed, "law": score.read_truth(folder)["law"]}
    out |= calibrated(folder)
    out |= {} if out["exit"] else judged(folder)
    (folder / "campaign.json").write_text(json.dumps(out, indent=1), encoding="utf-8")
    print(f"{folder.name}: {out['cpu_s']:.0f} s, exit {out['exit']}", file=sys.stderr, flush=True)


def table(kind: str, sets: list[dict[str, Any]]) -> str:
    """The sets of a kind, a column each, and all of them: together, or median and worst."""
    good = [s for s in sets if s["exit"] == 0]
    failed = [f"- seed {s['seed']}: {s['error']}" for s in sets if s["exit"]]
    if not good:
        return "\n".join(failed)
    own = [[p for p in s["parameters"] if p["name"] in PHYSICAL and p["determined"]] for s in good]
    pooled = [*own, [p for some in own for p in some]]
    rows = {"set": [f"{s['seed']}, {s['law']}" for s in good] + ["all"], "---": ["---"] * len(pooled)}
    rows["physical parameters determined"] = [str(len(some)) for some in pooled]
    for name in ("", *PHYSICAL):
        z = [np.array([p["z"] for p in some if name in ("", p["name"])]) for some in pooled]
        cells = [f"{np.mean(np.abs(x) < 3.0):.0%}, {rms(x):.3g}" if x.size else "-" for x in z]
        rows[f"{name or 'all'}: within 3 standard errors, rms of error over standard error"] = cells
    rows["not determined, oracle below 10 %"] = [*(str(len(s["missed"])) for s in good), ""]
    numbers = {f"friction curve, {of.__name__}": [of(s["curve"]) for s in good] for of in (rms, max)}
    numbers |= {f"forecast, {over}": [s["over"][over] for s in good] for over in good[0]["over"]}
    numbers |= {name: [s[name] for s in good] for name in ("cpu_s", "peak_MiB")}
    for name, x in numbers.items():
        rows[name] = [*(f"{one:.3g}" for one in x), f"{np.median(x):.3g} / {max(x):.3g}"]
    out = [f"## {kind}", "", *(f"| {' | '.join((name, *row))} |" for name, row in rows.items()), "", *failed]
    for s in good:
        told = [] if s["settled"] else ["not settled"]
        told += [f"{_named(p)}, not determined, oracle {p['oracle']:.1%}" for p in s["missed"]]
        far = [p for p in s["parameters"] if p["determined"] and abs(p["z"]) > FAR]
        told += [f"{_named(p)}, truth {p['truth']:.4g}, z {p['z']:.1f}" for p in far]
        out += [f"- seed {s['seed']}: {line}" for line in told]
    return "\n".join(out) + "\n"


def _named(p: dict[str, Any]) -> str:
    return f"{p.get('name') or p['parameter']} of {p['place']} {p['value']:.4g} +- {p['se']:.2g}"


def main(options: Options) -> None:
    """Make what is missing, a set of each kind in turn, and print all that the folder has."""
    o = options
    plan = [("leg", 200, 0, o.leg_200), ("leg", 500, o.leg_200, o.leg_500)]
    plan += [("arm", 50, 0, o.arm_50), ("arm", 30, o.arm_50, o.arm_30)]
    todo = [(k, kind, rate, o.first + begin + k) for kind, rate, begin, many in plan for k in range(many)]
    for _, kind, rate, seed in [] if o.show else sorted(todo, key=lambda each: each[0]):
        folder = o.folder / f"{kind}_{rate}_{seed}"
        if not (folder / "campaign.json").is_file():
            one(folder, kind, rate, seed)
    kept = [json.loads(path.read_text("utf-8")) for path in sorted(o.folder.glob("*/campaign.json"))]
    for kind in dict.fromkeys(s["kind"] for s in kept):
        print(table(kind, [s for s in kept if s["kind"] == kind]))


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
