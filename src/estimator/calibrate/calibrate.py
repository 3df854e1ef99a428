"""Calibrate a team from recordings of what it carries: from files' contents to a ``Calibration``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate.calibration import CalibratedPayload, CalibratedTrial, Calibration
from estimator.calibrate.equations.alone import AloneEquations
from estimator.calibrate.equations.level import corrected
from estimator.calibrate.equations.rows import Rows
from estimator.calibrate.equations.sensing import Resolution, Sensing
from estimator.calibrate.findings import findings
from estimator.calibrate.fit import Fit, fit
from estimator.calibrate.left_out import Given
from estimator.calibrate.outcome.shares import shares
from estimator.calibrate.prior import MASSES, Prior
from estimator.calibrate.problem import KnownMass, Trial
from estimator.calibrate.quadratic import solved
from estimator.calibrate.unknowns import Unknowns
from estimator.errors import InputError
from estimator.estimate.consistency import Trial as Processed
from estimator.estimate.payload import estimate_from_trials, trial_of, within_arithmetic
from estimator.estimate.principal import inertia_parameters
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import CONTRADICTION
from estimator.recording.checks import check_duration, check_recording
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.rigid_team.residual import Bases, Shared, robot_data
from estimator.rigid_team.start import start_bases


def held_out(fit: Fit) -> list[tuple[float, float] | None]:
    """chi2 per number of loops and balance of every trial with a payload; None where the others do not suffice.

    The problem is linear near its solution, so leaving one trial out takes one solution of normal equations. The bases
    stood elsewhere in every trial and are fitted to the trial itself.
    """
    out: list[tuple[float, float] | None] = []
    layout = fit.layout
    payload = [int(trial.all.index[layout.of_units.stop]) for trial in fit.trials]
    for k, trial in enumerate(fit.trials):
        own = np.r_[layout.of_trial(k)]
        others = [t for i, t in enumerate(fit.trials) if i != k]
        if payload.count(payload[k]) < 2:
            out.append(None)
            continue
        H, g = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
        for part in (*(t.all for t in others), *fit.alone, *fit.known):
            part.add_to(H, g)
        free = ~np.isin(np.arange(layout.size), own)
        kept = fit.basis[free].any(axis=0)
        columns, prior, z = fit.basis[:, kept], fit.prior[kept], fit.z[kept]
        dz, _ = solved(columns.T @ H @ columns + np.diag(prior), columns.T @ g + prior * z)
        dx = columns @ dz
        at = np.flatnonzero(np.isin(trial.all.index, own))
        score = trial.all.g + trial.all.H @ dx[trial.all.index]
        if len(at):
            dx[own] = solved(trial.all.H[np.ix_(at, at)], score[at])[0]
        loops = trial.loops.at(dx) / max(1, trial.loops.count)
        out.append((loops, trial.balance.at(dx) / trial.balance.count))
    return out


UNKNOWN_MASSES = 0.05
"""Relative error of arm masses that is taken for granted where nobody has weighed them."""


def undecided(
    fit: Fit, prior: Prior, scale_sd: float, *, alone: bool, single: list[str], parallel: bool = False
) -> list[str]:
    """Sentences.

    Args:
        fit: the calibration.
        prior: what was assumed.
        scale_sd: standard deviation of the held common spring scale; 0 if it is not held.
        alone: whether unloaded arms were recorded.
        single: names of payloads with one recording.
        parallel: whether the flanges are known to be parallel.
    """
    out = []
    layout = fit.layout
    masses = []
    for k, shared in enumerate(fit.unknowns.carried):
        place = layout.of_inertia(k).start
        masses.append(np.sqrt(fit.covariance[place, place]) / shared.pi[0])
    if scale_sd:
        out.append(
            "The common scale of all springs is held at its design value, for a carry tells it from the mass by the "
            f"arms' own weight alone: all masses and inertias may be off together by {100 * scale_sd:.2g} % (one "
            f"standard error). One weighed payload (--known-mass) brings that to {100 * min(masses):.1g} %."
        )
    if not parallel and prior.encoder_zero_rad:
        reach = max(float(np.max(np.linalg.norm(s.grasps.p_1i, axis=1))) for s in fit.unknowns.carried)
        degrees = np.rad2deg(prior.encoder_zero_rad)
        out.append(
            "The zeros of the last gimbal axes (theta_x) only turn the grasp frames, so frames are those that the "
            f"encoders define. Frames drawn at the flanges may be turned against them by {degrees:.2g} deg about their "
            "x axes (one standard error), which moves positions in {1} by up to "
            f"{1e3 * reach * prior.encoder_zero_rad:.2g} mm. Flanges known to be parallel (--parallel-flanges), or an "
            "index mark at each, decide them."
        )
    if not prior.arm_mass_ratio and not alone:
        share = max(_by_masses(fit, k) for k in range(layout.payloads))
        out.append(
            "The arms' masses are taken as designed but for one common factor. Where each is known to "
            f"{100 * UNKNOWN_MASSES:.0f} % only, a payload's mass is off by {100 * share:.2g} % besides (one standard "
            "error): free them (--arm-masses), best with a recording of the unloaded arms (--free)."
        )
    for name in single:
        out.append(
            f"{name}: with one recording none can be left out, so nothing shows how well the calibration foretells "
            "another; record a second motion of the same payload."
        )
    return out


def _by_masses(fit: Fit, payload: int) -> float:
    """Relative error of a payload's mass from errors of ``UNKNOWN_MASSES`` in every arm mass alone."""
    layout = fit.layout
    H = np.zeros((layout.size, layout.size))
    g = np.zeros(layout.size)
    for part in (*(trial.all for trial in fit.trials), *fit.alone, *fit.known):
        part.add_to(H, g)
    places = (np.arange(layout.robots)[:, None] * COUNT + MASSES).ravel()
    at = layout.of_inertia(payload).start
    by_mass = -(fit.covariance[at] @ H[:, places])
    return float(UNKNOWN_MASSES * np.linalg.norm(by_mass) / fit.unknowns.carried[payload].pi[0])


