"""Calibrate a team of robots from recordings of the payloads that it carries."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.calibration import CalibratedTrial, Calibration
from estimator.calibrate.equations import AloneEquations, corrected
from estimator.calibrate.findings import findings, held_out, shares, undecided
from estimator.calibrate.least_squares import CarriedTrial, Fit, Given, KnownMass, Unknowns, fit
from estimator.calibrate.prior import Prior
from estimator.calibrate.rows import Resolution, Rows, Sensing
from estimator.errors import InputError
from estimator.estimate.consistency import Trial
from estimator.estimate.inertia import about_origin
from estimator.estimate.payload import estimate_from_trials, trial_of, within_arithmetic
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import CONTRADICTION
from estimator.recording.checks import check_duration, check_recording
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.rigid_team import Bases, Shared, robot_data, start_bases

LEAST_ROWS = 8
"""Fewest rows of a usable recording. Chosen: two seconds of motion."""


def calibrate(
    recordings: Sequence[Recording],
    free: Sequence[Recording] = (),
    prior: Prior | None = None,
    known_mass: Mapping[str, tuple[float, float]] | None = None,
    say: Callable[[str], object] = lambda _: None,
    robots: Calibration | None = None,
    starts: Mapping[str | None, PayloadEstimate] | None = None,
) -> Calibration:
    """Estimate geometry, springs, zeros and optionally masses of every robot, together with the payloads.

    One nonlinear least squares over closed loops and balance of wrenches of all recordings. Recordings with the same
    payload label share one payload; without labels all do.

    Args:
        recordings: trials with a payload, of the same robots.
        free: recordings of the same robots, unloaded.
        prior: prior of the robots; None for uncalibrated robots.
        known_mass: weighed mass of payloads by label, with its standard error [kg]; "" for a payload without a label.
        say: callback for the name of each stage.
        robots: an earlier calibration of the same robots. They are held, only the payloads are estimated, and its
            covariance propagates to theirs. Excludes ``free``, ``prior`` and ``known_mass``.
        starts: result of ``start_estimate`` for each payload label; None to compute it here.

    Raises:
        InputError: the recordings do not belong together, do not move enough, or cannot be solved.
    """
    if robots is not None and (free or prior or known_mass):
        raise InputError(
            "robots are held as calibrated: unloaded arms, a prior or a known mass cannot change them"
        )
    prior = prior or (Prior() if robots is None else robots.prior)
    groups = _by_payload(recordings)
    _check_together(recordings, free)
    design, N = recordings[0].metadata.design, recordings[0].metadata.robots
    if robots is not None and (robots.design != design or robots.robots != N):
        raise InputError(
            f"{recordings[0].name}: the calibration is of {robots.robots} robots and the recording of {N}, or their "
            "designs differ; it must be of the same robots"
        )
    if N < 2:
        raise InputError(
            f"{recordings[0].name}: one robot closes no loop; two or more that carry one payload are needed"
        )
    shared = []
    for label, members in groups.items():
        say(f"payload {label}" if label else "payload")
        if starts is None:
            with within_arithmetic([recording.name for recording in members]):
                estimate = start_estimate([trial_of(recording) for recording in members])
        else:
            estimate = starts[label]
        shared.append(_start(estimate, members))
    say("calibration")
    units = ArmUnit(design, np.zeros((N, COUNT))) if robots is None else robots.units
    sensing = Sensing.of_each([Resolution.of(recording) for recording in (*recordings, *free)])
    labels = list(groups)
    rows = [_rows(recording) for recording in recordings]
    payload_of = [labels.index(recording.metadata.payload) for recording in recordings]
    bases = [bases_of(r, units, shared[k]) for r, k in zip(rows, payload_of, strict=True)]
    given = Given(
        [CarriedTrial(r, k, s) for r, k, s in zip(rows, payload_of, sensing, strict=False)],
        Unknowns(units, tuple(shared), tuple(bases)),
        prior,
        [
            AloneEquations.of(_rows(one), its)
            for one, its in zip(free, sensing[len(recordings) :], strict=True)
        ],
        _weights(known_mass or {}, labels),
        robots,
    )
    try:
        found = fit(given)
    except (InputError, np.linalg.LinAlgError) as error:
        names = ", ".join(recording.name for recording in (*recordings, *free))
        raise InputError(
            f"{names} fit no team of robots near its design ({error}); are all of them of the same robots, and of the "
            "payloads that they name?"
        ) from error
    known = tuple(known_mass or ()) if robots is None else robots.known_mass
    wrong = findings(found, given, [recording.name for recording in recordings])
    scale_sd = 0.0 if known else prior.stiffness_ratio / np.sqrt(3.0 * N)
    single = [one.name for one, k in zip(recordings, payload_of, strict=True) if payload_of.count(k) == 1]
    return Calibration(
        units=found.point.unknowns.units,
        covariance=found.covariance[found.layout.of_units, found.layout.of_units],
        by_scale=found.by_scale[found.layout.of_units].reshape(N, COUNT),
        scale_sd=scale_sd,
        prior=prior,
        payloads=tuple(found.payload(k, label) for k, label in enumerate(labels)),
        trials=_trials(found, recordings, free, payload_of),
        known_mass=known,
        steps=found.steps,
        findings=tuple(wrong),
        open=tuple(undecided(found, prior, scale_sd, alone=bool(free), single=single)),
    )


def start_estimate(trials: Sequence[Trial]) -> PayloadEstimate:
    """Estimate grasps, mass, centre of mass and inertia with robots as designed, as the start of a calibration.

    Args:
        trials: trials of one payload, processed by ``trial_of``.

    Raises:
        InputError: the trials are of different payloads, or determine nothing.
    """
    return estimate_from_trials(trials, "auto", compare_masses=True, withhold=False)


def _by_payload(recordings: Sequence[Recording]) -> dict[str | None, list[Recording]]:
    if not recordings:
        raise InputError("no recording with a payload was given")
    groups: dict[str | None, list[Recording]] = {}
    for recording in recordings:
        groups.setdefault(recording.metadata.payload, []).append(recording)
    if None in groups and len(groups) > 1:
        raise InputError(
            f"{groups[None][0].name} does not say which payload it is of, and others do; name it in all recordings, or "
            "in none if all carry the same"
        )
    return groups


def _check_together(carrying: Sequence[Recording], free: Sequence[Recording]) -> None:
    first = carrying[0]
    for recording in carrying:
        if recording.metadata.trial == FREE:
            raise InputError(f"{recording.name} is of robots that hold nothing; give it as a free recording")
    for recording in free:
        if recording.metadata.trial != FREE:
            raise InputError(
                f"{recording.name} is a {recording.metadata.trial} trial of a payload; a free recording is of robots "
                "that hold nothing"
            )
    for recording in (*carrying, *free):
        check_recording(recording)
        check_duration(recording, 2.0)
        if recording.metadata.robots != first.metadata.robots:
            raise InputError(
                f"{recording.name} has {recording.metadata.robots} robots and {first.name} has "
                f"{first.metadata.robots}; a calibration is of the same robots"
            )
        if recording.metadata.design != first.metadata.design:
            raise InputError(
                f"{recording.name} and {first.name} differ in design; a calibration is of the same robots"
            )


def _start(estimate: PayloadEstimate, members: Sequence[Recording]) -> Shared:
    grasps, mass, c = estimate.grasps, estimate.mass, estimate.p_1c
    if grasps is None or mass is None or c is None:
        missing = "grasps" if grasps is None else "mass" if mass is None else "centre of mass"
        names = ", ".join(recording.name for recording in members)
        doubts = [
            weak.reason for step in estimate.steps for weak in step.weak if CONTRADICTION in weak.reason
        ]
        if doubts:
            raise InputError(
                f"{names}: no {missing} comes out of them, for {doubts[0]}; are all of them of the same robots, in the "
                "same order?"
            )
        raise InputError(
            f"{names}: the motion does not determine the {missing}, so there is nothing to calibrate against; "
            "add a trial in which the payload turns about all axes"
        )
    inertia = estimate.inertia.inertia if estimate.inertia else 0.01 * mass.mass * np.eye(3)
    return Shared(grasps, about_origin(mass.mass, c, inertia))


def bases_of(rows: Rows, units: ArmUnit, shared: Shared) -> Bases:
    """Return the base poses of the robots in a trial, from its mean signals per row."""
    data = robot_data(corrected(rows(rows.s), units), units)
    return start_bases(data.R_bi, data.h, shared)


def _rows(recording: Recording) -> Rows:
    rows = Rows.of(recording)
    if len(rows.time) < LEAST_ROWS:
        raise InputError(f"{recording.name}: too short to calibrate; 10 s of motion are the least")
    return rows


def _weights(known: Mapping[str, tuple[float, float]], labels: Sequence[str | None]) -> list[KnownMass]:
    names = [label or "" for label in labels]
    for label, (mass, se) in known.items():
        if label not in names:
            raise InputError(
                f"known mass of payload {label!r}: the recordings are of {', '.join(map(repr, names))}"
            )
        if not (np.isfinite(mass) and mass > 0 and np.isfinite(se) and se > 0):
            raise InputError(
                f"known mass of payload {label!r} is {mass} +- {se} kg; both must be greater than 0"
            )
    return [KnownMass(names.index(label), mass, se) for label, (mass, se) in known.items()]


def _trials(
    found: Fit, recordings: Sequence[Recording], free: Sequence[Recording], payload_of: Sequence[int]
) -> tuple[CalibratedTrial, ...]:
    """Summarize the fit of every recording, free ones last."""
    out, share = [], shares(found)
    for k, (recording, left) in enumerate(zip(recordings, held_out(found), strict=True)):
        done = found.point.trials[k]
        loops, balance = done.loops, done.balance
        out.append(
            CalibratedTrial(
                name=recording.name,
                kind=recording.metadata.trial,
                payload=payload_of[k],
                duration_s=_length(recording),
                count=(loops.count, balance.count),
                before=(float(found.before[k, 0]), float(found.before[k, 1])),
                after=(loops.ratio, balance.ratio),
                held_out=left,
                bases=found.point.unknowns.bases[k],
                shares=share[k],
            )
        )
    for recording, one, its in zip(free, found.point.alone, share[len(recordings) :], strict=True):
        length, count, after = _length(recording), (0, one.count), (0.0, one.ratio)
        out.append(CalibratedTrial(recording.name, FREE, None, length, count, None, after, None, None, its))
    return tuple(out)


def _length(recording: Recording) -> float:
    return float(recording.time[-1] - recording.time[0])
