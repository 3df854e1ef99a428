"""Turn a search result on joint logs into a verdict: causes with values and probabilities, and held-out predictions."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from discrepancy.cause_names import excluded_from
from discrepancy.evidence.findings import Event, Finding, Member, Verdict, with_held
from discrepancy.evidence.judge import Judge
from discrepancy.evidence.parts import Values
from discrepancy.evidence.posterior import Group
from discrepancy.evidence.probability import Odds, odds_of, without_unfounded
from discrepancy.evidence.search import Chosen, Until
from discrepancy.evidence.settings import SETTINGS
from discrepancy.formulas.law import Law
from discrepancy.joints.causes import LINKS
from discrepancy.joints.closed_loop import estimated
from discrepancy.joints.diagnose import Outcome, diagnose, parts_of
from discrepancy.joints.effects import NAMES, absolute, physical
from discrepancy.joints.model import SerialModel
from discrepancy.joints.problem import Given, JointProblem
from discrepancy.joints.servo import Motor, driven_by_voltage, loop_laws, sentences
from discrepancy.joints.signals import Signals
from discrepancy.joints.trials import Trials, at_limits, held_in, notes_of, resting, trials_of
from discrepancy.joints.unlisted import SIGNALS, law_of
from discrepancy.result.traces import Trace
from estimator.arrays import Array
from mocobot_logs.joints.joint_log import JointLog


@dataclass(frozen=True, eq=False)
class Prediction:
    """Prediction of one trial's torques from the other trials.

    Attributes:
        trial: name of the trial.
        before, after: rms of measured minus predicted torque without and with the findings, shape (J,) [N m or N].
        noise: standard deviation of the noise of the rows, shape (J,).
        torque: rms of the measured torque, shape (J,).
        chi2_before, chi2_after: squared residuals over the noise variance, per row.
    """

    trial: str
    before: Array
    after: Array
    noise: Array
    torque: Array
    chi2_before: float
    chi2_after: float


@dataclass(frozen=True, eq=False, kw_only=True)
class JointVerdict(Verdict):
    """Verdict on the model of a robot with revolute and prismatic joints.

    Attributes:
        model: the robot as described.
        parts: signals of the trials, which are whole logs or parts of one.
        measured: joints whose torques are known in all logs, from 0.
        motors: torque per unit of input of drives without torque readings.
        predictions: one for each trial, predicted from the others. A single trial is predicted from itself.
        by_the_others: returns, for the index of a trial, the findings fitted to the other trials, without events.
    """

    model: SerialModel
    parts: Sequence[Signals]
    measured: tuple[int, ...]
    motors: tuple[Motor, ...]
    predictions: tuple[Prediction, ...]
    by_the_others: Callable[[int], tuple[Finding, ...]]


Say = Callable[[str], object]


def judged(
    model: SerialModel,
    logs: Sequence[JointLog],
    *,
    reference: Sequence[JointLog] = (),
    excluded: Sequence[str] = (),
    tolerances: Mapping[str, Mapping[str, float]] | None = None,
    seconds: float | None = None,
    say: Say = lambda _: None,
) -> JointVerdict:
    """Diagnose what a robot's model gets wrong, from joint logs.

    Args:
        model: the robot as described.
        logs: joint logs.
        reference: logs of the same robot in a healthy state. Model errors present in them, too, are not reported.
        excluded: causes to leave out.
        tolerances: prior standard deviations of a healthy robot by cause and parameter, to replace the defaults.
        seconds: time limit of the search [s].
        say: receives a line of text about each step.

    Raises:
        InputError: a log is unusable, or an excluded cause does not exist.
    """
    until = Until(math.inf if seconds is None else time.monotonic() + seconds)
    say("smoothing the logs")
    trials = estimated(model, trials_of(model, logs, reference))
    volts = driven_by_voltage(trials.motors, len(model.joints))
    switched = any(s.enabled is not None and not s.enabled.all() for s in trials.runs)
    given = Given(
        trials.changed if reference else None,
        tuple(map(int, trials.joints)),
        frozenset(motor.joint for motor in trials.motors),
        frozenset(np.flatnonzero(volts).tolist() if switched else ()),
        excluded_from(NAMES, excluded),
        tolerances or {},
    )
    outcome = diagnose(model, trials, SETTINGS, say, given, until)
    say("weighing what else each cause may be")
    outcome = replace(outcome, state=without_unfounded(outcome.search, outcome.state))
    return _JointJudge(model, trials, outcome).verdict([*model.notes, *notes_of([*logs, *reference])])


class _JointJudge(Judge):
    """Turns a search result on joint logs into a verdict."""

    problem: JointProblem

    def __init__(self, model: SerialModel, trials: Trials, outcome: Outcome) -> None:
        self.model, self.trials, self.finished = model, trials, outcome.finished
        odds = odds_of(outcome.search, outcome.state)
        parts, self.series = parts_of(outcome, trials)
        plain = outcome.nothing or outcome.search
        super().__init__(
            outcome.problem, (outcome.search, outcome.state), (plain, plain.fixed(())), parts, odds
        )

    def withheld(self) -> Sequence[Group]:
        return self.problem.withheld

    def verdict(self, notes: Sequence[str]) -> JointVerdict:
        """Build the verdict."""
        logs = [s.log for s in self.trials.runs]
        more = (*at_limits(self.model, self.trials.limited), *resting(logs), *self._notes())
        verdict = JointVerdict(
            **self.told(),
            trials=self.trials.names[: self._changed],
            reference=self.trials.names[self._changed :],
            notes=(*notes, *more),
            finished=self.finished,
            traces=self.traces,
            model=self.model,
            parts=self.trials.signals,
            measured=tuple(map(int, self.trials.joints)),
            motors=self.trials.motors,
            predictions=tuple(self._predicted([o.chosen for o in self.named])),
            by_the_others=self.by_the_others,
        )
        return with_held(verdict, held_in(self.model, self.trials))

    @property
    def _changed(self) -> int:
        runs = [k for k, _ in self.trials.parts]
        return sum(k < self.trials.changed for k in runs)

    @property
    def validated(self) -> bool:
        return self._changed > 1  # the reference says nothing of what has changed

    # --- groups

    def joint(self, cause: str, place: str) -> int | None:
        known = cause not in LINKS and place in self.model.joints
        return self.model.joints.index(place) + 1 if known else None

    def more(self, group: Group) -> Mapping[str, Any]:
        unlisted, joint = group.cause == "unlisted", self.joint(*group.key)
        return {
            "partner": joint - 1 if group.cause == "coupled_drive" and joint else None,
            "shape": {} if group.event or unlisted else absolute(self.problem, group),
            "of": self._signal(group) if unlisted else "",
            "law": self._law(group) if unlisted and group.columns else None,
            "event": self._event(group),
        }

    @staticmethod
    def _signal(group: Group) -> str:
        return list(SIGNALS)[int(dict(group.shape)["signal"])]

    @cache  # noqa: B019
    def _law(self, group: Group) -> Law:
        """Formula of an unlisted law."""
        j, signals = self.model.joints.index(group.place), self.problem.joints
        slides = [bool(x) for x in self.model.slides]
        return law_of(self._signal(group), j, slides, signals[j], signals[j - 1], self.fit_of(group))

    def _event(self, group: Group) -> Event | None:
        if not group.event:
            return None
        shape = dict(group.shape)
        run = int(shape["trial"])
        s = self.trials.runs[run]
        begin, middle = shape["start_s"], (shape["start_s"] + 0.5 * shape["duration_s"]) * s.rate_hz
        part = next(p for p, (k, at) in enumerate(self.trials.parts) if k == run and middle < max(at.stop, 1))
        return Event(part, float(s.time[0] + begin), shape["duration_s"])

    def members(self, group: Group, values: Values) -> tuple[Member, ...]:
        if group.cause == "unlisted":
            law = self._law(group)
            return (Member(group.place, law.joint, *law.numbers),)
        out, (mean, covariance) = [], values
        known = {int(j) for j in self.trials.joints}
        places = (
            [n for j, n in enumerate(self.model.joints) if j in known] if group.members else [group.place]
        )
        for place, columns in zip(places, group.members or (group.columns,), strict=True):
            at, own = self.parts.columns_of(list(columns)), replace(group, place=place)
            numbers, errors = physical(self.problem, own, mean[at], covariance[np.ix_(at, at)])
            out.append(Member(place, self.joint(*own.key), numbers, errors))
        return tuple(out)

    def tolerances(self, group: Group) -> Mapping[str, float]:
        sizes = np.array([self.problem.tolerance[k] for k in group.columns])
        if group.cause == "gravity_direction" and self.problem.mount is not None:
            return physical(self.problem, group, np.array([0.0, 0.0, 1.0]), np.diag(sizes**2))[1]
        return physical(self.problem, group, sizes, np.diag(sizes**2))[0]

    def sizes(self, group: Group, sizes: Array, seen: Array) -> Mapping[str, float | None] | None:
        if group.cause == "payload":
            return {NAMES[group.cause][0]: float(sizes[0]) if seen[0] else None}
        if not (all(seen) or (any(seen) and group.cause != "gravity_direction")):
            return None
        value, _ = physical(self.problem, group, np.where(seen, sizes, 0.0), np.diag(sizes**2))
        return {n: abs(x) if ok else None for (n, x), ok in zip(value.items(), seen, strict=True)}

    # --- held-out predictions

    def by_the_others(self, trial: int) -> tuple[Finding, ...]:
        """Findings that a simulation can represent, with values fitted to the other parts.

        Tolerances and law errors are fixed at zero, as in the simulation. The findings explain all effects.
        """
        named = [o for o in self.named if not o.chosen.group.event and o.chosen.group.cause != "unlisted"]
        prior = self.prior([o.chosen for o in named], tolerated=False)
        values = self.parts.values(prior, trial)
        return tuple(f for o in named for f in self.findings(o, values))

    def _predicted(self, kept: Sequence[Chosen]) -> Iterator[Prediction]:
        """Torques of each trial without and with the findings; what the reference has, too, is in both."""
        parts, alone = self.parts, self.parts.count > self._changed == 1
        both = self.prior((), tolerated=parts.count > self._changed), self.prior(kept)
        for t, name in enumerate(self.trials.names[: self._changed]):
            sides, chi2 = [], []
            for prior in both:
                x = parts.mean(prior) if alone else parts.predicted(prior, t)
                sides.append(self._wide(np.sqrt(np.mean(self.series[t].left(x) ** 2, axis=0))))
                chi2.append(float(parts.left(x, t) / parts.rows[t].sum()))
            own = self.trials.signals[t].torque
            torque = self._wide(np.sqrt(np.mean(own**2, axis=0))[self.trials.joints])
            yield Prediction(name, sides[0], sides[1], self._wide(self._noise(t)), torque, chi2[0], chi2[1])

    def _wide(self, sizes: Array) -> Array:
        """Expand values of the joints with torques to all joints; 0 for the others."""
        out = np.zeros(len(self.model.joints))
        out[self.trials.joints] = sizes
        return out

    def _noise(self, t: int) -> Array:
        """Noise standard deviation of a part in physical units, for each channel."""
        rows = self.parts.rows[t]
        mean = np.sum(rows * self.state.posterior.variance, axis=1) / rows.sum(axis=1)
        return np.sqrt(mean) * self.series[t].unit

    # --- notes and traces

    def _notes(self) -> Iterator[str]:
        for motor in self.trials.motors:
            yield motor.sentence(self.model.joints[motor.joint])
        yield from sentences(loop_laws([s.log for s in self.trials.runs]), self.model.joints)
        bands = self.problem.cells.bands
        yield f"Rows are what torques have below {bands.edges_hz[-1]:.3g} Hz."
        if self.problem.changed is not None:
            yield (
                "What is wrong with the model in the reference, too, is fitted to all logs together and is no news; "
                "what is named has changed."
            )

    def traces(self) -> list[Trace]:
        """Residuals of each part, as modelled and with everything that was found."""
        x = self.state.posterior.mean[self.parts.active]
        each = [self.parts.columns_of(columns) for o in self.named for columns in self._columns(o)]
        out = []
        for t, name in enumerate(self.trials.names[: self._changed]):
            own, s, sigma = self.series[t], self.trials.signals[t], self._noise(t)
            before, after, time = own.left(np.zeros(len(x))), own.left(x), own.time
            speed = np.interp(time, s.time, np.sqrt(np.mean((s.dq / s.typical) ** 2, axis=1)))
            quantities = {"speed": speed}
            for j in range(s.q.shape[1]):
                quantities[f"position of joint {j + 1}"] = np.interp(time, s.time, s.q[:, j])
            wide = np.broadcast_to(sigma, before.shape)
            causes = tuple(own.columns[:, :, at] @ x[at] * own.unit for at in each)
            white = before / sigma, after / sigma
            measured = own.measured * own.unit
            each_row = name, time, len(time), own.rate_hz, before, after, wide, *white, quantities
            out.append(Trace(*each_row, measured, causes))
        return out

    def _columns(self, o: Odds) -> Iterator[list[int]]:
        """Columns of each finding of a cause; of a cause of all joints at one joint, those of that joint."""
        c, found = o.chosen.group, self.findings(o)
        known = [self.model.joints[j] for j in self.trials.joints]
        of = {} if found[0].place == c.place or not c.members else dict(zip(known, c.members, strict=True))
        for f in found:
            yield [*of[f.place]] if f.place in of else [*c.columns, *o.chosen.forms]