def calibrate(
    recordings: Sequence[Recording],
    free: Sequence[Recording] = (),
    prior: Prior | None = None,
    known_mass: Mapping[str, tuple[float, float]] | None = None,
    say: Callable[[str], object] = lambda _: None,
    robots: Calibration | None = None,
    starts: Mapping[str | None, PayloadEstimate] | None = None,
) -> Calibration:
    """Geometry, springs, zeros and, where asked, masses of every robot, with what they carry.

    One nonlinear least squares over closed loops and balance of wrenches of all recordings. Recordings with the same
    payload label are of one payload; without labels all are.

    Args:
        recordings: trials with a payload, of the same robots.
        free: recordings of the same robots with nothing in their hands.
        prior: how far the robots may be off; None for robots out of the box.
        known_mass: weighed mass of payloads by label, with its standard error [kg]; "" for one without a label.
        say: takes the name of the stage that begins.
        robots: an earlier calibration of the same robots, which are held as it found them: the payloads alone are
            estimated, and its covariance goes on to theirs. Excludes ``free``, ``prior`` and ``known_mass``.
        starts: what ``start_estimate`` makes of each payload's recordings, by its label; None to make it here.

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
    trials = [Trial(r, k, s) for r, k, s in zip(rows, payload_of, sensing, strict=False)]
    bases = [_start_bases(r, units, shared[k]) for r, k in zip(rows, payload_of, strict=True)]
    alone = [
        AloneEquations.of(_rows(recording), its)
        for recording, its in zip(free, sensing[len(recordings) :], strict=True)
    ]
    start = Unknowns(units, tuple(shared), tuple(bases))
    weights = _weights(known_mass or {}, labels)
    given = Given(trials, start, prior, alone, weights, robots)
    try:
        found = fit(trials, start, prior, alone, weights, robots)
    except (InputError, np.linalg.LinAlgError) as error:
        names = ", ".join(recording.name for recording in (*recordings, *free))
        raise InputError(
            f"{names} fit no team of robots near its design ({error}); are all of them of the same robots, and of the "
            "payloads that they name?"
        ) from error
    known = tuple(known_mass or ()) if robots is None else robots.known_mass
    wrong = findings(found, given, [recording.name for recording in recordings])
    return _result(found, wrong, recordings, free, labels, payload_of, prior, known)


def start_estimate(trials: Sequence[Processed]) -> PayloadEstimate:
    """What a calibration starts from: grasps, mass, centre of mass and inertia as robots as designed would have them.

    Args:
        trials: of one payload, processed by ``trial_of``.

    Raises:
        InputError: they are not of one payload, or tell nothing of it.
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
            f"{groups[None][0].name} does not say which payload it is of, and others do; name it in every recording"
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
    about_1 = inertia + mass.mass * (c @ c * np.eye(3) - np.outer(c, c))
    return Shared(grasps, np.concatenate([[mass.mass], mass.mass * c, inertia_parameters(about_1)]))


