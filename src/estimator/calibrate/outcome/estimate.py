"""The estimate of a payload that a calibration found beside its robots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from typing import Literal

import numpy as np

from estimator.arrays import Array
from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import CalibratedPayload, Calibration
from estimator.calibrate.outcome.apply import calibrated
from estimator.calibrate.outcome.carried import Carried, carried, grasps_of
from estimator.errors import InputError
from estimator.estimate.consistency import Trial, wrench_balance
from estimator.estimate.fusion import fuse
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.inertia import InertiaEstimate, inertia_regressor
from estimator.estimate.payload import (
    estimate_from_trials,
    estimate_payload,
    inertia_flags,
    trial_of,
)
from estimator.estimate.principal import inertia_parameters
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import MassEstimate
from estimator.estimate.withheld import withheld
from estimator.recording.model import Recording
from estimator.statistics import rms

METHOD = "calibrated"
Asked = Literal["auto", "fit", "staged", "joint"]
"""What may be asked for: one fit of loops and balance, a method of ``estimate_payload``, or the best there is."""


def estimate_calibrated(
    calibration: Calibration,
    recordings: Sequence[Recording],
    cutoff_hz: float = 5.0,
    say: Callable[[str], object] = lambda _: None,
) -> PayloadEstimate:
    """Grasps, mass, centre of mass and inertia as the calibration found them, errors of a held spring scale included.

    What each recording says (holds, robots that contradict each other, wrenches left over) is judged with the
    calibrated arms. All is in the calibration's frames.

    Args:
        calibration: made from these recordings, and others perhaps.
        recordings: of one of its payloads.
        cutoff_hz: cut-off of the low-pass filter for what each recording says [Hz].
        say: takes the name of the stage that begins.

    Raises:
        InputError: the recordings are of several payloads, or of one that the calibration does not have.
    """
    payload = _payload_of(calibration, recordings)
    trials = [trial_of(calibrated(recording, calibration), cutoff_hz) for recording in recordings]
    staged = estimate_from_trials(trials, say=say, withhold=False)
    estimate = replace(
        with_payload(staged, trials, payload, calibration.scale_sd),
        payload=payload.label,
        method=METHOD,
        units=calibration.units,
        open=calibration.open,
        zero_sd_rad=calibration.zero_sd_rad,
    )
    estimate = replace(estimate, flags=(*calibration.findings, *estimate.flags))
    return withheld(estimate, max(trial.team for trial in trials))


def with_payload(
    staged: PayloadEstimate, trials: Sequence[Trial], payload: CalibratedPayload, scale_sd: float
) -> PayloadEstimate:
    """An estimate with its numbers from a fit of loops and balance, and what each recording leaves of them.

    Args:
        staged: of the same recordings.
        trials: these, processed.
        payload: what the fit found.
        scale_sd: standard deviation of a held common spring scale.
    """
    numbers = carried(payload, scale_sd)
    grasps = _grasps(payload, scale_sd, staged)
    inertia = _inertia(trials, grasps, numbers)
    records = list(staged.recordings)
    for k, trial in enumerate(trials):
        force, moment = wrench_balance(trial.data, grasps, numbers.mass_kg, numbers.p_1c, inertia)
        records[k] = replace(records[k], force_residual=force, moment_residual_m=moment)
    before = inertia_flags(staged.inertia) if staged.inertia else []
    # What a least squares of twists would not tell apart from noise says nothing of the fit: its errors do.
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
    """Estimate a payload on robots held as an earlier calibration found them, whose errors go on to it.

    Args:
        calibration: of the same robots.
        recordings: of one payload.
        method: ``"auto"``, the calibration's own least squares with the robots held, where the recordings suffice for
            it, else as in ``estimate_payload``; ``"fit"``, the former in any case; or one of ``estimate_payload``.
        cutoff_hz: cut-off of the low-pass filter [Hz].
        say: takes the name of the stage that begins.

    Raises:
        InputError: the recordings are of several payloads or other robots, or as in ``estimate_payload``.
    """
    one_payload(recordings)
    known = [calibrated(recording, calibration) for recording in recordings]
    held: Calibration | None = None
    # What other methods need not, or say in their own words.
    with nullcontext() if method == "fit" else suppress(InputError):
        held = calibrate(known, robots=calibration, say=say)
    if held is not None and method in ("auto", "fit"):
        return estimate_calibrated(replace(held, open=calibration.open), known, cutoff_hz, say)
    method = "auto" if method == "fit" else method
    return _with_errors(estimate_payload(known, method, cutoff_hz, say=say), calibration, held)


def _with_errors(
    estimate: PayloadEstimate, calibration: Calibration, held: Calibration | None
) -> PayloadEstimate:
    """An estimate with the errors that a fit with the robots held has, on top of its own.

    Those are the robots' and, within, those of a fit that follows noise less: at most 1.4 times too much.
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
    """The calibration's frames; residuals of twists, which it does not use, are those of the staged estimate."""
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
    return InertiaEstimate.of(parameters, numbers.covariance[4:, 4:], _rms(left), _rms(explained))


def _rms(parts: Sequence[Array]) -> float:
    return float(rms(np.concatenate(parts)))


def _force_residual(records: Sequence, numbers: Carried, trials: Sequence[Trial]) -> float:
    """rms of the forces left over [N], over all recordings."""
    count = np.array([trial.data.samples for trial in trials])
    share = np.array([record.force_residual for record in records])
    weight = numbers.mass_kg * trials[0].data.gravity_mps2
    return float(weight * np.sqrt(np.sum(count * share**2) / np.sum(count)))
