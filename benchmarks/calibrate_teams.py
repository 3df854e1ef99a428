"""Calibrate simulated teams of uncalibrated robots from what they carry, and compare with the truth.

    python benchmarks/calibrate_teams.py --part main --seeds 300 301 302 303 --jobs 2
    python benchmarks/calibrate_teams.py --tables

Recordings and results are kept in the output folder; finished ones are skipped when a command is given again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from scipy.stats import chi2

from calibration import run_tasks, tasks
from sealed.sets import read

ERRORS = (
    ("R_deg", "R [deg]", 0.002),
    ("p_mm", "p [mm]", 0.6),
    ("com_mm", "CoM [mm]", 0.5),
    ("m_percent", "m [%]", 0.3),
    ("I_percent", "I [%]", 0.3),
)
"""Key, heading, bar; masses and inertias against the truth over 1 + mean spring ratio."""
RAW = (("m_percent_raw", "m against the truth [%]"), ("I_percent_raw", "I against the truth [%]"))
CLAIMED = ("grasps", "m", "com", "I", "payload")


def tables(results: Iterable[Mapping[str, Any]]) -> str:
    """All tables."""
    listed = list(results)
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for result in listed:
        if not result["error"]:
            groups.setdefault(_group(result), []).append(result)
    failed = [
        f"- {r['part']} {r['key']}: {r['error'].strip().splitlines()[-1]}" for r in listed if r["error"]
    ]
    parts = [
        "Errors, rms (largest), share of teams within the bar",
        _table(_errors_header(), [_errors_row(name, group) for name, group in groups.items()]),
        "Claims: NEES over its size [95 % band], and coverage of 95 % intervals",
        _table(_claims_header(), [_claims_row(name, group, "claims") for name, group in groups.items()]),
        "The same with the held scale's uncertainty, against the truth itself",
        _table(
            _claims_header(),
            [
                _claims_row(name, group, "claims_in_all")
                for name, group in groups.items()
                if "claims_in_all" in group[0]
            ],
        ),
        "chi2/n after, and held out: median (largest) of loops, and of balance",
        _table(
            ["", "trial", "after: loops", "balance", "held out: loops", "balance", "steps", "CPU [s]"],
            [row for name, group in groups.items() if "trials" in group[0] for row in _fit_rows(name, group)],
        ),
    ]
    if failed:
        parts += ["Not done", "\n".join(failed)]
    return "\n\n".join(parts)


def _group(result: Mapping[str, Any]) -> str:
    """Method and kind of team; a team's size where it is not three."""
    payload, *kind, _seed = result["key"].split("-")
    size = [payload.replace("plate", "N = ")] if payload.startswith("plate") else []
    return f"{result['part']}: {', '.join([*kind, *size])}"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(row) + " |" for row in [header, ["---"] * len(header), *rows])


def _errors_header() -> list[str]:
    return [
        "",
        "teams",
        *(f"{label} <= {bar}" for _, label, bar in ERRORS),
        *(label for _, label in RAW),
        "CPU [s]",
    ]


def _errors_row(name: str, group: Sequence[Mapping[str, Any]]) -> list[str]:
    cells = [name, str(len(group))]
    for key, _, bar in ERRORS:
        values = np.array([result[key] for result in group])
        cells.append(f"{_rms(values)} ({values.max():.2g}) {100 * np.mean(values <= bar):.0f} %")
    for key, _ in RAW:
        values = np.array([result[key] for result in group])
        cells.append(f"{_rms(values)} ({values.max():.2g})")
    return [*cells, f"{np.median([result['cpu_s'] for result in group]):.1f}"]


def _claims_header() -> list[str]:
    return ["", *CLAIMED, "robots"]


def _claims_row(name: str, group: Sequence[Mapping[str, Any]], key: str) -> list[str]:
    cells = [name]
    for what in CLAIMED:
        cells.append(_claim([r[key][what] for r in group if what in r[key]]))
    units = [r["units"] for r in group if r.get("units")] if key == "claims" else []
    return [*cells, _claim(units)]


def _claim(claims: Sequence[Mapping[str, Any]]) -> str:
    if not claims:
        return ""
    nees, size = sum(c["nees"] for c in claims), sum(c["n"] for c in claims)
    low, high = chi2.ppf([0.025, 0.975], size) / size
    z = np.concatenate([c["z"] for c in claims])
    return f"{nees / size:.2f} [{low:.2f}, {high:.2f}] {100 * np.mean(np.abs(z) < 1.96):.0f} %"


def _fit_rows(name: str, group: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    out = []
    for kind in dict.fromkeys(one["kind"] for one in group[0]["trials"]):
        of = [one for result in group for one in result["trials"] if one["kind"] == kind]
        cells = [name, kind]
        for key in ("after", "held_out"):
            pairs = np.array([one[key] for one in of if one[key] is not None])
            cells += [_spread(pairs[:, k]) for k in (0, 1)] if len(pairs) else ["", ""]
        steps = np.array([result["steps"] for result in group])
        cpu = np.array([result["cpu_s"] for result in group])
        out.append(
            [*cells, f"{np.median(steps):.0f} ({steps.max()})", f"{np.median(cpu):.1f} ({cpu.max():.1f})"]
        )
    return out


def _rms(values: np.ndarray) -> str:
    return f"{np.sqrt(np.mean(values**2)):.2g}"


def _spread(values: np.ndarray) -> str:
    return f"{np.median(values):.2f} ({values.max():.2f})"


Part = Literal["main", "weighed", "transfer", "masses", "tilt", "robots", "nominal"]


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        part: what to run: estimates and calibrations of uncalibrated teams; one known weight; robots calibrated on
            payload (a); arm masses off by 5 %; bases that do not stand level; teams of other sizes; robots as designed.
        seeds: one team of robots each.
        payloads: what each carries.
        robots: sizes of the teams of part "robots".
        jobs: processes.
        out: where recordings and results go.
        tables: print the tables of all results instead.
    """

    part: tuple[Part, ...] = ("main",)
    seeds: tuple[int, ...] = (300,)
    payloads: tuple[str, ...] = ("a", "b", "c", "d")
    robots: tuple[int, ...] = (2, 5, 10)
    jobs: int = 2
    out: Path = Path("out/calibration")
    tables: bool = False


def main(options: Options) -> None:
    """Run, or print what was run."""
    if options.tables:
        print(tables(read(options.out / "results.jsonl")))
        return
    listed = [
        task for part in options.part for task in tasks(part, options.seeds, options.payloads, options.robots)
    ]
    run_tasks(listed, options.out, options.jobs)


if __name__ == "__main__":
    main(tyro.cli(Options))
