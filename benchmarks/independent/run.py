"""Diagnose recordings that the independent generator made, blind, and print the tables.

Sets and results are kept in the output folder, and skipped when the command is given again.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
# As mocobot does, which is imported too late here: threads that share small matrices only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import tyro

from estimator.recording.parquet import write_recording
from independent.generate import ANSWERS, FORMS, Noise, generate
from mocobot.campaign.background import SPREAD_IN_UNCALIBRATED
from mocobot.campaign.ground import gimbal_axes
from mocobot_sim.scene.scene import build_team
from sealed import sets
from sealed.campaign import apart, costs, engine, verdict_on
from sealed.limits import BACKGROUNDS, Background
from sealed.score import family_of
from sealed.sets import largest
from sealed.tables import misses, tables

Kind = Literal["clean", "single", "forms", "pairs"]
KINDS: tuple[Kind, ...] = ("clean", "single", "forms", "single", "pairs", "single", "clean", "forms")
"""Kinds of successive seeds."""
SHARES = (0.4, 0.25, 0.2, 0.15)
"""Of the backgrounds, as in the sealed campaign."""
SIZES = (4.0, 15.0)
"""Over the limit; drawn evenly in logarithm, up to what the simulator can run. Limits are the simulator's."""
LEFT_OUT = ("slosh",)
"""What is not hidden: motions below 0.6 Hz hardly swing a pendulum of 0.1 to 0.4 m, so it has another limit."""
PAYLOADS = ("a", "b", "c", "d")
OFF: dict[str, dict[str, str]] = {
    "phi_zero": {"phi_zero": "zero_rad"},
    "theta_zero": {"theta_zero": "zero_rad"},
    "link_length": {"proximal": "proximal_m", "rod": "rod_m", "base_radius": "base_radius_m"},
    "sea_scale": {"sea_scale": "scale"},
    "sea_bias": {"sea_bias": "bias_Nm"},
    "sea_hardening": {"sea_hardening": "cubic_Nm_per_rad3"},
    "sea_hysteresis": {"sea_hysteresis": "friction_Nm"},
    "joint_friction": {"joint_coulomb": "coulomb_Nm", "joint_viscous": "viscous_Nms_per_rad"},
    "gimbal_friction": {"gimbal_coulomb": "coulomb_Nm", "gimbal_viscous": "viscous_Nms_per_rad"},
}
"""What the generator's quantities of every joint are in the catalogue: causes and their parameters."""
OFF_WHOLE: dict[str, tuple[str, ...]] = {
    "base_tilt": ("roll_rad", "pitch_rad"),
    "base_creep": ("x_mps", "y_mps"),
    "base_compliance": ("compliance_m_per_N",),
    "torque_skew": ("delay_s",),
    "torque_lag": ("time_constant_s",),
    "clock_delay": ("delay_s",),
    "grasp_flex": ("compliance_m_per_N",),
    "grasp_play": ("play_m",),
}
"""The same of every robot."""


@dataclass(frozen=True)
class IndependentSet:
    """One data set; equal ones give equal bits.

    Attributes:
        kind: what is hidden.
        seed: of everything random.
        background: the robots.
        names: causes, forms.
        factors: their sizes over the detection limit of the background.
        payload: name of a shipped payload.
    """

    kind: Kind
    seed: int
    background: Background
    names: tuple[str, ...]
    factors: tuple[float, ...]
    payload: str

    @property
    def key(self) -> str:
        """Name of the set."""
        what = [f"{name}-x{factor:.3g}" for name, factor in zip(self.names, self.factors, strict=True)]
        return "_".join([str(self.seed), self.kind, self.background, *what])


def plan(seed: int, kind: Kind | None = None) -> IndependentSet:
    """Decide what a set is, from its seed."""
    rng = np.random.default_rng([seed, *b"independent"])
    kind = kind or KINDS[seed % len(KINDS)]
    background = BACKGROUNDS[int(rng.choice(len(BACKGROUNDS), p=SHARES))]
    payload = str(rng.choice(PAYLOADS))
    names: list[str] = []
    while len(names) < {"clean": 0, "pairs": 2}.get(kind, 1):
        other = kind == "forms" or (kind == "pairs" and rng.uniform() < 1.0 / 3.0)
        name = str(rng.choice([one for one in ANSWERS if (one in FORMS) == other and one not in LEFT_OUT]))
        if background == "uncalibrated" and ANSWERS[name] in SPREAD_IN_UNCALIBRATED:
            continue
        if _family(name) not in map(_family, names):
            names.append(name)
    factors = tuple(_size(ANSWERS[name], background, rng) for name in names)
    return IndependentSet(kind, seed, background, tuple(names), factors, payload)


