"""What every rig's diagnosis has in common at the edge: options refused early, the result's folder, what is printed."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import nullcontext
from dataclasses import asdict
from typing import TYPE_CHECKING, TypeVar

from discrepancy.result.diagnosed import Diagnosed, is_diagnosis
from estimator.errors import InputError
from estimator.files import whole_folder
from mocobot.files.provenance import file_facts, provenance
from mocobot.files.targets import check_folder, check_recordings
from mocobot.progress import stages
from mocobot_sim.trial.truth import truth_path

if TYPE_CHECKING:
    from mocobot.options import Diagnose

Data = TypeVar("Data")
Say = Callable[[str], object]
Count = Callable[[int], object]


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
        check_folder(options.out, inputs, is_diagnosis, "an earlier diagnosis")


def diagnose_and_tell(
    options: Diagnose, read: Callable[[], Data], diagnosed: Callable[[Data, Say, Count], Diagnosed]
) -> None:
    """Read, diagnose, write if asked, and print the report.

    Args:
        options: checked.
        read: reads what is to be diagnosed.
        diagnosed: diagnoses it; takes the functions that are told of the progress, too.

    Raises:
        InputError: as of both, or the output cannot be written.
    """
    with whole_folder(options.out) if options.out else nullcontext() as folder:
        data = read()
        inputs = [*options.rec, *([options.tolerances] if options.tolerances else [])]
        made_with = provenance("diagnose", asdict(options), inputs) if folder else {}
        with stages() as (say, simulated):
            found = diagnosed(data, say, simulated)
            if folder is not None:
                say("write")
                if found.estimates and "errors" in found.estimates:
                    made_with["files"] += [file_facts(truth_path(path)) for path in options.rec]
                found.write_into(folder, provenance=made_with)
    print(found)  # after the folder is in place: whoever reads may close the pipe
    if options.out:
        print(f"\nWritten to {options.out}.")
