"""Relative motion of two bodies that robots hold, from encoders alone: which robots hold which, and the kind of joint.

Each candidate is a division of the robots into two halves and a motion: rigid, hinged, sliding or loose (all six
coordinates of the relative pose vary). The closed loops of each candidate are fitted, and its log evidence is

    -1/2 sum over rows [r^T S^-1 r / s^2 + log det(2 pi s^2 S)] - n/2 [log(2 pi v) + 1] - K/2 log(n),

the likelihood of the residuals r with sensor noise S and its scale s, of the free coordinate with its variance v
(loose: log det of the covariance of six), and the Bayesian information criterion's price of the K unknowns
(G. Schwarz, Annals of Statistics 6, 1978). Scale and variances are those of largest likelihood. All candidates explain
the same loops.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from estimator.arm.unit import COUNT, ArmUnit
from estimator.arrays import Array
from estimator.calibrate import rules
from estimator.calibrate.calibrate import LEAST_ROWS
from estimator.calibrate.rows import Resolution, Rows, Sensing
from estimator.errors import InputError
from estimator.recording.checks import check_duration, check_recording
from estimator.recording.model import Recording
from estimator.two_bodies.fit import Fitted, Point, TrialRows, solve
from estimator.two_bodies.start import Poses, rigid_residual, start
from estimator.two_bodies.team import Motion, halves_of

Halves = tuple[tuple[int, ...], tuple[int, ...]]
MOTIONS: tuple[Motion, ...] = ("rigid", "hinged", "sliding", "loose")
NEAR = 10.0
"""Factor between the loops' residuals of two divisions above which the worse one is dropped without a fit. Chosen."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One explanation of the closed loops.

    Attributes:
        motion: "rigid", "hinged", "sliding" or "loose".
        halves: robots (from 1) of body A, which has robot 1, and of body B.
        log_evidence: natural logarithm, comparable between candidates of the same recordings; see this module.
        noise: residuals of the loops over the sensors' noise, rms; about 1 if the candidate is right.
        axis, axis_se_rad: axis of the joint in {1}, shape (3,), and standard error of its direction [rad]; None if
            rigid or loose.
        pivot, pivot_se_m: point of a hinge's axis in {1} [m], shape (3,), and its standard error across the axis [m];
            None otherwise.
        time, q: instants [s] and joint coordinate [rad, m] of every recording, shape (Q,) each; B turns by +q about
            the axis, or shifts by +q along it, relative to A. Empty if rigid or loose.
        fitted: the least squares.
    """

    motion: Motion
    halves: Halves
    log_evidence: float
    noise: float
    axis: Array | None
    axis_se_rad: float
    pivot: Array | None
    pivot_se_m: float
    time: tuple[Array, ...]
    q: tuple[Array, ...]
    fitted: Fitted

    @property
    def q_rms(self) -> float:
        """Standard deviation of the joint coordinate over all recordings [rad, m]; 0 if rigid or loose."""
        return float(np.std(np.concatenate(self.q))) if self.q else 0.0


def trial_rows(recordings: Sequence[Recording]) -> list[TrialRows]:
    """Reduce recordings to rows.

    Raises:
        InputError: a recording is unusable or too short, or the numbers of robots differ.
    """
    for recording in recordings:
        check_recording(recording)
        check_duration(recording, rules.TRIM_S)
    sensing = Sensing.of_each([Resolution.of(recording) for recording in recordings])
    out = []
    for recording, seen in zip(recordings, sensing, strict=True):
        rows, labels = Rows.of(recording), recording.metadata
        if len(rows.time) < LEAST_ROWS:
            raise InputError(f"{recording.name}: too short for two bodies; 10 s of motion are the least")
        if labels.robots != recordings[0].metadata.robots:
            raise InputError(
                f"{recording.name}: {labels.robots} robots; {recordings[0].name} has another number"
            )
        units = labels.units or ArmUnit(labels.design, np.zeros((labels.robots, COUNT)))
        stride = max(1, round(labels.rate_hz / rules.SAMPLE_HZ))
        out.append(TrialRows(recording.name, rows, units, seen, recording.time[::stride]))
    return out


def relative_motion(
    recordings: Sequence[Recording],
    motions: Sequence[Motion] = MOTIONS,
    halves: Halves | None = None,
    say: Callable[[str], object] = lambda _: None,
) -> list[Candidate]:
    """Compare explanations of the closed loops, the best one first.

    ``relative_motion([recording])[0].motion`` is ``"rigid"`` if the robots hold one body. A difference in
    ``log_evidence`` of 5 is strong (odds of 150), if the robots are calibrated: errors of the kinematics are not noise,
    and large data make any small misfit evident. Compare ``q_rms`` with these errors.

    Args:
        recordings: trials of the same robots and grasps; bases may stand elsewhere in each.
        motions: motions to try.
        halves: robots (from 1) of both bodies, robot 1 in the first; None to try all divisions that the loops allow.
        say: callback for the name of each stage.

    Raises:
        InputError: a recording is unusable, there are fewer than two robots, or ``halves`` is not a division of them.
    """
    return candidates(trial_rows(recordings), motions, halves, say)


def candidates(
    trials: Sequence[TrialRows],
    motions: Sequence[Motion] = MOTIONS,
    halves: Halves | None = None,
    say: Callable[[str], object] = lambda _: None,
) -> list[Candidate]:
    """Compare explanations of reduced recordings; see ``relative_motion``."""
    robots = trials[0].mean.shape[1]
    if robots < 2:
        raise InputError(f"{trials[0].name}: one robot holds one body; two bodies need two robots or more")
    if halves is not None and (sorted(sum(halves, ())) != list(range(1, robots + 1)) or 1 not in halves[0]):
        raise InputError(f"halves is {halves}; it must divide robots 1 to {robots}, robot 1 in the first")
    poses = [(trial.fine.R_bi[::3], trial.fine.h[::3]) for trial in trials]
    own = [tuple(tuple(i - 1 for i in half) for half in halves)] if halves else _divisions(poses, robots)
    found = []
    for motion in motions:
        for division in own[:1] if motion == "rigid" else own:
            say(f"{motion}, robots {_said(division)}")
            found.append(_candidate(motion, (division[0], division[1]), trials, poses))
    return sorted(found, key=lambda one: -one.log_evidence)


def _said(halves: Sequence[Sequence[int]]) -> str:
    return " | ".join(" ".join(str(i + 1) for i in half) for half in halves)


def _divisions(poses: Sequence[Poses], robots: int) -> list[tuple[tuple[int, ...], ...]]:
    """Return the divisions whose halves are rigid, or nearly as rigid as the best division's."""
    apart = np.zeros((robots, robots))
    for i, j in combinations(range(robots), 2):
        apart[i, j] = max(rigid_residual(one, i, j) for one in poses)
    every = halves_of(robots)
    worst = [
        max((apart[i, j] for half in one for i, j in combinations(half, 2)), default=0.0) for one in every
    ]
    return [one for one, left in zip(every, worst, strict=True) if left <= NEAR * min(worst) or left < 1e-6]


