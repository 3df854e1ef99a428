"""Estimate a payload with one fit of closed loops and wrench balance, with the robots held.

``estimate`` makes this fit if the recordings allow it, otherwise the paper's stages or ``joint``. ``estimate_on``
holds the robots at an earlier calibration. ``estimate_calibrated`` returns the payload of a calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import inertia_parameters
from estimator.calibrate.calibrate import LEAST_ROWS, bases_of, calibrate
from estimator.calibrate.calibration import (
    CalibratedPayload,
    Calibration,
    Carried,
    calibrated,
    carried,
    grasps_of,
)
from estimator.calibrate.least_squares import CarriedTrial, Fit, Given, Unknowns, fit
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Resolution, Rows, Sensing
from estimator.errors import InputError
from estimator.estimate.consistency import Trial, withheld, wrench_balance
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import InertiaEstimate, about_origin
from estimator.estimate.joint import estimate_joint
from estimator.estimate.payload import (
    estimate_from_trials,
    estimate_payload,
    inertia_flags,
    trial_of,
    within_arithmetic,
)
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import MassEstimate
from estimator.recording.model import Recording
from estimator.rigid_team import Shared, fuse, inertia_regressor
from estimator.statistics import rms

ONE_FIT, CALIBRATED = "fit", "calibrated"
"""Methods of the estimates that this module makes."""
Asked = Literal["auto", "fit", "staged", "joint"]
"""Methods to request: the fit, a method of ``estimate_payload``, or the best available."""
WITHOUT_ERRORS = (
    "The recordings carry the calibration of their robots without its errors, so that standard errors lack them; an "
    "estimate with the calibration itself (--calibration) has them."
)


class _CannotBe(Exception):
    """Reason why the one fit is impossible."""


class _Read(NamedTuple):
    """Input of the fit from one recording; ``why_not`` is the reason if it is unusable."""

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
        if rows is not None and len(rows.time) < LEAST_ROWS:
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
        recordings: one or several trials with the same robots and grasps, consumed one at a time.
        method: ``"fit"``, one least squares of closed loops and wrench balance with the robots held; ``"staged"`` and
            ``"joint"`` as in ``estimate_payload``; ``"auto"``, the fit if the recordings determine the centre of mass
            and only noise remains. Otherwise ``"auto"`` is that of ``estimate_payload``, because model errors bias the
            fit more.
        cutoff_hz: cut-off of the low-pass filter for everything except the fit [Hz].
        say: callback for the name of each stage.

    Raises:
        InputError: as ``estimate_payload``, or the requested fit is impossible.
    """
    if method not in ("auto", ONE_FIT):
        return _said(estimate_payload(recordings, method, cutoff_hz, say=say))
    names: list[str] = []
    trials: list[Trial] = []
    read: list[_Read] = []
    with within_arithmetic(names):
        for recording in recordings:
            names.append(recording.name)
            trials.append(trial_of(recording, cutoff_hz))
            read.append(_Read.of(recording))
            del recording  # free its memory before reading the next one
        staged = estimate_from_trials(trials, "auto", say=say, withhold=False)
    team = max(trial.team for trial in trials)
    say("one fit")
    try:
        found = _fitted(staged, trials, read)
        if method == "auto":
            _check_noise(found, names)
    except (_CannotBe, InputError, np.linalg.LinAlgError) as error:
        if method == ONE_FIT:
            raise InputError(f"{', '.join(names)}: no fit of loops and balance ({error})") from error
        why = f"{staged.method.capitalize()}, and not in one fit of loops and balance: {error}."
        return _said(replace(withheld(staged, team), why_not_fit=why))
    fitted = _with_payload(staged, trials, found.payload(0, staged.payload), 0.0)
    return _said(withheld(replace(fitted, method=ONE_FIT), team))


def _said(estimate: PayloadEstimate) -> PayloadEstimate:
    """Add the caveat on standard errors if the recordings contain calibrated robots."""
    return estimate if estimate.units is None else replace(estimate, open=(*estimate.open, WITHOUT_ERRORS))


