"""Estimate two bodies on a hinge or slide: joint, masses, inertias, and the joint's stiffness, damping and friction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np

from estimator.calibrate import rules
from estimator.errors import InputError
from estimator.estimate.uncertainty import WeakDirection, combination
from estimator.recording.checks import check_carries
from estimator.recording.model import Recording
from estimator.two_bodies.fit import Evaluated, Fitted, Point, TrialRows, normal, residual, solve
from estimator.two_bodies.relative import MOTIONS, Candidate, candidates, trial_rows
from estimator.two_bodies.result import Explained, RecordingFit, TwoBodies, parameter_names
from estimator.two_bodies.team import NAMES, TERMS, Motion, expand

Kind = Literal["hinged", "sliding", "flexible", "auto"]
KINDS: dict[Kind, tuple[Motion, ...]] = {
    "hinged": ("rigid", "hinged"),
    "sliding": ("rigid", "sliding"),
    "flexible": MOTIONS,
    "auto": MOTIONS,
}
"""Motions that are compared for each kind of payload."""
MOST_AXIS_RAD = float(np.deg2rad(5.0))
"""Standard error of the axis above which an estimate is refused. Chosen."""
EXPLAINED = 3.0
"""Residual of the loops over the noise above which a joint does not explain them. Chosen, as for rigid payloads."""
WEAK = 1.0 / 3.0
"""Standard error of a combination of parameters, over the payload's size, above which it is not determined. Chosen."""


def estimate_two_bodies(
    recordings: Sequence[Recording],
    kind: Kind = "auto",
    say: Callable[[str], object] = lambda _: None,
    why: str = "",
) -> TwoBodies:
    """Estimate two bodies that a hinge or a slide connects, from encoders and spring torques.

    Args:
        recordings: trials of the same robots and grasps; bases may stand elsewhere in each.
        kind: ``"hinged"`` or ``"sliding"``, a joint without a spring; ``"flexible"``, one with a spring; ``"auto"``,
            the kind of largest evidence.
        say: callback for the name of each stage.
        why: reason why the payload was not taken for one rigid body; kept in the result.

    Raises:
        InputError: a recording is unusable, the halves hardly move against each other, no joint explains the loops, or
            the motion does not determine the axis.
    """
    for recording in recordings:
        check_carries(recording, "estimated")
    names = ", ".join(recording.name for recording in recordings)
    trials = trial_rows(recordings)
    say("relative motion")
    found = candidates(trials, KINDS[kind], say=say)
    best = _checked(found, kind, names)
    say("two bodies")
    fitted = _with_torques(best, trials, kind)
    return _result(recordings, fitted, found, best, why)


def _checked(found: Sequence[Candidate], kind: Kind, names: str) -> Candidate:
    """Return the best joint.

    Raises:
        InputError: it is not one, or poor.
    """
    best = found[0]
    joint = next(one for one in found if one.axis is not None)
    if best.motion == "rigid":
        unit = "m" if joint.motion == "sliding" else "rad"
        raise InputError(
            f"{names}: the halves hardly move against each other ({joint.q_rms:.2g} {unit} rms, which one rigid body "
            "explains better); move them against each other, or use --payload rigid"
        )
    if best.motion == "loose" or best.noise > EXPLAINED:
        lacking = {"hinged": "no hinge", "sliding": "no slide"}.get(kind, "no hinge and no slide")
        raise InputError(
            f"{names}: {lacking} explains how the robots move against each other (the best leaves {joint.noise:.2g} "
            f"times the encoders' noise); did a robot or a grasp move, or are there three bodies?"
        )
    if best.axis_se_rad > MOST_AXIS_RAD:
        raise InputError(
            f"{names}: the motion leaves the joint's axis open by {np.rad2deg(best.axis_se_rad):.2g} deg; move the "
            "halves further against each other"
        )
    return best


def _with_torques(best: Candidate, trials: Sequence[TrialRows], kind: Kind) -> Fitted:
    """Fit the balance as well, with the terms of the joint's force that the data show."""
    spring = kind in ("auto", "flexible")
    law = TERMS if spring else TERMS[:2]
    fitted = solve(_start(best.fitted.point, law, trials), trials)
    price = np.log(fitted.rows)
    if kind == "auto" and _wald(fitted, ("stiffness", "offset")) < 2.0 * price:
        law = law[:2]
    friction = fitted.point.pi[len(fitted.point.pi) - len(fitted.point.law) + 1]
    if _wald(fitted, ("friction",)) < price or friction < 0.0:
        law = tuple(term for term in law if term != "friction")
    return fitted if law == fitted.point.law else solve(_start(fitted.point, law, trials), trials)


