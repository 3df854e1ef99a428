"""A payload that is not rigid: two bodies on a hinge or slide, held by different robots.

Such a payload leaves no rigid model around which causes could be searched, so this verdict comes first. Every division
of the robots and every joint competes by the evidence of the closed kinematic loops (``estimator.two_bodies``). Errors
of the kinematics are not noise, and a free coordinate absorbs some of them, so a joint must also leave far less of the
loops' misfit than one rigid body does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from discrepancy.evidence.settings import SETTINGS
from discrepancy.numbers import three_digits
from discrepancy.result.folder import REPORT
from discrepancy.result.json import plain
from discrepancy.result.read import AS_FOUND, FORMAT, NAME, VERSION
from discrepancy.result.report import format_verdict
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import write_json, write_text
from estimator.recording.model import Recording
from estimator.two_bodies.estimate import estimate_two_bodies
from estimator.two_bodies.fit import TrialRows
from estimator.two_bodies.relative import Candidate, candidates, trial_rows
from estimator.two_bodies.result import TwoBodies
from estimator.two_bodies.start import rigid_residual
from estimator.two_bodies.team import Motion, Pair
from mocobot_sim.scene.payload import PayloadJoint, two_body_mjcf

LEAST_NATS = 12.0
"""Least gain in log evidence over one rigid body. Chosen: more than the prior odds of any listed cause cost."""
LEAST_DROP = 3.0
"""Least ratio of the loops' residuals, one rigid body over the joint. Chosen: without a joint, uncalibrated robots
reach 1.5."""
LEAST_M = 0.005
"""Least motion of the only grasp of a body by the joint, rms [m]. Chosen: flexible grasps and bases, which other causes
describe, reach it rarely."""
LEAST_MOVING, FAST = 0.05, 0.2
"""Least share of the time in which the joint moves faster than this share of its rms speed. Chosen: a base that slips
once moves less."""
LEAST_RETURN = 0.3
"""Least share of the joint's mean square that a steady drift leaves. Chosen: a base that creeps only drifts."""
APART = 2e-3
"""Root of squared misfits of two robots' relative pose [rad, m] below which one rigid body is not doubted. Chosen:
calibrated robots reach 3e-4."""
MOTIONS: tuple[Motion, ...] = ("rigid", "hinged", "sliding")
LEVER_M = 0.5
"""Length that converts angles of the loops to distances [m]. Chosen: half the size of a payload."""
SAMPLES = 400
"""Samples of a trial that measure how its loops close. Chosen."""
Say = Callable[[str], object]


def joint_of(found: Sequence[Candidate]) -> Candidate | None:
    """Return the joint that the loops demand, from candidates with the best first; None if one rigid body will do."""
    joint = next((one for one in found if one.axis is not None), None)
    rigid = next((one for one in found if one.motion == "rigid"), None)
    if joint is None or rigid is None:
        return None
    gain, drop = joint.log_evidence - rigid.log_evidence, rigid.noise / joint.noise
    return joint if gain > LEAST_NATS and drop > LEAST_DROP and _moves(joint) else None


def _moves(joint: Candidate) -> bool:
    """Whether the joint moves too far and too often, to and fro, to be a flexible grasp or a base that slips."""
    pairs = list(zip(joint.q, joint.time, strict=True))
    speed = np.abs(np.concatenate([np.gradient(q, t) for q, t in pairs]))
    off = np.concatenate([q - np.polyval(np.polyfit(t, q, 1), t) for q, t in pairs])
    steady = np.concatenate([q - q.mean() for q, _ in pairs])
    returns = float(np.mean(off**2) / np.mean(steady**2))
    moving = float(np.mean(speed > FAST * np.sqrt(np.mean(speed**2))))
    arms = [_arm(joint, half[0]) for half in joint.halves if len(half) == 1]
    return (
        moving > LEAST_MOVING and returns > LEAST_RETURN and all(joint.q_rms * arm > LEAST_M for arm in arms)
    )


def _arm(joint: Candidate, robot: int) -> float:
    """Motion of the grasp of the first robot of a body by the joint, per unit of the joint [1 or m]."""
    if joint.pivot is None or joint.axis is None:
        return 1.0
    p = np.zeros(3) if robot == 1 else joint.fitted.point.pair.joint.p_0
    return float(np.linalg.norm(np.cross(p - joint.pivot, joint.axis)))


def _robots(half: Sequence[int]) -> str:
    return f"robot{'s' * (len(half) > 1)} {', '.join(map(str, half))}"


