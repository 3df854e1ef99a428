"""The estimate of a payload in one fit of loops and balance, the robots held as they are said to be."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.calibration import CalibratedPayload
from estimator.calibrate.equations.level import corrected
from estimator.calibrate.equations.rows import Rows
from estimator.calibrate.equations.sensing import Resolution, Sensing
from estimator.calibrate.fit import Fit, fit
from estimator.calibrate.outcome.estimate import Asked, with_payload
from estimator.calibrate.prior import Prior
from estimator.calibrate.problem import Trial
from estimator.calibrate.unknowns import Unknowns
from estimator.errors import InputError
from estimator.estimate import consistency
from estimator.estimate.joint import estimate_joint
from estimator.estimate.payload import (
    estimate_from_trials,
    estimate_payload,
    trial_of,
    within_arithmetic,
)
from estimator.estimate.principal import inertia_parameters
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.withheld import withheld
from estimator.recording.model import Recording
from estimator.rigid_team.residual import Shared, robot_data, start_bases

METHOD = "fit"
WITHOUT_ERRORS = (
    "The recordings carry the calibration of their robots without its errors, so that standard errors lack them; an "
    "estimate with the calibration itself (--calibration) has them."
)
_HELD = Prior().scaled(0.0)
_LEAST_ROWS = 8


class _CannotBe(Exception):
    """Why one fit cannot be made."""


@dataclass(frozen=True, eq=False)
class _Read:
    """What of one recording goes into the fit; ``why_not`` where it cannot."""

    design: OmnidDesign
    rows: Rows | None
    resolution: Resolution
    why_not: str

    @classmethod
    def of(cls, recording: Recording) -> _Read:
        rows, why = None, ""
        try:
            rows = Rows.of(recording)
        except InputError as error:
            why = str(error)
        if rows is not None and len(rows.time) < _LEAST_ROWS:
            why = f"{recording.name} is too short for it"
        return cls(recording.metadata.design, rows, Resolution.of(recording), why)


def estimate(
    recordings: Iterable[Recording],
    method: Asked = "auto",
    cutoff_hz: float = 5.0,
    say: Callable[[str], object] = lambda _: None,
) -> PayloadEstimate:
    """Estimate grasps, mass, centre of mass and inertia from recordings of one payload.

    Args:
        recordings: one or several trials with the same robots and grasps, taken one after the other.
        method: ``"fit"``, one least squares of closed loops and balance of wrenches, the robots held; ``"staged"`` and
            ``"joint"`` as in ``estimate_payload``; ``"auto"``, the fit where the recordings determine the centre of
            mass and nothing but noise is left, else as ``estimate_payload`` has it, for what is no noise moves the fit
            further.
        cutoff_hz: cut-off of the low-pass filter for what the fit does not do [Hz].
        say: takes the name of the stage that begins.

    Raises:
        InputError: as ``estimate_payload``, or a fit was asked for and cannot be made.
    """
    if method not in ("auto", METHOD):
        return _said(estimate_payload(recordings, method, cutoff_hz, say=say))
    names: list[str] = []
    trials: list[consistency.Trial] = []
    read: list[_Read] = []
    with within_arithmetic(names):
        for recording in recordings:
            names.append(recording.name)
            trials.append(trial_of(recording, cutoff_hz))
            read.append(_Read.of(recording))
            del recording  # or the next one would be read before this one is let go
        staged = estimate_from_trials(trials, "auto", say=say, withhold=False)
    team = max(trial.team for trial in trials)
    say("one fit")
    try:
        found = _fitted(staged, trials, read)
        if method == "auto":
            _check_noise(found, names)
    except (_CannotBe, InputError, np.linalg.LinAlgError) as error:
        if method == METHOD:
            raise InputError(f"{', '.join(names)}: no fit of loops and balance ({error})") from error
        why = f"{staged.method.capitalize()}, and not in one fit of loops and balance: {error}."
        return _said(replace(withheld(staged, team), why_not_fit=why))
    of = found.layout.of_payload(0)
    shared, covariance = found.unknowns.carried[0], found.covariance[of, of]
    grasped = 6 * (staged.robots - 1)
    grasps = replace(shared.grasps, covariance=covariance[:grasped, :grasped])
    payload = CalibratedPayload(staged.payload, grasps, shared.pi, covariance, found.by_scale[of])
    return _said(withheld(replace(with_payload(staged, trials, payload, 0.0), method=METHOD), team))


def _said(estimate: PayloadEstimate) -> PayloadEstimate:
    """With what a reader must know of robots that the recordings know."""
    return estimate if estimate.units is None else replace(estimate, open=(*estimate.open, WITHOUT_ERRORS))


def _fitted(staged: PayloadEstimate, trials: Sequence[consistency.Trial], read: Sequence[_Read]) -> Fit:
    """The fit, from where the staged estimate is."""
    if staged.robots < 2:
        raise _CannotBe("one robot closes no loop")
    grasps, mass, c, inertia = staged.grasps, staged.mass, staged.p_1c, staged.inertia
    if grasps is None or mass is None or c is None:
        parts = {"grasps": grasps, "mass": mass, "centre of mass": c}
        missing = next(name for name, part in parts.items() if part is None)
        raise _CannotBe(f"these recordings do not determine the {missing}")
    if staged.units is None and any(trial.units is not None for trial in trials):
        raise _CannotBe("the recordings say different things of their robots")
    units = staged.units or ArmUnit(read[0].design, np.zeros((staged.robots, COUNT)))
    if inertia is None:  # the fit leaves it as open as the recordings do
        pi = estimate_joint([trial.data for trial in trials], grasps)[0].parameters
    else:
        about_1 = inertia.inertia + mass.mass * (c @ c * np.eye(3) - np.outer(c, c))
        pi = np.concatenate([[mass.mass], mass.mass * c, inertia_parameters(about_1)])
    shared = Shared(grasps, pi)
    parts, bases = [], []
    for one, sensing in zip(read, Sensing.of_each([one.resolution for one in read]), strict=True):
        if one.rows is None or one.why_not:
            raise _CannotBe(one.why_not)
        parts.append(Trial(one.rows, 0, sensing))
        data = robot_data(corrected(one.rows(one.rows.s), units), units)
        bases.append(start_bases(data.R_bi, data.h, shared))
    return fit(parts, Unknowns(units, (shared,), tuple(bases)), _HELD, held=True)


def _check_noise(found: Fit, names: Sequence[str]) -> None:
    """Whether noise is all that the fit leaves."""
    left = [
        (part.ratio, name, what)
        for name, trial in zip(names, found.trials, strict=True)
        for part, what in ((trial.loops, "loops"), (trial.balance, "balance"))
        if part.misfits
    ]
    if left:
        ratio, name, what = max(left)
        raise _CannotBe(
            f"that leaves more than noise, to which it is more sensitive (chi2/n is {ratio:.3g} in the {what} of "
            f"{name})"
        )
    if not found.converged:
        raise _CannotBe("that does not settle")
