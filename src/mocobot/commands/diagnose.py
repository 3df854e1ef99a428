"""``mocobot diagnose``: read recordings, find out what the simulation gets wrong, report and write it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discrepancy.result.diagnosed import Diagnosed
from discrepancy.team.causes import CAUSES
from discrepancy.team.diagnosis import against_truth, diagnose_team
from discrepancy.team.tolerances import read_tolerances
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from mocobot.commands.diagnose_folder import Count, Say, check_options, diagnose_and_tell
from mocobot.progress import bar
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

    def diagnosed(recordings: list[Recording], say: Say, simulated: Count) -> Diagnosed:
        found = diagnose_team(
            recordings, tolerances, options.exclude,
            closed_loop=options.closed_loop, jobs=options.jobs, say=say, simulated=simulated,
        )  # fmt: skip
        truth = _truth(options.rec)
        return found if truth is None else against_truth(found, truth)

    diagnose_and_tell(options, lambda: _read(options.rec), diagnosed)


def _read(paths: Sequence[Path]) -> list[Recording]:
    recordings = []
    with bar(len(paths), "reading", "file") as advance:
        for path in paths:
            recordings.append(read_recording(path))
            advance(1)
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