def _wald(fitted: Fitted, terms: Sequence[str]) -> float:
    """Return the squared terms over their covariance."""
    law = fitted.point.law
    at = [fitted.point.size - len(law) + law.index(term) for term in terms]
    x = fitted.point.pi[[k - fitted.point.pair.size for k in at]]
    return float(x @ np.linalg.solve(fitted.covariance[np.ix_(at, at)], x))


def _start(point: Point, law: tuple[str, ...], trials: Sequence[TrialRows]) -> Point:
    """Return initial parameters by linear least squares, at the joint of a fit without torques."""
    K = 10 + len(NAMES[point.pair.joint.motion]) + len(law)
    start = Point(point.pair, np.zeros(K), law)
    X, y = [], []
    for k, trial in enumerate(trials):
        left, columns, _, _ = residual(start, k, trial.fine, trial.units.gravity_mps2)
        X.append(-columns[:, -7:].reshape(-1, K))
        y.append(left[:, -7:].ravel())
    return Point(point.pair, np.linalg.lstsq(np.concatenate(X), np.concatenate(y), rcond=1e-12)[0], law)


def _result(
    recordings: Sequence[Recording], fitted: Fitted, found: Sequence[Candidate], best: Candidate, why: str
) -> TwoBodies:
    point, pair, joint = fitted.point, fitted.point.pair, fitted.point.pair.joint
    at = pair.of_joint
    of_joint = fitted.covariance[at, at]
    fits = tuple(_recording(one, part) for one, part in zip(recordings, fitted.trials, strict=True))
    flags = [flag for fit in fits for flag in fit.flags]
    if not fitted.converged:
        flags.append("The least squares did not settle; the numbers are not the best ones.")
    q = np.concatenate(best.q)
    labels = {recording.metadata.payload for recording in recordings}
    hinged = joint.motion == "hinged"
    grasped = pair.R, pair.p
    return TwoBodies(
        payload=labels.pop() if len(labels) == 1 else None,
        robots=len(pair.p),
        kind="flexible" if "stiffness" in point.law else joint.motion,
        motion=joint.motion,
        halves=best.halves,
        axes=joint.axes,
        pivot=joint.pivot if hinged else None,
        joint_covariance=of_joint[5:, 5:],
        R_0=joint.R_0,
        p_0=joint.p_0,
        R_ki=grasped[0],
        p_ki=grasped[1],
        law=point.law,
        q_low=float(q.min()),
        q_high=float(q.max()),
        q_rms=float(np.std(q)),
        parameters=point.pi,
        covariance=fitted.covariance[pair.size :, pair.size :],
        explained=tuple(Explained(one.motion, one.halves, one.log_evidence, one.noise) for one in found),
        recordings=fits,
        undetermined=tuple(_weak(fitted)),
        flags=tuple(flags),
        why=why,
    )


def _recording(recording: Recording, one: Evaluated) -> RecordingFit:
    """Return chi2/n of loops and balance of one recording, with a flag where it exceeds noise."""
    ratios, flags = [], []
    for what, at in (("loops", slice(0, -7)), ("balance of wrenches", slice(-7, None))):
        part = Evaluated(one.residual[:, at], one.J[:, at], one.covariance[:, at, at], one.extended, one.q)
        count = part.residual.size
        ratio = normal([part], one.J.shape[2])[2] / count
        ratios.append(ratio)
        if ratio > max(rules.MISFIT, 1.0 + rules.MISFIT_SIGMAS * np.sqrt(2.0 / count)):
            flags.append(
                f"{recording.name}: the {what} leave{'' if what == 'loops' else 's'} more than noise (chi2/n "
                f"{ratio:.3g}); the true errors exceed the standard errors."
            )
    length = float(recording.time[-1] - recording.time[0])
    return RecordingFit(recording.name, recording.metadata.trial, length, ratios[0], ratios[1], tuple(flags))


def _weak(fitted: Fitted) -> list[WeakDirection]:
    """Return the combinations of inertial parameters that the motion does not determine, over the payload's size."""
    pair, motion = fitted.point.pair, fitted.point.pair.joint.motion
    names, used = parameter_names(motion), 10 + len(NAMES[motion])
    mass = float(abs(fitted.point.pi[0]))
    size = max(float(np.linalg.norm(pair.p, axis=1).max()), float(np.linalg.norm(pair.joint.p_0)), 0.1)
    powers = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    of_B = np.abs(expand(motion)).T @ powers / np.abs(expand(motion)).sum(axis=0)
    scale = mass * size ** np.concatenate([powers, of_B])
    at = slice(pair.size, pair.size + used)
    values, vectors = np.linalg.eigh(fitted.covariance[at, at] / np.outer(scale, scale))
    out = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value > WEAK**2:
            vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
            reason = (
                f"the motion does not excite it (standard error {np.sqrt(value):.2g} of the payload's size)"
            )
            out.append(
                WeakDirection(
                    "inertial parameters", combination(vector, names), tuple(map(float, vector)), reason
                )
            )
    return out
