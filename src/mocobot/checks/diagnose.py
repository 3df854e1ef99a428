"""What ``mocobot diagnose`` refuses at once."""

from collections.abc import Sequence
from pathlib import Path

from discrepancy.cause_names import emps, serial, team
from discrepancy.causes.excluded import excluded_from
from discrepancy.inference.odds import check_odds
from estimator.errors import InputError
from estimator.strict import read_json
from estimator.written import holds
from mocobot.files.targets import (
    calibration_file,
    check_folder,
    check_formats,
    check_no_team,
    check_recordings,
    check_there,
    map_file,
)
from mocobot.options import Diagnose
from mocobot_sim.trial.sidecar import truth_path

CAUSES = {"team": team.NAMES, "emps": emps.NAMES}
"""Names of causes by rig."""
TRUTH = "the truth beside a simulated recording"


def check(options: Diagnose) -> None:
    """Everything that can be refused before a recording is read.

    Raises:
        InputError: an option or an output that cannot be met, or a missing file.
    """
    if not options.rec and options.exclude:
        raise InputError("no recording given; name them before --exclude")
    if options.jobs < 1:
        raise InputError(f"jobs is {options.jobs}; it must be at least 1")
    check_odds(options.odds)
    check_recordings(options.rec)
    if options.model is not None:
        _check_joints(options, options.model)
        return
    if options.reference:
        raise InputError("--reference goes with --model: a healthy log of the same robot")
    if options.out is not None:
        inputs = [*options.rec, *([options.tolerances] if options.tolerances else []), *map_file(options.map)]
        inputs += calibration_file(options.calibration)
        check_folder(options.out, inputs, holds("diagnosis"), "an earlier diagnosis", force=options.force)
    _check_rig(options)
    _check_excluded(options.exclude, CAUSES[options.rig])
    check_there(options.rec)
    if options.rig == "team":
        check_formats(options.rec)
        for path in filter(Path.exists, map(truth_path, options.rec)):
            read_json(path, TRUTH)  # what it says, nobody asks before the verdict


def _check_joints(options: Diagnose, model: Path) -> None:
    """What can be refused of logs of one robot's joints, but for maps that nobody named."""
    if options.rig != "team":
        raise InputError(f"--model and --rig {options.rig} are both given; choose one")
    check_no_team(options, ("calibration", "scheduler"))
    logs = [*options.rec, *options.reference]
    check_recordings(logs)
    if options.out is not None:
        inputs = [*logs, model, *([options.tolerances] if options.tolerances else [])]
        inputs += [Path(options.map)] if options.map is not None else []
        check_folder(options.out, inputs, holds("diagnosis"), "an earlier diagnosis", force=options.force)
    _check_excluded(options.exclude, serial.NAMES)
    check_there([*logs, model])
    check_formats(logs)


def _check_rig(options: Diagnose) -> None:
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


def _check_excluded(excluded: Sequence[str], causes: Sequence[str]) -> None:
    excluded_from(causes, excluded)
    if set(causes) <= set(excluded):
        raise InputError("every cause is excluded; nothing is left to look for")
