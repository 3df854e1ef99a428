"""``mocobot diagnose``: read recordings, find out what the simulation gets wrong, report and write it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discrepancy import rules
from discrepancy.engine.diagnose import Diagnosis, diagnose
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.result.text import format_diagnosis
from discrepancy.team.causes import CAUSES
from discrepancy.team.estimates import errors, estimates
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import read_tolerances
from discrepancy.team.traces import traces
from discrepancy.team.words import TeamWords
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import CONTRADICTION
from estimator.files import whole_folder
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from mocobot.commands.diagnose_folder import check_options, write_diagnosis
from mocobot.files.provenance import file_facts, provenance
from mocobot.progress import bar, stages
from mocobot_sim.trial.truth import truth_path

if TYPE_CHECKING:
    from mocobot.options import Diagnose


def run(options: Diagnose) -> None:
    """Run the command.

    Raises:
        InputError: recordings, tolerances or options that cannot be used, or an output that cannot be written.
    """
    check_options(options, CAUSES)
    tolerances = read_tolerances(options.tolerances)
    with whole_folder(options.out) if options.out else nullcontext() as folder:
        with bar(len(options.rec), "reading", "file") as advance:
            recordings = []
            for path in options.rec:
                recordings.append(read_recording(path))
                advance(1)
        _check_recordings(recordings)
        inputs = [*options.rec, *([options.tolerances] if options.tolerances else [])]
        made_with = provenance("diagnose", asdict(options), inputs) if folder else {}
        with stages() as (say, advance):
            say("estimate")
            estimate = estimate_payload(recordings)
            _check_masses(recordings)
            _check_estimate(estimate)
            say("linearise")
            rig = TeamRig.of(recordings, estimate, tolerances, options.exclude, options.jobs)
            diagnosis = diagnose(
                rig, closed_loop=options.closed_loop, jobs=options.jobs, say=say, simulated=advance
            )
            values = _values(diagnosis, rig, options.rec)
            if folder is not None:
                say("write")
                if "errors" in values["gain"]:
                    made_with["files"] += [file_facts(truth_path(path)) for path in options.rec]
                values["provenance"] = made_with
                shown = (rig, diagnosis.explanation)
                write_diagnosis(folder, values, diagnosis, rig, TeamWords(), lambda: traces(*shown))
    print(format_diagnosis(values))  # after the folder is in place: whoever reads may close the pipe
    if options.out:
        print(f"\nWritten to {options.out}.")


def _check_recordings(recordings: Sequence[Recording]) -> None:
    first = recordings[0]
    if first.metadata.robots < 2:
        raise InputError(
            f"{first.name} has one robot; without a second one nothing tells where the payload really is, so there is "
            "nothing to diagnose"
        )
    ends = 2.0 * rules.TEAM_TRIM_S
    used = [max(0.0, recording.time[-1] - recording.time[0] - ends) for recording in recordings]
    if sum(used) < rules.LEAST_S:
        names = ", ".join(recording.name for recording in recordings)
        raise InputError(
            f"{names}: {sum(used):.1f} s are left when {rules.TEAM_TRIM_S:g} s are dropped at both ends; a diagnosis "
            f"needs at least {rules.LEAST_S:g} s, and {rules.GOOD_S:g} s of motion to be worth much"
        )
    for other in recordings[1:]:
        if other.metadata.robots != first.metadata.robots:
            raise InputError(
                f"{other.name} has {other.metadata.robots} robots and {first.name} has {first.metadata.robots}; "
                "recordings of one payload must have the same robots"
            )
        if other.metadata.design != first.metadata.design:
            raise InputError(
                f"{other.name} and {first.name} are of robots of different design; diagnose one at a time"
            )


def _check_estimate(estimate: PayloadEstimate) -> None:
    """Without a payload there is no model; say why, where wrenches that contradict each other are the reason."""
    if estimate.p_1c is None and any(CONTRADICTION in flag for flag in estimate.flags):
        names = ", ".join(recording.name for recording in estimate.recordings)
        raise InputError(
            f"{names}: the robots' wrenches do not add up to one payload, so there is nothing to hold the data "
            "against; is a robot missing, or a torque's sign or column wrong?"
        )


def _check_masses(recordings: Sequence[Recording]) -> None:
    """Recordings without a label may still be of different payloads in the same grasps."""
    masses = []
    for recording in recordings if len(recordings) > 1 else ():
        try:
            alone = estimate_payload([recording])
        except InputError:  # too little motion to tell on its own
            continue
        if alone.mass is not None:
            masses.append((alone.mass.mass, alone.mass.se, recording.name))
    if not masses:
        return
    (low, low_se, light), (high, high_se, heavy) = min(masses), max(masses)
    if high - low > max(rules.MASS_TOLERANCE_SHARE * high, rules.MASS_TOLERANCE_SE * (low_se + high_se)):
        raise InputError(
            f"{light} says {low:.2f} kg and {heavy} says {high:.2f} kg; recordings must be of one payload"
        )


def _values(diagnosis: Diagnosis, rig: TeamRig, paths: Sequence[Path]) -> dict[str, Any]:
    found: dict[str, Any] = dict(estimates(rig, diagnosis.explanation))
    truth = _truth(paths)
    if truth is not None:
        try:
            found["errors"] = {name: errors(found[name], truth) for name in ("before", "after")}
        except (KeyError, TypeError, ValueError, IndexError):  # a sidecar of something else
            found.pop("errors", None)
    return diagnosis_to_dict(diagnosis, rig, TeamWords(), found)


def _truth(paths: Sequence[Path]) -> dict[str, Any] | None:
    """The truth beside the recordings, opened after the verdict, if all have the same."""
    keys = ("grasps", "mass_kg", "p_1c_m", "principal_inertia_kgm2")
    found = []
    for path in paths:
        try:
            values = json.loads(truth_path(path).read_text(encoding="utf-8"))
            found.append({key: values[key] for key in keys})
        except (OSError, ValueError, KeyError, TypeError):
            return None
    return found[0] if all(values == found[0] for values in found) else None
