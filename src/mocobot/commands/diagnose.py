"""``mocobot diagnose``: read recordings, find out what the simulation gets wrong, report and write it."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Any

from discrepancy.cause_names import read_tolerances
from discrepancy.team.causes import default_tolerances
from discrepancy.team.diagnosis import against_truth, diagnose_team
from estimator.errors import InputError
from estimator.files import whole_folder
from estimator.recording.model import Recording
from estimator.strict import read_json
from mocobot.api.given import Logs, Robots
from mocobot.checks import TRUTH
from mocobot.cluster import workers_of
from mocobot.commands import diagnose_joints
from mocobot.files.provenance import file_facts, provenance
from mocobot.files.targets import calibration_file, map_file
from mocobot.options import Diagnose
from mocobot.progress import bar, stages
from mocobot.strict import NotGood
from mocobot_logs.convert_report import format_on_the_fly
from mocobot_sim.trial.truth import truth_path


def run(options: Diagnose) -> None:
    """Run the command.

    Raises:
        InputError: recordings, tolerances or options that cannot be used, or an output that cannot be written.
        NotGood: with ``strict``, the verdict is neither consistent nor explained.
    """
    if options.model is not None:
        diagnose_joints.run(options, options.model)
        return
    inputs = [*options.rec, *([options.tolerances] if options.tolerances else []), *map_file(options.map)]
    inputs += calibration_file(options.calibration)
    logs, robots = Logs(options.map), Robots(options.calibration)
    tolerances = read_tolerances(options.tolerances, default_tolerances())
    with whole_folder(options.out, "diagnosis") if options.out else nullcontext() as folder:
        data = _read(options.rec, logs, robots)
        made_with = provenance("diagnose", asdict(options), inputs) if folder else {}
        with workers_of(options.scheduler), stages() as (say, simulated):
            found = diagnose_team(
                data, tolerances, options.exclude,
                closed_loop=options.closed_loop, laws=options.laws, odds=options.odds, jobs=options.jobs, say=say,
                simulated=simulated, whole=options.whole, seconds=options.seconds,
            )  # fmt: skip
            if (truth := _truth(options.rec)) is not None:
                found = against_truth(found, truth)
            if folder is not None:
                say("write")
                if found.errors is not None:
                    made_with["files"] += [file_facts(truth_path(path)) for path in options.rec]
                found.write_into(folder, provenance=made_with)
    for path, converted in logs.converted.items():
        print(format_on_the_fly(converted, str(path)))
    print(
        found.verbose_text() if options.verbose else found
    )  # after the folder is in place: whoever reads may close the pipe
    if options.out:
        print(f"\nWritten to {options.out}.")
    verdict = found.to_dict()["verdict"]
    if options.strict and verdict not in ("consistent", "explained"):
        raise NotGood(f"the verdict is {verdict.replace('_', ' ')}")


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
            values = read_json(truth_path(path), TRUTH)
            found.append({key: values[key] for key in keys} | {"as_built": values.get("as_built")})
        except (InputError, KeyError):
            return None
    return found[0] if all(values == found[0] for values in found) else None
