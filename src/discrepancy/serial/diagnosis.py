"""Diagnose logs of one serial robot."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from discrepancy.engine.diagnose import Diagnosis, When, diagnose
from discrepancy.result.diagnosed import Diagnosed
from discrepancy.rules import serial as rules
from discrepancy.rules.inference import PRIOR_ODDS
from discrepancy.serial.catalogue import Tolerances
from discrepancy.serial.errors import with_errors
from discrepancy.serial.laws.rig import LawfulSerialRig
from discrepancy.serial.model import SerialModel
from discrepancy.serial.paired import PairedRig
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.rig import SerialRig
from discrepancy.serial.rolled.told import rolled_out
from discrepancy.serial.servo.loop import loop_laws, sentences
from discrepancy.serial.traces import traces
from discrepancy.serial.words import SerialWords


def diagnose_serial(
    model: SerialModel,
    logs: Sequence[JointLog],
    tolerances: Tolerances | None = None,
    excluded: Sequence[str] = (),
    *,
    reference: Sequence[JointLog] = (),
    laws: When = "auto",
    odds: float = PRIOR_ODDS,
    closed_loop: bool = True,
    jobs: int = 1,
    say: Callable[[str], object] | None = None,
) -> Diagnosed:
    """Find out what a model of a serial robot gets wrong.

    Args:
        model: the robot as described.
        logs: of its joints.
        tolerances: standard deviations by cause and parameter that are no news; None for the defaults.
        excluded: causes left out of the catalogue.
        reference: logs of the same robot while it was well: only what has changed since is news then, and tolerances
            do not count, and laws that no catalogue lists are not looked for.
        laws, odds, jobs, say: as of ``diagnose``.
        closed_loop: whether to roll the model out, freely and under its commands; this changes no verdict.

    Raises:
        InputError: a log cannot be used, or a cause to be excluded does not exist.
    """
    rig = LawfulSerialRig.of(model, logs, tolerances, excluded, reference)
    found = diagnose_rig(rig, laws=laws, odds=odds, jobs=jobs, say=say)
    judged = PairedRig(rig) if rig.common else rig
    rolled = None
    if closed_loop:
        if say:
            say("simulate")
        rolled = rolled_out(rig, found.explanation)
    words = SerialWords(rig.model, reference=bool(reference))
    return Diagnosed(judged, found, words, partial(traces, rig, found.explanation), rollouts=rolled)


def diagnose_rig(
    rig: SerialRig,
    *,
    laws: When = "auto",
    odds: float = PRIOR_ODDS,
    jobs: int = 1,
    say: Callable[[str], object] | None = None,
) -> Diagnosis:
    """The engine's diagnosis, with standard errors that allow for correlation, and notes on the logs.

    Args:
        rig: the logs.
        laws, odds, jobs, say: as of ``diagnose``.
    """
    judged = PairedRig(rig) if rig.common else rig
    found = diagnose(judged, most=rules.MOST_CAUSES, laws=laws, odds=odds, jobs=jobs, say=say)
    rows = max(2, round(rules.ERROR_BLOCK_S * rig.row_rate_hz(0)))
    explanation = with_errors(found.explanation, rows)
    read = [part.signals.log for part in rig.parts]
    notes = (*notes_of(read), *resting(read), *found.notes, *_notes(rig))
    return replace(found, explanation=explanation, notes=notes)


def notes_of(logs: Sequence[JointLog]) -> Iterator[str]:
    """Notes on logs; of those that differ in their numbers only, the first, and how many more there are."""
    alike: dict[str, list[str]] = {}
    for log in logs:
        for note in log.notes:
            alike.setdefault(re.sub(r"\d[\d.e+-]*", "#", note), []).append(f"{log.name}: {note}")
    for notes in alike.values():
        more = len(notes) - 1
        parts = f"{more} more part{'s' if more > 1 else ''} of the logs"
        yield notes[0] + (f" So it is, with other numbers, in {parts}." if more else "")


def resting(logs: Sequence[JointLog]) -> Iterator[str]:
    """What rests in all logs, of which they tell little."""
    still = np.ones(len(logs[0].joints), dtype=bool) if logs else np.zeros(0, dtype=bool)
    for log in logs:
        # White noise has second differences of six times its variance; of a motion they are small beside its size.
        noise = np.std(np.diff(log.q, 2, axis=0), axis=0) / np.sqrt(6.0)
        still &= np.std(log.q, axis=0) <= np.maximum(rules.RESTS * noise, log.position_step)
    names = [name for name, rests in zip(logs[0].joints, still, strict=True) if rests] if logs else []
    if names and still.all():
        yield "No joint moves in these logs; they tell no friction and no inertia, and gravity in one pose only."
    elif names:
        which = f"{', '.join(names[:-1])} and {names[-1]} do" if len(names) > 1 else f"{names[0]} does"
        yield f"{which} not move in these logs, which tell no friction and no rotor there."


def _notes(rig: SerialRig) -> Iterator[str]:
    for motor in rig.motors:
        yield motor.sentence(rig.model.joints[motor.joint])
    yield from sentences(loop_laws([part.signals.log for part in rig.parts]), rig.model.joints)
    if rig.common:
        yield (
            "What is wrong with the model in the reference, too, is fitted to all logs together and is no news; what "
            "is named has changed."
        )
    share = float(np.sqrt(np.mean(rig.level**2)))
    if share < 0.99:
        yield (
            "Noise (what counts as 1 in chi2/n) is that of the sensors, read off where nothing moves; all causes of "
            f"the catalogue together, each at will, would leave {1.0 / share:.1f} times as much."
        )
