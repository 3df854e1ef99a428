"""Diagnose one recording of the axis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from discrepancy.block_errors import with_block_errors
from discrepancy.diagnose import Diagnosis, diagnose
from discrepancy.emps.rig import EmpsRig

MOST_CAUSES = 8
"""The nominal axis is a bare mass: mass, friction of several kinds and the loop's details are all left out of it."""
BLOCK_S = 1.0
"""Blocks of the standard errors: what is left is correlated over a few tenths of a second."""


def diagnose_axis(
    rig: EmpsRig,
    *,
    closed_loop: bool = True,
    jobs: int = 1,
    say: Callable[[str], object] | None = None,
    simulated: Callable[[int], object] | None = None,
) -> Diagnosis:
    """The engine's diagnosis, with standard errors that allow for correlation, and notes on the recording.

    Args:
        rig: the recording.
        closed_loop, jobs, say, simulated: as of ``diagnose``.
    """
    found = diagnose(rig, closed_loop=closed_loop, most=MOST_CAUSES, jobs=jobs, say=say, simulated=simulated)
    explanation = with_block_errors(found.explanation, round(BLOCK_S * rig.row_rate_hz(0)))
    if rig.noise.repeats:
        noise = (
            f"Noise (what counts as 1 in chi2/n) is what differs between {rig.noise.repeats} cycles of the same "
            "motion, so chi2/n above 1 is something that repeats."
        )
    else:
        noise = (
            "The motion does not repeat, so noise (what counts as 1 in chi2/n) is what the whole catalogue leaves; "
            "something that no cause of it describes would not show in chi2/n."
        )
    return replace(found, explanation=explanation, notes=(*rig.log.notes, *found.notes, noise))
