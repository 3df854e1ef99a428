"""``mocobot diagnose``: read recordings, find out what the simulation gets wrong, report and write it."""

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from discrepancy.causes.tolerances_file import read_tolerances
from discrepancy.emps import catalogue as emps_catalogue
from discrepancy.emps import causes as emps_causes
from discrepancy.emps.diagnosis import diagnose_emps
from discrepancy.emps.recording.reader import read_emps
from discrepancy.result.diagnosed import Diagnosed, is_diagnosis
from discrepancy.team.causes import CAUSES
from discrepancy.team.diagnosis import against_truth, diagnose_team
from discrepancy.team.tolerances import default_tolerances
from estimator.errors import InputError
from estimator.files import whole_folder
from estimator.recording.model import Recording
from mocobot.api.given import Logs, Robots, calibration_file
from mocobot.commands import diagnose_joints
from mocobot.files.provenance import file_facts, provenance
from mocobot.files.targets import check_folder, check_recordings, map_file
from mocobot.options import Diagnose
from mocobot.progress import bar, stages
from mocobot.strict import NotGood
from mocobot_logs.convert_report import format_on_the_fly
from mocobot_sim.trial.truth import truth_path


@dataclass(frozen=True)
class _Rig:
    """What can be diagnosed: names of its causes, its default tolerances, and what reads and diagnoses recordings."""

    causes: Collection[str]
    tolerances: Callable[[], Mapping[str, Mapping[str, float]]]
    read: Callable[[Sequence[Path], Logs, Robots], Any]
    diagnose: Callable[..., Diagnosed]


def run(options: Diagnose) -> None:
    """Run the command.

    Raises:
        InputError: recordings, tolerances or options that cannot be used, or an output that cannot be written.
        NotGood: with ``strict``, the verdict is neither consistent nor explained.
    """
    if options.model is not None:
        diagnose_joints.run(options, options.model)
        return
    if options.reference:
        raise InputError("--reference goes with --model: a healthy log of the same robot")
    rig = RIGS[options.rig]
    inputs = [*options.rec, *([options.tolerances] if options.tolerances else []), *map_file(options.map)]
    inputs += calibration_file(options.calibration)
    _check(options, rig.causes, inputs)
    logs, robots = Logs(options.map), Robots(options.calibration)
    tolerances = read_tolerances(options.tolerances, rig.tolerances())
    with whole_folder(options.out) if options.out else nullcontext() as folder:
        data = rig.read(options.rec, logs, robots)
        made_with = provenance("diagnose", asdict(options), inputs) if folder else {}
        with stages() as (say, simulated):
            found = rig.diagnose(
                data, tolerances, options.exclude,
                closed_loop=options.closed_loop, jobs=options.jobs, say=say, simulated=simulated,
            )  # fmt: skip
            if options.rig == "team" and (truth := _truth(options.rec)) is not None:
                found = against_truth(found, truth)
            if folder is not None:
                say("write")
                if found.estimates and "errors" in found.estimates:
                    made_with["files"] += [file_facts(truth_path(path)) for path in options.rec]
                found.write_into(folder, provenance=made_with)
    for path, converted in logs.converted.items():
        print(format_on_the_fly(converted, str(path)))
    print(found)  # after the folder is in place: whoever reads may close the pipe
    if options.out:
        print(f"\nWritten to {options.out}.")
    verdict = found.diagnosis.verdict
    if options.strict and verdict not in ("consistent", "explained"):
        raise NotGood(f"the verdict is {verdict.replace('_', ' ')}")


def _check(options: Diagnose, causes: Collection[str], inputs: Sequence[Path]) -> None:
    """Everything that can be refused before a recording is read."""
    if not options.rec and options.exclude:
        raise InputError("no recording given; name them before --exclude")
    if options.jobs < 1:
        raise InputError(f"jobs is {options.jobs}; it must be at least 1")
    check_recordings(options.rec)
    for name in options.exclude:
        if name not in causes:
            raise InputError(f"cause {name!r} does not exist; the causes are {', '.join(causes)}")
    if set(causes) <= set(options.exclude):
        raise InputError("every cause is excluded; nothing is left to look for")
    if options.out:
        check_folder(options.out, inputs, is_diagnosis, "an earlier diagnosis", force=options.force)
    if options.rig == "emps" and options.map is not None:
        raise InputError("--map is for logs of a team; the emps rig reads its benchmark's MAT file")
    if options.rig == "emps" and options.calibration is not None:
        raise InputError("--calibration is of a team's robots; the emps rig has none")
    if options.rig == "team":
        for path in options.rec:
            if path.suffix == ".mat":
                raise InputError(f"{path}: is a MAT file; --rig emps reads those of the EMPS benchmark")
    elif len(options.rec) > 1:
        raise InputError(
            f"{len(options.rec)} recordings are given; the emps rig takes one and cuts it into blocks that validate "
            "each other"
        )


def _read(paths: Sequence[Path], logs: Logs, robots: Robots) -> list[Recording]:
    recordings = []
    with bar(len(paths), "reading", "file") as advance:
        for path in paths:
            recordings.append(robots.of(logs.read(path)))
            advance(1)
    logs.check_map()
    return recordings


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


RIGS = {
    "team": _Rig(CAUSES, default_tolerances, _read, diagnose_team),
    "emps": _Rig(
        emps_causes.CAUSES,
        emps_catalogue.default_tolerances,
        lambda paths, *_: read_emps(paths[0]),
        diagnose_emps,
    ),
}