def _candidate(
    motion: Motion, halves: Halves, trials: Sequence[TrialRows], poses: Sequence[Poses]
) -> Candidate:
    for trial in trials:
        trial.adjustment = 0.0
    fitted = solve(Point(start(motion, halves, poses), np.zeros(0)), trials, gain=1.0)
    pair, within = fitted.point.pair, 6 * (trials[0].mean.shape[1] - 2)
    n, chi2, count, log_det = 0, 0.0, 0, 0.0
    for one in fitted.trials:
        S = one.covariance[:, :within, :within] if motion == "loose" else one.covariance
        r = one.residual[:, : S.shape[1]]
        n, count = n + len(r), count + r.size
        chi2 += float(np.sum(r * np.linalg.solve(S, r[..., None])[..., 0]))
        log_det += float(np.sum(np.linalg.slogdet(S)[1]))
    scale = chi2 / count if count else 1.0
    K, value = pair.size + 1, -0.5 * (count * (1.0 + np.log(2.0 * np.pi * scale)) + log_det)
    free = _free(fitted, within)
    if free.shape[1]:
        V = np.atleast_2d(np.cov(free.T))
        value -= 0.5 * n * (np.linalg.slogdet(2.0 * np.pi * V)[1] + len(V))
        K += len(V) * (len(V) + 1) // 2
    value -= 0.5 * K * np.log(n)
    robots = tuple(tuple(i + 1 for i in half) for half in halves)
    q, told = (), motion in ("hinged", "sliding")
    axis_se = pivot_se = 0.0
    if told:
        q = tuple(
            pair.loops(trial.fine.R_bi, trial.fine.h, bases)[1].q
            for trial, bases in zip(trials, pair.bases, strict=True)
        )
        of_joint = fitted.covariance[pair.of_joint, pair.of_joint] * max(1.0, scale)
        axis_se = float(np.sqrt(np.trace(of_joint[5:7, 5:7])))
        pivot_se = float(np.sqrt(np.trace(of_joint[7:9, 7:9])))
    return Candidate(
        motion, (robots[0], robots[1]), float(value), float(np.sqrt(scale)),
        pair.joint.axes[:, 0] if told else None, axis_se,
        pair.joint.pivot if motion == "hinged" else None, pivot_se,
        tuple(trial.fine_time for trial in trials) if told else (), q, fitted,
    )  # fmt: skip


def _free(fitted: Fitted, within: int) -> Array:
    """Return the free coordinates of every row: q, or all six if loose, (n, 0) if rigid."""
    motion = fitted.point.pair.joint.motion
    if motion == "rigid":
        return np.zeros((1, 0))
    parts = [one.residual[:, within:] if motion == "loose" else one.q[:, None] for one in fitted.trials]
    return np.concatenate([part - part.mean(axis=0) for part in parts])
