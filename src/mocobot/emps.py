"""The EMPS benchmark's axis: diagnose its recordings, and measure what every cause is worth (docs/emps.md)."""

from collections.abc import Callable, Collection, Iterable
from pathlib import Path

from discrepancy.causes.tolerances_file import read_tolerances
from discrepancy.emps.catalogue import default_tolerances
from discrepancy.emps.diagnosis import diagnose_emps
from discrepancy.emps.recording.reader import read_emps
from discrepancy.emps.rig import EmpsRig
from discrepancy.emps.staircase import Step, format_staircase
from discrepancy.emps.staircase import staircase as stairs
from discrepancy.engine.diagnose import When
from discrepancy.result.diagnosed import Diagnosed
from estimator.errors import InputError
from mocobot.api.diagnosis import Diagnosis

__all__ = ["Step", "diagnose", "format_staircase", "staircase"]


def diagnose(
    recording: Path | str,
    *,
    tolerances: Path | str | None = None,
    exclude: Iterable[str] = (),
    closed_loop: bool = True,
    laws: When = "auto",
    jobs: int = 1,
    say: Callable[[str], object] = lambda _: None,
    simulated: Callable[[int], object] | None = None,
) -> Diagnosis:
    """Find out what a mass without friction gets wrong about the axis.

    Args:
        recording: MAT file; it is cut into blocks that validate each other.
        tolerances, exclude, closed_loop, laws, jobs, say, simulated: as of ``mocobot.diagnose``.

    Raises:
        InputError: recording, tolerances or causes that cannot be used.
    """
    known = read_tolerances(Path(tolerances) if tolerances is not None else None, default_tolerances())
    found = diagnose_emps(
        read_emps(Path(recording)), known, tuple(exclude),
        closed_loop=closed_loop, laws=laws, jobs=jobs, say=say, simulated=simulated,
    )  # fmt: skip
    return Diagnosis(found)


def staircase(
    diagnosis: Diagnosis, other: Diagnosis | None = None, different: Collection[str] = ()
) -> list[Step]:
    """Errors of the nominal axis, and with each named cause added in the order of discovery.

    Args:
        diagnosis: of one recording.
        other: of a second one, held out: it is predicted with the causes of the first.
        different: names of causes that the second has of its own, such as ``"injected_voltage"``.

    Raises:
        InputError: a diagnosis is not one of the axis.
    """
    elsewhere = None
    if other is not None:
        own = [
            (f.candidate, f.values) for f in other.found.diagnosis.causes if f.candidate.cause in different
        ]
        elsewhere = _axis(other), own
    return stairs(_axis(diagnosis), diagnosis.found.diagnosis.explanation, elsewhere)


def _axis(diagnosis: Diagnosis) -> EmpsRig:
    if not isinstance(diagnosis.found, Diagnosed) or not isinstance(diagnosis.found.rig, EmpsRig):
        raise InputError("the diagnosis is not one of the EMPS axis")
    return diagnosis.found.rig
