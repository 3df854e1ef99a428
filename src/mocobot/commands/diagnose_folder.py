"""What every rig's diagnosis has in common at the edge: options that can be refused early, and the result's folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discrepancy.causes.words import Words
from discrepancy.engine.diagnose import Diagnosis
from discrepancy.result.plots import PLOTS, save_plots
from discrepancy.result.read import FORMAT
from discrepancy.result.text import format_diagnosis
from discrepancy.result.traces import Trace
from discrepancy.result.traces_file import NAME as RESIDUALS
from discrepancy.result.traces_file import save_traces
from discrepancy.rig import Rig
from estimator.errors import InputError
from estimator.files import write_json, write_text
from mocobot.files.targets import check_folder, check_recordings

if TYPE_CHECKING:
    from mocobot.options import Diagnose

JSON, REPORT, EXTENDED, PAGE = "diagnosis.json", "report.txt", "extended", "report.html"


def check_options(options: Diagnose, causes: Collection[str]) -> None:
    """Everything that can be refused before a recording is read.

    Raises:
        InputError: no recording or one twice, a number of processes, a cause that does not exist, or an output that
            would overwrite something else.
    """
    if not options.rec:
        hint = "; name them before --exclude" if options.exclude else "; name at least one file"
        raise InputError(f"no recording given{hint}")
    if options.jobs < 1:
        raise InputError(f"jobs is {options.jobs}; it must be at least 1")
    check_recordings(options.rec)
    for name in options.exclude:
        if name not in causes:
            raise InputError(f"cause {name!r} does not exist; the causes are {', '.join(causes)}")
    if set(causes) <= set(options.exclude):
        raise InputError("every cause is excluded; nothing is left to look for")
    if options.out:
        inputs = [*options.rec, *([options.tolerances] if options.tolerances else [])]
        check_folder(options.out, inputs, _is_diagnosis, "an earlier diagnosis")


def _is_diagnosis(folder: Path) -> bool:
    """Whether a folder holds a diagnosis and nothing that someone else put there."""
    try:
        ours = json.loads((folder / JSON).read_text(encoding="utf-8"))["format"] == FORMAT
    except (OSError, ValueError, TypeError, KeyError):
        return False
    known = [JSON, REPORT, RESIDUALS, EXTENDED, PAGE, *PLOTS]
    return ours and all(any(path.match(pattern) for pattern in known) for path in folder.iterdir())


def write_diagnosis(
    folder: Path,
    values: dict[str, Any],
    diagnosis: Diagnosis,
    rig: Rig,
    words: Words,
    traces: Callable[[], Sequence[Trace]],
) -> None:
    """Write extended model, residuals, pictures, JSON and report into an existing folder.

    Args:
        folder: where.
        values: the diagnosis as in the JSON; a note is added where there is no extended model.
        diagnosis: the verdict.
        rig: what was diagnosed.
        words: of the rig.
        traces: makes the residuals for file and pictures.
    """
    if diagnosis.causes:
        try:
            rig.write_extended(diagnosis.explanation, folder / EXTENDED)
        except InputError as error:  # values that no effect can have, such as a negative friction
            values["notes"].append(f"There is no extended model: {error}.")
    residuals = traces()
    save_traces(residuals, rig.channels, folder / RESIDUALS)
    save_plots(values, residuals, rig.channels, words, folder)
    write_json(folder / JSON, values)
    write_text(folder / REPORT, format_diagnosis(values) + "\n")