@dataclass(frozen=True, eq=False)
class TwoBodyDiagnosed:
    """The verdict that the payload has two bodies.

    Attributes:
        recordings: the trials.
        found: explanations of the loops, best first.
        joint: the one that is named.
        estimate: both bodies by encoders and torques; None if the robots are not calibrated well enough.
        why: reason why there is no estimate.
        closes: rms misfit [m] of the loops of every trial left out of the fit: one rigid body, two on the joint; empty
            for a single trial.
    """

    recordings: tuple[Recording, ...]
    found: tuple[Candidate, ...]
    joint: Candidate
    estimate: TwoBodies | None
    why: str
    closes: tuple[tuple[float, float], ...]

    @cached_property
    def values(self) -> dict[str, Any]:
        """JSON values; see ``discrepancy.result.json``. What only a rigid payload has is empty or null."""
        cause = self._cause()
        names = [recording.name for recording in self.recordings]
        return plain({
            "format": FORMAT, "version": VERSION, "machine": "team", "finished": True, "recordings": names,
            "reference": [], "prior_odds": float(np.exp(-SETTINGS.cause_nats)),
            "verdict": "explained" if self.joint.noise < LEAST_DROP else "partly_explained",
            "causes": [cause], "places": [], "suspected": [], "scatter": [],
            "evidence": {"before": [self._candidate(one) for one in self.found], "after": None}, "gain": None,
            "not_simulated": "a rigid payload cannot follow these commands", "rollouts": None, "undecidable":
            self._undecidable(), "detection_limits": [], "residual": self._residual(),
            "remains": self._remains(), "notes": self._notes(),
        })  # fmt: skip

    def _cause(self) -> dict[str, Any]:
        j = self.joint
        rigid = next(one for one in self.found if one.motion == "rigid")
        odds = np.array([one.log_evidence for one in self.found])
        share = np.exp(odds - odds.max())
        share /= share.sum()
        own = self.found.index(j)
        rivals = [
            self._place(one) | {"probability": float(p), "evidence_gap": float(j.log_evidence - one.log_evidence),
                                "chi2_per_n": None, "ambiguous": j.log_evidence - one.log_evidence < 3.0,
                                "separate": SEPARATE}
            for one, p in zip(self.found, share, strict=True) if one is not j
        ]  # fmt: skip
        held = None
        if self.closes:
            before, after = (float(np.sum(np.square(each))) for each in zip(*self.closes, strict=True))
            held = 1.0 - after / before
        return self._place(j) | {
            "sentence": self._sentence(), "parameters": self._parameters(), "members": [],
            "told": [{key: self._place(j)[key] for key in ("cause", "place", "name")}], "event": None, "at": None,
            "explained": {"in_sample": 1.0 - (j.noise / rigid.noise) ** 2, "held_out": held},
            "probability": float(share[own]), "over_nothing": j.log_evidence - rigid.log_evidence,
            "share_left": j.noise / rigid.noise, "instead": {"nothing": 0.0, "unlisted": 0.0}, "folds": [],
            "law": None, "shape": {}, "separate": SEPARATE, "alternatives": [r for r in rivals if r["cause"]],
        }  # fmt: skip

    def _place(self, one: Candidate) -> dict[str, Any]:
        first, second = map(_robots, one.halves)
        rigid = one.motion == "rigid"
        kind = "rigid payload" if rigid else f"{one.motion} payload"
        name = kind if rigid else f"{kind} between {first} and {second}"
        return {"cause": "" if rigid else "payload_joint", "family": "payload_joint", "kind": kind, "name": name,
                "robot": None, "joint": None, "place": "payload"}  # fmt: skip

    def _candidate(self, one: Candidate) -> dict[str, Any]:
        rigid = next(r for r in self.found if r.motion == "rigid")
        return self._place(one) | {
            "at": None,
            "nats": one.log_evidence - rigid.log_evidence,
            "needed": LEAST_NATS,
        }

    def _parameters(self) -> dict[str, dict[str, float | None]]:
        j, unit = self.joint, "m" if self.joint.motion == "sliding" else "rad"
        assert j.axis is not None
        x, y, z = j.axis
        out: dict[str, dict[str, float | None]] = {
            "axis_elevation_rad": {"value": float(np.arcsin(np.clip(z, -1.0, 1.0))), "se": j.axis_se_rad},
            "axis_heading_rad": {
                "value": float(np.arctan2(y, x)),
                "se": j.axis_se_rad / max(np.hypot(x, y), 1e-3),
            },
        }
        if j.pivot is not None:
            for name, value in zip("xyz", j.pivot, strict=True):
                out[f"pivot_{name}_m"] = {"value": float(value), "se": j.pivot_se_m}
        out[f"motion_rms_{unit}"] = {"value": j.q_rms, "se": None}
        top = "N" if unit == "m" else "Nm"
        for term, ending in (("stiffness", top), ("damping", f"{top}s")):
            if self.estimate is not None and term in self.estimate.law:
                value, se = self.estimate.value(term)
                out[f"{term}_{ending}_per_{unit}"] = {"value": value, "se": se}
        return out

    def _sentence(self) -> str:
        j = self.joint
        assert j.axis is not None
        first, second = map(_robots, j.halves)
        axis = ", ".join(f"{x:.3f}" for x in j.axis)
        if j.motion == "sliding":
            line, size = f"slides along ({axis}) of {{1}}", f"{1e3 * j.q_rms:.1f} mm"
        else:
            assert j.pivot is not None
            pivot = ", ".join(f"{x:.3f}" for x in j.pivot)
            line, size = (
                f"is hinged about ({axis}) through ({pivot}) m of {{1}}",
                f"{np.rad2deg(j.q_rms):.2f} deg",
            )
        spring = ""
        if self.estimate is not None and "stiffness" in self.estimate.law:
            unit = "N/m" if j.motion == "sliding" else "N m/rad"
            value, se = self.estimate.value("stiffness")
            spring = f", with a spring of {value:.3g} +- {se:.2g} {unit}"
        return f"The payload {line} between {first} and {second}{spring}; the joint moves by {size} (rms)."

    def _residual(self) -> dict[str, Any]:
        rigid = next(one for one in self.found if one.motion == "rigid")
        says = [f"The loops of {word} leave {three_digits(one.noise)} times the encoders' noise."
                for word, one in (("one rigid payload", rigid), ("two bodies on the joint", self.joint))]  # fmt: skip
        before, after = rigid.noise**2, self.joint.noise**2
        return {
            "chi2_per_n": after, "chi2_per_n_tolerated": before, "unlisted_nats": 0.0,
            "signature": {"chi2_per_n": after, "sentence": says[1]},
            "nominal": {"chi2_per_n": before, "signature": {"chi2_per_n": before, "sentence": says[0]}},
        }  # fmt: skip

    def _remains(self) -> list[str]:
        out = []
        if self.closes:
            before, after = (
                1e3 * np.sqrt(np.mean(np.square(each))) for each in zip(*self.closes, strict=True)
            )
            out.append(
                f"In trials left out of the fit the loops close within {after:.2g} mm with the joint, and "
                f"{before:.2g} mm without it."
            )
        return [
            *out,
            "Causes beside the joint were not searched, because they are searched around a rigid payload.",
        ]

    def _notes(self) -> list[str]:
        return [f"There is no estimate of both bodies: {self.why}."] if self.why else []

    def _undecidable(self) -> list[dict[str, str]]:
        j, out = self.joint, []
        alone = [half[0] for half in j.halves if len(half) == 1]
        for robot in alone:
            if j.motion == "sliding":
                out.append({"what": f"a slide in the payload, or a base of robot {robot} that slides along that line",
                            "why": "no other robot holds that body", "remedy": "block the wheels"})  # fmt: skip
            out.append({"what": f"a joint in the payload, or a flexible grasp of robot {robot}",
                        "why": "only one robot holds that body", "remedy": SEPARATE})  # fmt: skip
        return out

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON values with units in the keys."""
        return self.values

    def __str__(self) -> str:
        """Report of a few sentences and a table."""
        return format_verdict(self.values)

    def verbose_text(self) -> str:
        """Report with all details."""
        return format_verdict(self.values, verbose=True)

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> None:
        """Write JSON, report and, with an estimate, ``as_found/payload.xml`` into an existing folder.

        Raises:
            InputError: a file cannot be written.
        """
        if self.estimate is not None and (xml := as_found(self.estimate)) is not None:
            (folder / AS_FOUND).mkdir(exist_ok=True)
            write_text(folder / AS_FOUND / "payload.xml", xml)
        write_json(folder / NAME, self.values | more)
        write_text(folder / REPORT, f"{self.verbose_text()}\n")


SEPARATE = "mark both sides of the suspected joint, and look whether they move against each other"


def as_found(estimate: TwoBodies) -> str | None:
    """Write the MJCF of an estimated payload for ``simulate --payload``; None if the masses cannot be divided."""
    bodies = estimate.bodies
    if bodies is None:
        return None
    X_1i = [np.eye(4) for _ in range(estimate.robots)]
    second = [i + 1 in estimate.halves[1] for i in range(estimate.robots)]
    for i, on in enumerate(second):
        R, p = estimate.R_ki[i], estimate.p_ki[i]
        X_1i[i][:3, :3] = estimate.R_0 @ R if on else R
        X_1i[i][:3, 3] = estimate.p_0 + estimate.R_0 @ p if on else p
    terms = {term: max(0.0, estimate.value(term)[0]) for term in estimate.law}
    stiffness = terms.get("stiffness", 0.0)
    joint = PayloadJoint(
        slides=estimate.motion == "sliding", axis_1=estimate.axes[:, 0],
        pivot_1=np.zeros(3) if estimate.pivot is None else estimate.pivot, stiffness=stiffness,
        damping=terms.get("damping", 0.0),
        rest=estimate.value("offset")[0] / stiffness if stiffness else 0.0, second=tuple(second), joint=-1,
    )  # fmt: skip
    return two_body_mjcf([(b.mass, b.com, b.inertia) for b in bodies[:2]], joint, np.array(X_1i))


def find_joint(recordings: Sequence[Recording], say: Say = lambda _: None) -> TwoBodyDiagnosed | None:
    """Look for two bodies in recordings of one team; None if one rigid payload, or no joint, explains the loops."""
    try:
        rows = trial_rows(recordings)
    except InputError:  # too short
        return None
    if not any(map(_disagree, rows)):
        return None
    say("two bodies")
    try:
        found = candidates(rows, MOTIONS)
    except (InputError, np.linalg.LinAlgError):
        return None
    joint = joint_of(found)
    if joint is None:
        return None
    estimate, why = None, ""
    try:
        say("both bodies")
        estimate = estimate_two_bodies(recordings)
    except InputError as error:
        why = str(error)
    say("trials left out")
    rigid = next(one for one in found if one.motion == "rigid")
    return TwoBodyDiagnosed(
        tuple(recordings), tuple(found), joint, estimate, why, _left_out(rows, rigid, joint)
    )


def _disagree(trial: TrialRows) -> bool:
    poses, robots = (trial.fine.R_bi[::3], trial.fine.h[::3]), trial.mean.shape[1]
    return any(rigid_residual(poses, i, j) > APART for i in range(robots) for j in range(i))


def _left_out(rows: list[TrialRows], rigid: Candidate, joint: Candidate) -> tuple[tuple[float, float], ...]:
    """How the loops of each trial close with grasps and joint of the others: one rigid body, two on the joint [m]."""
    out: list[tuple[float, float]] = [(0.0, 0.0)] * len(rows)
    folds = [range(k, len(rows), 2) for k in (0, 1)] if len(rows) > 1 else []
    for fold in folds:
        others = [row for k, row in enumerate(rows) if k not in fold]
        pairs = [
            candidates(others, (one.motion,), joint.halves)[0].fitted.point.pair for one in (rigid, joint)
        ]
        for k in fold:
            bases = (one.fitted.point.pair.bases[k] for one in (rigid, joint))
            each = [_closes(pair, rows[k], at) for pair, at in zip(pairs, bases, strict=True)]
            out[k] = (each[0], each[1])
    return tuple(out) if folds else ()


def _closes(pair: Pair, trial: TrialRows, bases: Any) -> float:
    """Rms misfit of the loops of a trial with given grasps and joint, with its bases where they fit best [m]."""
    every = max(1, len(trial.fine.h) // SAMPLES)
    R, h = trial.fine.R_bi[::every], trial.fine.h[::every]
    within = 6 * (len(pair.p) - 2)

    def misfit(x: Array) -> Array:
        left, (_, off), _ = pair.loops(R, h, bases.moved(x))
        loops = left.reshape(len(R), -1, 6) * ([LEVER_M] * 3 + [1.0] * 3)
        angles = {"hinged": 2, "sliding": 3}.get(pair.joint.motion, 3)
        own = off * np.where(np.arange(off.shape[1]) < angles, LEVER_M, 1.0)
        return np.concatenate([loops.reshape(len(R), within), own], axis=1).ravel()

    x = least_squares(misfit, np.zeros(4 * (len(pair.p) - 1)), x_scale="jac").x
    return float(np.sqrt(np.sum(misfit(x) ** 2) / len(R) / (len(pair.p) - 1)))