def _size(cause: str, background: Background, rng: np.random.Generator) -> float:
    high = min(SIZES[1], largest(cause, background))
    return float(np.exp(rng.uniform(*np.log([min(SIZES[0], high), high]))))


def _family(name: str) -> str | None:
    return family_of({"answer": {"cause": ANSWERS[name]}})


def diagnosed(request: IndependentSet, out: Path, noise: Noise) -> None:
    """Generate a set, diagnose it, and only then hold it against its truth."""
    here = out / "sets" / request.key
    here.mkdir(parents=True, exist_ok=True)
    result: dict[str, Any] = {"key": request.key, "set": asdict(request), "engine": engine(), "error": None}
    begun, hidden = 0.0, list(zip(request.names, request.factors, strict=True))
    try:
        recordings, truth = generate(request.seed, request.background, hidden, request.payload, noise=noise)
        files = [here / f"trial{number}.parquet" for number in range(1, len(recordings) + 1)]
        for recording, file in zip(recordings, files, strict=True):
            write_recording(recording, file)
        truth |= {
            "gimbal_axes_1": gimbal_axes(build_team(request.payload)),
            "background": background_of(truth["background"], request.background),
            "effects": [as_scored(effect, len(recordings)) for effect in truth["effects"]],
        }
        result["truth"] = json.loads(json.dumps(truth))
        begun = costs()["cpu_s"]
        result["verdict"], result["law_scores"] = verdict_on(files, closed_loop=False), []
        said = result["verdict"]["verdict"]
    except Exception:
        result["error"] = traceback.format_exc()
        said = result["error"].splitlines()[-1]
    result |= costs() | {"cpu_s": costs()["cpu_s"] - begun}
    sets.append(out / "results.jsonl", result)
    print(f"{request.key}: {said}", flush=True)


def as_scored(effect: Mapping[str, Any], trials: int) -> dict[str, Any]:
    """An effect with its place, as the score expects it, and a payload's mass as the catalogue tells it."""
    answer = dict(effect["answer"])
    known = dict(answer["known"])
    if known.get("last_trial") == trials:
        known["last_trial"] = 0  # the last, whatever its number
    if "first_rate_kgps" in effect["parameters"]:
        known["rate_kgps"] = float("nan")  # it leaks, at no one rate
    place = {name: answer[name] for name in ("robot", "joint")}
    return {**effect, **place, "answer": answer | {"known": known}}


def background_of(robots: Sequence[Mapping[str, Sequence[float]]], background: str) -> list[dict[str, Any]]:
    """What every robot is off by, as effects; of an uncalibrated team without what all of it has plenty of."""
    out = []
    for robot, values in enumerate(robots, start=1):
        for cause, names in OFF.items():
            if background == "uncalibrated" and cause in SPREAD_IN_UNCALIBRATED:
                continue
            for place, numbers in enumerate(zip(*(values[name] for name in names), strict=True), start=1):
                parameters = dict(zip(names.values(), numbers, strict=True))
                out.append({"cause": cause, "robot": robot, "joint": place, "parameters": parameters})
        for cause, parameters in OFF_WHOLE.items():
            drawn = {name: values[cause][k] for k, name in enumerate(parameters)}
            out.append({"cause": cause, "robot": robot, "joint": None, "parameters": drawn})
    return out


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        draws: how many sets.
        first: seed of the first.
        kind: what is hidden; in turn if not given.
        out: where recordings and results go.
        jobs: processes.
        noise: of the torque readings; coloured noise is an error that no cause of the catalogue has.
        tables: print the tables of the results instead.
        misses: print every set that is not wholly right instead.
        list: print what the sets are instead.
    """

    draws: int = 10
    first: int = 0
    kind: Kind | None = None
    out: Path = Path("out/independent")
    jobs: int = 1
    noise: Noise = "white"
    tables: bool = False
    misses: bool = False
    list: bool = False


def main(options: Options) -> None:
    """Run, or print what was run."""
    results = sets.read(options.out / "results.jsonl")
    if options.tables or options.misses:
        print(tables(results) if options.tables else misses(results))
        return
    seeds = range(options.first, options.first + options.draws)
    requests: Sequence[IndependentSet] = [plan(seed, options.kind) for seed in seeds]
    if options.list:
        print("\n".join(request.key for request in requests))
        return
    finished = {line["key"] for line in results}
    todo = [request for request in requests if request.key not in finished]
    apart(todo, lambda request: diagnosed(request, options.out, options.noise), options.jobs)  # type: ignore[arg-type]


if __name__ == "__main__":
    main(tyro.cli(Options))
