"""Diagnose one recording of the axis."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from discrepancy import rules
from discrepancy.causes.numbers import number
from discrepancy.emps.catalogue import Tolerances
from discrepancy.emps.laws.rig import LawfulEmpsRig
from discrepancy.emps.recording.axis_log import AxisLog
from discrepancy.emps.rig import EmpsRig
from discrepancy.emps.traces import traces
from discrepancy.emps.words import EmpsWords
from discrepancy.engine.block_errors import with_block_errors
from discrepancy.engine.diagnose import Diagnosis, When, diagnose
from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.block_errors import block_covariance, part_of
from discrepancy.least_squares.fit import Fit
from discrepancy.result.diagnosed import Diagnosed


def diagnose_emps(
    log: AxisLog,
    tolerances: Tolerances | None = None,
    excluded: Sequence[str] = (),
    *,
    closed_loop: bool = True,
    laws: When = "auto",
    odds: float = rules.PRIOR_ODDS,
    jobs: int = 1,
    say: Callable[[str], object] | None = None,
    simulated: Callable[[int], object] | None = None,
) -> Diagnosed:
    """Check a recording, and find out what the nominal axis gets wrong.

    Args:
        log: the recording.
        tolerances: standard deviations by cause and parameter; None for the defaults.
        excluded: causes left out of the catalogue.
        closed_loop, laws, odds, jobs, say, simulated: as of ``diagnose``.

    Raises:
        InputError: the recording cannot be used, or a cause to be excluded does not exist.
    """
    rig = LawfulEmpsRig.of(log, tolerances, excluded)
    found = diagnose_axis(
        rig, closed_loop=closed_loop, laws=laws, odds=odds, jobs=jobs, say=say, simulated=simulated
    )
    return Diagnosed(rig, found, EmpsWords(), partial(traces, rig, found.explanation))


def diagnose_axis(
    rig: EmpsRig,
    *,
    closed_loop: bool = True,
    laws: When = "auto",
    odds: float = rules.PRIOR_ODDS,
    jobs: int = 1,
    say: Callable[[str], object] | None = None,
    simulated: Callable[[int], object] | None = None,
) -> Diagnosis:
    """The engine's diagnosis, with standard errors that allow for correlation, and notes on the recording.

    Args:
        rig: the recording.
        closed_loop, laws, odds, jobs, say, simulated: as of ``diagnose``.
    """
    found = diagnose(
        rig, closed_loop=closed_loop, laws=laws, odds=odds, jobs=jobs, say=say, simulated=simulated
    )
    explanation = with_block_errors(found.explanation, block_rows(rig))
    notes = (*rig.log.notes, *found.notes, _noise(rig), *_loop(rig, found.explanation))
    return replace(found, explanation=explanation, notes=notes)


def block_rows(rig: EmpsRig) -> int:
    """Rows in a block of the standard errors."""
    return round(rules.ERROR_BLOCK_S * rig.row_rate_hz(0))


def also_fitted(
    rig: EmpsRig, explanation: Explanation, causes: tuple[str, ...]
) -> dict[str, tuple[float, float]]:
    """Value and standard error of the first parameter of further causes, fitted together with the named ones.

    Args:
        rig: the recording.
        explanation: what was found.
        causes: names; those of the catalogue's that are left out are missing in the answer.
    """
    problem = explanation.problem
    by_name = {c.cause: k for k, c in enumerate(problem.candidates) if not c.transient}
    wanted = {name: by_name[name] for name in causes if name in by_name}
    fit = Fit.of(problem, tuple(dict.fromkeys([*explanation.fit.free, *wanted.values()])))
    covariance = block_covariance(fit, block_rows(rig))
    out = {}
    for name, index in wanted.items():
        unit = float(problem.candidates[index].units[0])
        se = np.sqrt(part_of(fit, covariance, index)[0, 0])
        out[name] = float(fit.part(index)[0][0]) * unit, float(se) * unit
    return out


def _noise(rig: EmpsRig) -> str:
    if rig.noise.repeats:
        return (
            f"Noise (what counts as 1 in chi2/n) is what differs between {rig.noise.repeats} cycles of the same "
            "motion, so chi2/n above 1 is something that repeats."
        )
    return (
        "The motion does not repeat, so noise (what counts as 1 in chi2/n) is what the whole catalogue leaves; "
        "something that no cause of it describes would not show in chi2/n."
    )


def _loop(rig: EmpsRig, explanation: Explanation) -> Iterator[str]:
    """What the data say of the loop's gains, and of pulses where none are named."""
    also = also_fitted(rig, explanation, ("position_gain", "velocity_gain"))
    if len(also) == 2:
        nominal = (rig.log.kp_per_s, rig.log.kv_Vs_per_m)
        kp, kv = (number(n + also[k][0], also[k][1], "") for n, k in zip(nominal, also, strict=True))
        yield (
            f"The loop's gains, fitted with the rest: kp = {kp} 1/s and kv = {kv} V s/m (nominal {nominal[0]:g} and "
            f"{nominal[1]:g})."
        )
    named = {found.candidate.cause for found in explanation.found}
    pulses = also_fitted(rig, explanation, ("injected_voltage",))
    if "injected_voltage" not in named and pulses:
        size = number(*pulses["injected_voltage"], "mV", 1e3)
        yield f"No pulses: the train of rectangles that fits the voltage best has {size}."