def _fitted(staged: PayloadEstimate, trials: Sequence[Trial], read: Sequence[_Read]) -> Fit:
    """Fit the payload, starting from the staged estimate."""
    if staged.robots < 2:
        raise _CannotBe("one robot closes no loop")
    grasps, mass, c = staged.grasps, staged.mass, staged.p_1c
    if grasps is None or mass is None or c is None:
        parts = {"grasps": grasps, "mass": mass, "centre of mass": c}
        missing = next(name for name, part in parts.items() if part is None)
        raise _CannotBe(f"these recordings do not determine the {missing}")
    if staged.units is None and any(trial.units is not None for trial in trials):
        raise _CannotBe("the recordings say different things of their robots")
    units = staged.units or ArmUnit(read[0].design, np.zeros((staged.robots, COUNT)))
    if staged.inertia is None:  # start from the joint estimate, however uncertain
        pi = estimate_joint([trial.data for trial in trials], grasps)[0].parameters
    else:
        pi = about_origin(mass.mass, c, staged.inertia.inertia)
    shared = Shared(grasps, pi)
    parts, bases = [], []
    for one, sensing in zip(read, Sensing.of_each([one.resolution for one in read]), strict=True):
        if one.rows is None or one.why_not:
            raise _CannotBe(one.why_not)
        parts.append(CarriedTrial(one.rows, 0, sensing))
        bases.append(bases_of(one.rows, units, shared))
    start = Unknowns(units, (shared,), tuple(bases))
    return fit(Given(parts, start, Prior().scaled(0.0), held=True))


