"""What naming a hidden effect is worth: the whole diagnosis, closed loop included, on sets of the campaign.

    python benchmarks/hidden_gain.py --factor 4 --first 20 --jobs 2

Errors are of the closed loop on trials that cause and payload were not fitted to, and of the payload's estimate against
the simulated truth, as if nothing were off and with what is. Finished sets are kept in the output folder.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tyro
from tqdm import tqdm

from discrepancy.engine.diagnose import diagnose
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.team.estimates import errors, estimates
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.words import TeamWords
from estimator.estimate.payload import estimate_payload
from hidden.campaign import engine
from hidden.gain_table import gain_table
from hidden.generator import HiddenSet
from hidden.store import append_result, read_results, recordings_of
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.truth import GroundTruth

TEN = (
    "phi_zero",
    "theta_zero",
    "link_length",
    "base_tilt",
    "sea_scale",
    "sea_bias",
    "sea_hardening",
    "joint_friction",
    "torque_lag",
    "tether",
)


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        causes: what to hide, one set each.
        factor: size over the detection limit.
        first: seed; the sets are those that the campaign has with it.
        jobs: processes of one diagnosis.
        out: folder of the campaign.
        table: print what is there instead.
    """

    causes: tuple[str, ...] = TEN
    factor: float = 4.0
    first: int = 0
    jobs: int = 2
    out: Path = Path("out/hidden")
    table: bool = False


def main(options: Options) -> None:
    """Run what is not there yet, and print the table."""
    path = options.out / "gain.jsonl"
    if not options.table:
        done = {result["key"] for result in read_results(path)}
        requests = [HiddenSet("single", options.first, (cause,), options.factor) for cause in options.causes]
        options.out.mkdir(parents=True, exist_ok=True)
        for request in tqdm([r for r in requests if r.key not in done], unit="set", dynamic_ncols=True):
            append_result(path, _gain(request, options))
    print(gain_table(read_results(path)))


def _gain(request: HiddenSet, options: Options) -> dict[str, Any]:
    """One set: verdict, gain, and errors of the estimates; the truth is opened after the verdict."""
    recordings, sealed = recordings_of(request, options.out / "sets")
    start, cpu = time.perf_counter(), []
    rig = TeamRig.of(recordings, estimate_payload(recordings), read_tolerances(None), (), options.jobs)

    def say(what: str) -> None:
        if what == "simulate":
            cpu.append(time.perf_counter() - start)

    diagnosis = diagnose(rig, jobs=options.jobs, say=say)
    whole = time.perf_counter() - start
    before_after = estimates(rig, diagnosis.explanation)
    values = diagnosis_to_dict(diagnosis, rig, TeamWords(), before_after)
    truth = sealed.open({"found": values["causes"]})
    true = GroundTruth.of(build_team(truth["payload"])).to_dict()
    return {
        "part": "gain",
        "key": request.key,
        "engine": engine(),
        "hidden": truth["effects"][0],
        "payload": truth["payload"],
        "verdict": values["verdict"],
        "causes": [{key: c[key] for key in ("cause", "robot", "joint")} for c in values["causes"]],
        "gain": {key: values["gain"][key] for key in ("held_out", "noise", "removed")},
        "errors": {name: errors(value, true) for name, value in before_after.items()},
        "scan_s": cpu[0] if cpu else whole,
        "whole_s": whole,
    }


if __name__ == "__main__":
    main(tyro.cli(Options))