def _start_bases(rows: Rows, units: ArmUnit, shared: Shared) -> Bases:
    data = robot_data(corrected(rows(rows.s), units), units)
    return start_bases(data.R_bi, data.h, shared)


def _rows(recording: Recording) -> Rows:
    rows = Rows.of(recording)
    if len(rows.time) < 8:
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


def _result(
    found: Fit,
    wrong: Sequence[str],
    recordings: Sequence[Recording],
    free: Sequence[Recording],
    labels: Sequence[str | None],
    payload_of: Sequence[int],
    prior: Prior,
    known_mass: tuple[str, ...],
) -> Calibration:
    layout, N = found.layout, found.layout.robots
    payloads = []
    for k, label in enumerate(labels):
        at = layout.of_payload(k)
        covariance, grasped = found.covariance[at, at], 6 * (N - 1)
        shared = found.unknowns.carried[k]
        grasps = replace(shared.grasps, covariance=covariance[:grasped, :grasped])
        payloads.append(CalibratedPayload(label, grasps, shared.pi, covariance, found.by_scale[at]))
    trials, shared_out = [], shares(found)
    for k, (recording, left) in enumerate(zip(recordings, held_out(found), strict=True)):
        done = found.trials[k]
        count = done.loops.count, done.balance.count
        trials.append(
            CalibratedTrial(
                recording.name,
                recording.metadata.trial,
                payload_of[k],
                _length(recording),
                count,
                (float(found.before[k, 0]), float(found.before[k, 1])),
                _per((done.loops.c, done.balance.c), count),
                left,
                found.unknowns.bases[k],
                shared_out[k],
            )
        )
    for recording, one, share in zip(free, found.alone, shared_out[len(found.trials) :], strict=True):
        count = 0, one.count
        trials.append(
            CalibratedTrial(
                recording.name,
                "free",
                None,
                _length(recording),
                count,
                None,
                (0.0, one.c / one.count),
                None,
                None,
                share,
            )
        )
    at = layout.of_units
    scale_sd = 0.0 if known_mass else prior.stiffness_ratio / np.sqrt(3.0 * N)
    single = [
        recording.name for k, recording in enumerate(recordings) if list(payload_of).count(payload_of[k]) == 1
    ]
    return Calibration(
        units=found.unknowns.units,
        covariance=found.covariance[at, at],
        by_scale=found.by_scale[at].reshape(N, COUNT),
        scale_sd=scale_sd,
        prior=prior,
        payloads=tuple(payloads),
        trials=tuple(trials),
        known_mass=known_mass,
        steps=found.steps,
        findings=tuple(wrong),
        open=tuple(undecided(found, prior, scale_sd, alone=bool(free), single=single)),
    )


def _length(recording: Recording) -> float:
    return float(recording.time[-1] - recording.time[0])


def _per(chi2: Array | tuple[float, float], count: tuple[int, int]) -> tuple[float, float]:
    return float(chi2[0]) / max(1, count[0]), float(chi2[1]) / max(1, count[1])
