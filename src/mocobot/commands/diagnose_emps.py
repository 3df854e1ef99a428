"""``mocobot diagnose --rig emps``: read one recording of the axis, find out what its model gets wrong, write it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from discrepancy.causes.tolerances_file import read_tolerances
from discrepancy.emps.catalogue import default_tolerances
from discrepancy.emps.causes import CAUSES
from discrepancy.emps.diagnosis import diagnose_emps
from discrepancy.emps.recording.axis_log import AxisLog
from discrepancy.emps.recording.reader import read_emps
from discrepancy.result.diagnosed import Diagnosed
from estimator.errors import InputError
from mocobot.commands.diagnose_folder import Count, Say, check_options, diagnose_and_tell

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

    def diagnosed(log: AxisLog, say: Say, simulated: Count) -> Diagnosed:
        return diagnose_emps(
            log, tolerances, options.exclude,
            closed_loop=options.closed_loop, jobs=options.jobs, say=say, simulated=simulated,
        )  # fmt: skip

    diagnose_and_tell(options, lambda: read_emps(next(iter(options.rec))), diagnosed)