def _check_noise(found: Fit, names: Sequence[str]) -> None:
    """Raise ``_CannotBe`` if the fit leaves more than noise or did not converge."""
    left = [
        (part.ratio, name, what)
        for name, trial in zip(names, found.point.trials, strict=True)
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


def estimate_calibrated(
    calibration: Calibration,
    recordings: Sequence[Recording],
    cutoff_hz: float = 5.0,
    say: Callable[[str], object] = lambda _: None,
) -> PayloadEstimate:
    """Return grasps, mass, centre of mass and inertia of a calibration, including errors of a held spring scale.

    Holds, contradictions between robots and remaining wrenches of each recording are evaluated with the calibrated
    arms. All results are in the calibration's frames.

    Args:
        calibration: made from these recordings, and possibly others.
        recordings: recordings of one of its payloads.
        cutoff_hz: cut-off of the low-pass filter for the evaluation of each recording [Hz].
        say: callback for the name of each stage.

    Raises:
        InputError: the recordings are of several payloads, or of one that the calibration does not contain.
    """
    payload = _payload_of(calibration, recordings)
    trials = [trial_of(calibrated(recording, calibration), cutoff_hz) for recording in recordings]
    staged = estimate_from_trials(trials, say=say, withhold=False)
    estimate = replace(
        _with_payload(staged, trials, payload, calibration.scale_sd),
        payload=payload.label,
        method=CALIBRATED,
        units=calibration.units,
        open=calibration.open,
        zero_sd_rad=calibration.zero_sd_rad,
    )
    estimate = replace(estimate, flags=(*calibration.findings, *estimate.flags))
    return withheld(estimate, max(trial.team for trial in trials))


def _with_payload(
    staged: PayloadEstimate, trials: Sequence[Trial], payload: CalibratedPayload, scale_sd: float
) -> PayloadEstimate:
    """Replace the numbers of a staged estimate by those of a fit, and re-evaluate what each recording leaves over."""
    numbers = carried(payload, scale_sd)
    grasps = _grasps(payload, scale_sd, staged)
    inertia = _inertia(trials, grasps, numbers)
    records = list(staged.recordings)
    for k, trial in enumerate(trials):
        force, moment = wrench_balance(trial.data, grasps, numbers.mass_kg, numbers.p_1c, inertia)
        records[k] = replace(records[k], force_residual=force, moment_residual_m=moment)
    before = inertia_flags(staged.inertia) if staged.inertia else []
    # The staged excitation does not apply to the fit; judge the inertia by the fit's own standard errors.
    steps = [
        inertia.judged(replace(step, weak=())) if step.step == "inertia" else step for step in staged.steps
    ]
    told = all(step.determined for step in steps if step.step == "inertia")
    after = inertia_flags(inertia) if told else []
    return replace(
        staged,
        grasps=grasps,
        mass=MassEstimate(numbers.mass_kg, numbers.mass_se_kg, _force_residual(records, numbers, trials)),
        p_1c=numbers.p_1c,
        p_1c_covariance=numbers.covariance[1:4, 1:4],
        inertia=inertia if told else None,
        steps=tuple(steps),
        recordings=tuple(records),
        flags=(*(flag for flag in staged.flags if flag not in before), *after),
    )


def estimate_on(
    calibration: Calibration,
    recordings: Sequence[Recording],
    method: Asked = "auto",
    cutoff_hz: float = 5.0,
    say: Callable[[str], object] = lambda _: None,
) -> PayloadEstimate:
    """Estimate a payload with robots held at an earlier calibration, and propagate its errors.

    Args:
        calibration: calibration of the same robots.
        recordings: recordings of one payload.
        method: ``"auto"``, the calibration's own least squares with the robots held if the recordings suffice,
            otherwise as in ``estimate_payload``; ``"fit"``, always the former; or a method of ``estimate_payload``.
        cutoff_hz: cut-off of the low-pass filter [Hz].
        say: callback for the name of each stage.

    Raises:
        InputError: the recordings are of several payloads or other robots, or as in ``estimate_payload``.
    """
    one_payload(recordings)
    known = [calibrated(recording, calibration) for recording in recordings]
    held: Calibration | None = None
    # Other methods may not need this fit, or report its errors themselves.
    with nullcontext() if method == "fit" else suppress(InputError):
        held = calibrate(known, robots=calibration, say=say)
    if held is not None and method in ("auto", "fit"):
        return estimate_calibrated(replace(held, open=calibration.open), known, cutoff_hz, say)
    method = "auto" if method == "fit" else method
    return _with_errors(estimate_payload(known, method, cutoff_hz, say=say), calibration, held)


def _with_errors(
    estimate: PayloadEstimate, calibration: Calibration, held: Calibration | None
) -> PayloadEstimate:
    """Add the covariance of a fit with held robots to that of an estimate.

    The added covariance includes the robots' errors and the noise of that fit, so standard errors are at most 1.4
    times too large.
    """
    estimate = replace(estimate, open=calibration.open, zero_sd_rad=calibration.zero_sd_rad)
    mass, grasps, inertia = estimate.mass, estimate.grasps, estimate.inertia
    if held is None:
        flag = (
            "Standard errors lack those of the robots' calibration: the recordings do not suffice for them."
        )
        return replace(estimate, flags=(*estimate.flags, flag))
    payload, numbers = held.payloads[0], carried(held.payloads[0], held.scale_sd)
    if grasps is not None:
        more = _grasps(payload, held.scale_sd, estimate).covariance
        grasps = replace(grasps, covariance=grasps.covariance + more)
    if mass is not None:
        mass = replace(mass, se=float(np.hypot(mass.se, numbers.mass_se_kg)))
    com = estimate.p_1c_covariance
    if com is not None:
        com = com + numbers.covariance[1:4, 1:4]
    if inertia is not None:
        inertia = InertiaEstimate.of(
            inertia_parameters(inertia.inertia),
            inertia.covariance + numbers.covariance[4:, 4:],
            inertia.residual_rms,
            inertia.moment_rms,
        )
    return replace(estimate, grasps=grasps, mass=mass, p_1c_covariance=com, inertia=inertia)


def one_payload(recordings: Sequence[Recording]) -> None:
    """Check that recordings are of one payload.

    Raises:
        InputError: they are of several.
    """
    first = recordings[0] if recordings else None
    for other in recordings[1:]:
        if first is not None and other.metadata.payload != first.metadata.payload:
            raise InputError(
                f"{other.name} is of payload {other.metadata.payload!r} and {first.name} of "
                f"{first.metadata.payload!r}; estimate one payload at a time"
            )


def _payload_of(calibration: Calibration, recordings: Sequence[Recording]) -> CalibratedPayload:
    labels = {recording.metadata.payload for recording in recordings}
    found = [payload for payload in calibration.payloads if {payload.label} == labels]
    if len(found) != 1:
        said = ", ".join(repr(payload.label) for payload in calibration.payloads)
        names = ", ".join(recording.name for recording in recordings)
        raise InputError(
            f"{names}: of payload {' and '.join(sorted(map(repr, labels)))}; the calibration has {said}, and an "
            "estimate is of one"
        )
    return found[0]


def _grasps(payload: CalibratedPayload, scale_sd: float, staged: PayloadEstimate) -> GraspEstimate:
    """Return the fit's frames, with the twist residuals of the staged estimate."""
    found, own = staged.grasps or payload.grasps, grasps_of(payload, scale_sd)
    return replace(found, R_1i=own.R_1i, p_1i=own.p_1i, covariance=own.covariance)


def _inertia(trials: Sequence[Trial], grasps: GraspEstimate, numbers: Carried) -> InertiaEstimate:
    left, explained = [], []
    parameters = inertia_parameters(numbers.inertia)
    for trial in trials:
        motion = fuse(trial.data, grasps)
        moment = inertia_regressor(motion.omega, motion.alpha) @ parameters
        explained.append(moment)
        left.append(motion.moment - np.cross(numbers.p_1c, motion.force) - moment)
    return InertiaEstimate.of(
        parameters, numbers.covariance[4:, 4:], rms(np.concatenate(left)), rms(np.concatenate(explained))
    )


def _force_residual(records: Sequence, numbers: Carried, trials: Sequence[Trial]) -> float:
    """Return the rms of the remaining forces over all recordings [N]."""
    count = np.array([trial.data.samples for trial in trials])
    share = np.array([record.force_residual for record in records])
    weight = numbers.mass_kg * trials[0].data.gravity_mps2
    return float(weight * np.sqrt(np.sum(count * share**2) / np.sum(count)))
