"""``mocobot diagnose --rig emps``: read one recording of the axis, find out what its model gets wrong, write it."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import asdict
from typing import TYPE_CHECKING

from discrepancy.causes.tolerances_file import read_tolerances
from discrepancy.emps.catalogue import default_tolerances
from discrepancy.emps.causes import CAUSES
from discrepancy.emps.diagnosis import diagnose_axis
from discrepancy.emps.recording.reader import read_emps
from discrepancy.emps.rig import EmpsRig
from discrepancy.emps.traces import traces
from discrepancy.emps.words import EmpsWords
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.result.text import format_diagnosis
from estimator.errors import InputError
from estimator.files import whole_folder
from mocobot.commands.diagnose_folder import check_options, write_diagnosis
from mocobot.files.provenance import provenance
from mocobot.progress import stages

if TYPE_CHECKING:
    from mocobot.options import Diagnose


def run(options: Diagnose) -> None:
    """Run the command.

    Raises:
        InputError: the recording, tolerances or options cannot be used, or an output cannot be written.
    """
    check_options(options, CAUSES)
    if len(options.rec) > 1:
        raise InputError(
            f"{len(options.rec)} recordings are given; the emps rig takes one and cuts it into blocks that validate "
            "each other"
        )
    tolerances = read_tolerances(options.tolerances, default_tolerances())
    with whole_folder(options.out) if options.out else nullcontext() as folder, stages() as (say, advance):
        say("read")
        log = read_emps(next(iter(options.rec)))
        inputs = [*options.rec, *([options.tolerances] if options.tolerances else [])]
        made_with = provenance("diagnose", asdict(options), inputs) if folder else {}
        rig = EmpsRig.of(log, tolerances, options.exclude)
        diagnosis = diagnose_axis(
            rig, closed_loop=options.closed_loop, jobs=options.jobs, say=say, simulated=advance
        )
        values = diagnosis_to_dict(diagnosis, rig, EmpsWords())
        if folder is not None:
            say("write")
            values["provenance"] = made_with
            shown = (rig, diagnosis.explanation)
            write_diagnosis(folder, values, diagnosis, rig, EmpsWords(), lambda: traces(*shown))
    print(format_diagnosis(values))  # after the folder is in place: whoever reads may close the pipe
    if options.out:
        print(f"\nWritten to {options.out}.")
