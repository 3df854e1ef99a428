"""Calibrate a team from recordings of what it carries: from files' contents to a ``Calibration``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.arrays import Array, inertia_parameters
from estimator.calibrate import rules
from estimator.calibrate.calibration import MASSES, CalibratedPayload, CalibratedTrial, Calibration, Prior
from estimator.calibrate.equations import AloneEquations, corrected
from estimator.calibrate.findings import Given, contradicting, shares
from estimator.calibrate.least_squares import CarriedTrial, Fit, KnownMass, Quadratic, Unknowns, fit, solved
from estimator.calibrate.rows import Resolution, Rows, Sensing
from estimator.errors import InputError
from estimator.estimate.consistency import Trial
from estimator.estimate.payload import estimate_from_trials, trial_of, within_arithmetic
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.statics import CONTRADICTION
from estimator.recording.checks import check_duration, check_recording
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.rigid_team import Bases, Shared, robot_data, start_bases

_SENSORS = (
    ("phi_zero", "the encoder of phi{entry}", "slipped by {size:.2g} deg", np.rad2deg(1.0)),
    ("theta_zero", "the encoder of theta_{axis}", "slipped by {size:.2g} deg", np.rad2deg(1.0)),
    ("tau_zero", "the torque zero of tau{entry}", "moved by {size:.2g} N m", 1.0),
)


class Change(NamedTuple):
    """Something that may have been otherwise in one recording than in all others.

    Attributes:
        trial: which one, from 0.
        what: in words.
        drop: by which chi2 falls.
        unknowns: how many it takes.
    """

    trial: int
    what: str
    drop: float
    unknowns: int


def findings(fit: Fit, given: Given, names: Sequence[str]) -> list[str]:
    """Sentences on what no calibration explains; none on good recordings.

    Args:
        fit: the calibration.
        given: what it was made from.
        names: of the recordings with a payload.
    """
    odd = [k for k, trial in enumerate(fit.trials) if trial.loops.misfits or trial.balance.misfits]
    if not odd:
        return [] if fit.converged else [_unsettled(names)]
    if fit.converged:  # elsewhere, derivatives say nothing of what would explain it
        enough = [c for c in _changes(fit, names) if _worth(fit, c) > 0 and _suffices(fit, c)]
        if enough:
            # A slip of a last gimbal turns a grasp, too: of what is enough, the simplest.
            best = min(enough, key=lambda change: (change.unknowns, -_worth(fit, change)))
            rest = "the other recordings" if len(names) > 2 else "the other recording"
            return [f"{names[best.trial]} contradicts {rest}: {best.what}. Leave it out, or record it again."]
    sentence = contradicting(given, names)
    return [sentence or _unexplained(fit, odd, names)]


def _unsettled(names: Sequence[str]) -> str:
    return (
        f"The calibration did not settle within {rules.MAX_STEPS} steps, so its numbers are not to be used: "
        f"{', '.join(names)} leave too much open. Add a recording of another motion."
    )


def _unexplained(fit: Fit, odd: Sequence[int], names: Sequence[str]) -> str:
    worst = max(odd, key=lambda k: fit.trials[k].all.c)
    parts = []
    for k in odd:
        loops, balance = fit.trials[k].loops.ratio, fit.trials[k].balance.ratio
        parts.append(f"{names[k]} ({loops:.3g} in its loops, {balance:.3g} in its balance)")
    return (
        f"No calibration explains {'; '.join(parts)}: chi2/n is 1 where robots, payload and noise are all there is, "
        f"and {rules.MISFIT} at most. Something else acts on these robots, most in {names[worst]}; the numbers are not "
        "to be trusted before mocobot diagnose has named it."
    )


def _suffices(fit: Fit, change: Change) -> bool:
    """Whether nothing would be left, or next to nothing of much: what is large is not quite linear."""
    total, count = sum(trial.all.c for trial in fit.trials), sum(trial.all.count for trial in fit.trials)
    left = total - change.drop
    return left < rules.MISFIT * count or left - count < (1.0 - rules.SUFFICES) * (total - count)


def _worth(fit: Fit, change: Change) -> float:
    """Drop in chi2 beyond what as many free numbers buy (Schwarz)."""
    return change.drop - change.unknowns * np.log(fit.trials[change.trial].all.count)


def _changes(fit: Fit, names: Sequence[str]) -> list[Change]:
    """Every sensor's zero, the payload and its grasps, each otherwise in one recording."""
    if len(names) < 2:
        return []
    out = []
    layout = fit.layout
    for k, trial in enumerate(fit.trials):
        for robot in range(layout.robots):
            for group, sensor, moved, scale in _SENSORS:
                for entry in range(3):
                    place = robot * COUNT + AT[group].start + entry
                    drop, size = _freed(fit, trial.all, np.array([place]))
                    words = f"{sensor} of omnid{robot + 1} {moved}".format(
                        entry=entry + 1, axis="zyx"[entry], size=abs(float(size[0])) * scale
                    )
                    out.append(Change(k, words, drop, 1))
        own = trial.all.index[layout.of_units.stop : layout.of_units.stop + layout.per_payload]
        grasps, inertia = own[:-10], own[-10:]
        payload = [i for i, other in enumerate(fit.trials) if other.all.index[layout.of_units.stop] == own[0]]
        if len(payload) > 1:
            out.append(Change(k, "it looks like another payload", _freed(fit, trial.all, inertia)[0], 10))
            drop = _freed(fit, trial.all, own)[0]
            out.append(Change(k, "it looks like another payload, held elsewhere", drop, len(own)))
            drop = _freed(fit, trial.all, grasps)[0]
            out.append(Change(k, "the robots hold the payload elsewhere", drop, len(grasps)))
    return out


def _freed(fit: Fit, part: Quadratic, places: NDArray[np.intp]) -> tuple[float, Array]:
    """Drop in chi2 if unknowns were others in one recording and the rest refitted, and by how much they would be."""
    own = np.searchsorted(part.index, places)
    H_ee, H_ex, g_e = part.H[np.ix_(own, own)], part.H[own], part.g[own]
    C = fit.covariance[np.ix_(part.index, part.index)]
    S = H_ee - H_ex @ C @ H_ex.T
    scale = np.sqrt(np.maximum(np.diag(H_ee), 1e-300))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    told = values > 1e-9
    along = vectors[:, told].T @ (g_e / scale)
    size = -(vectors[:, told] @ (along / values[told])) / scale
    return float(np.sum(along**2 / values[told])), size


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
    trials = [CarriedTrial(r, k, s) for r, k, s in zip(rows, payload_of, sensing, strict=False)]
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


def start_estimate(trials: Sequence[Trial]) -> PayloadEstimate:
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
