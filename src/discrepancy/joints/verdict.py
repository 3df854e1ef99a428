"""From a search to a verdict: causes with values, probabilities, and what they are worth on data not used."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from discrepancy.causes.excluded import excluded_from
from discrepancy.evidence.odds import Odds, borne_out, odds_of
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.evidence.search import Chosen, Search, State
from discrepancy.evidence.settings import SETTINGS
from discrepancy.joints.causes import LINKS
from discrepancy.joints.diagnose import Outcome, Until, diagnose
from discrepancy.joints.findings import (
    Event,
    Finding,
    Foretold,
    JointVerdict,
    Limit,
    Member,
    Offer,
    Rival,
    Scatter,
    Verdict,
)
from discrepancy.joints.given import Given
from discrepancy.joints.model import SerialModel
from discrepancy.joints.parts import Parts
from discrepancy.joints.servo.loop import loop_laws, sentences
from discrepancy.joints.servo.motor import driven_by_voltage
from discrepancy.joints.trials import Trials, at_limits, notes_of, resting, trials_of
from discrepancy.joints.unlisted import SIGNALS
from discrepancy.joints.values import NAMES, absolute, physical
from discrepancy.result.traces import Trace
from estimator.arrays import Array
from mocobot_logs.joints.joint_log import JointLog

NAMED = 0.5
"""Least probability of the told set of a cause that is named."""
SIGNIFICANT_SE = 3.0
"""Standard errors from which a member of a kind counts as off."""
SCATTER = 3.0
"""Tolerances (root mean square over a kind) from which a robot is miscalibrated."""
NOTICED = 1.28
"""Standard errors beyond the threshold at which nine in ten are noticed. Derived: the normal quantile of 90 %."""
OFFERS, RIVALS = 12, 6
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
    """Find out what a model of a robot of joints gets wrong.

    Args:
        model: the robot as described.
        logs: of its joints.
        reference: logs of the same robot while it was well: what is wrong with the model there, too, is no news.
        excluded: causes left out of the tables.
        tolerances: standard deviations by cause and parameter of a healthy robot in place of the usual ones.
        seconds: after which the search ends with what it has.
        say: takes a line about each step.

    Raises:
        InputError: a log cannot be used, or a cause to be excluded does not exist.
    """
    until = Until(math.inf if seconds is None else time.monotonic() + seconds)
    say("smoothing the logs")
    trials = trials_of(model, logs, reference)
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
    outcome = replace(outcome, state=borne_out(outcome.search, outcome.state))
    odds = odds_of(outcome.search, outcome.state)
    parts = Parts.of(outcome, trials)
    return _Judge(model, trials, outcome, parts, odds).verdict([*notes_of([*logs, *reference])])


class _Judge:
    """What one search found, told."""

    def __init__(
        self, model: SerialModel, trials: Trials, outcome: Outcome, parts: Parts, odds: Sequence[Odds]
    ) -> None:
        self.model, self.trials, self.outcome, self.parts = model, trials, outcome, parts
        self.problem, self.search, self.state = outcome.problem, outcome.search, outcome.state
        self.odds = sorted(odds, key=lambda o: -o.over_nothing)
        self.whole = parts.posterior(parts.but(None), parts.prior)

    def verdict(self, notes: Sequence[str]) -> JointVerdict:
        kept, suspected = [], []
        for o in self.odds:
            (kept if self._is_named(o) else suspected).append(o)
        findings = self._with_worth(kept)
        doubtful = [f for o in suspected for f in self._findings(o)]
        scatter = self._scatter()
        chi2 = self._chi2()
        foretold = self._foretold([o.chosen for o in kept])
        plain = self.outcome.nothing or self.search
        nothing = plain.fixed(())
        logs = [s.log for s in self.trials.runs]
        return JointVerdict(
            model=self.model,
            parts=self.trials.signals,
            trials=self.trials.names,
            motors=self.trials.motors,
            reference=self.trials.names[self._changed :],
            verdict=self._word(findings, doubtful, scatter, chi2),
            findings=tuple(findings),
            suspected=tuple(doubtful),
            scatter=tuple(scatter),
            foretold=tuple(foretold),
            validated=len(self.parts.cells) > 1,
            chi2_per_n=chi2,
            before=tuple(self._offers(plain, nothing)),
            after=tuple(self._offers(self.search, self.state)),
            limits=tuple(self._limits()),
            notes=(*notes, *at_limits(self.model, self.trials.limited), *resting(logs), *self._notes()),
            finished=self.outcome.finished,
            by_the_others=self.by_the_others,
            traces=self.traces,
        )

    @property
    def _changed(self) -> int:
        runs = [k for k, _ in self.trials.parts]
        return sum(k < self.trials.changed for k in runs)

    # --- causes

    @staticmethod
    def _is_named(o: Odds) -> bool:
        """Whether something is there, and it may be the cause whose values were fitted, or is unlisted."""
        nothing = sum(r.probability for r in o.rivals if r.group is None)
        own = o.chosen.group
        told = [g for g in o.told() if g]
        kin = [g for g in told if g.key == own.key or (own.family and g.family == own.family)]
        return nothing < 1.0 - NAMED and bool(kin or [g for g in told[:1] if g.cause == "unlisted"])

    def _joint(self, cause: str, place: str) -> int | None:
        known = cause not in LINKS and place in self.model.joints
        return self.model.joints.index(place) + 1 if known else None

    def _findings(self, o: Odds, values: Posterior | None = None) -> list[Finding]:
        """One finding; members of a kind of which less than half are off are findings of their own."""
        c, probability = o.chosen.group, o.probability
        first = next((r for r in o.rivals if r.probability > o.probability), None)
        if first and first.group and first.group.cause == "unlisted":  # what stands for it is not what it is
            c, probability = first.group, first.probability
        open_ = sum(r.probability for r in o.rivals if r.group and r.group.cause == "unlisted")
        nothing = sum(r.probability for r in o.rivals if r.group is None)
        listed = [r for r in o.rivals if r.group and r.group.cause != "unlisted"]
        kin = sum(r.probability for r in listed if r.group and c.family and r.group.family == c.family)
        unlisted = c.cause == "unlisted"
        rivals = tuple(
            Rival(r.group.cause, r.group.place, self._joint(*r.group.key), r.probability,
                  float(np.log(max(o.probability, 1e-12) / max(r.probability, 1e-12))))
            for r in o.rivals[:RIVALS] if r.group is not None
        )  # fmt: skip
        plain = Finding(
            cause="unlisted" if unlisted else c.cause,
            place=c.place,
            joint=self._joint(*c.key),
            members=() if unlisted else self._members(c, values or self.whole),
            probability=probability + kin,
            over_nothing=o.over_nothing,
            nothing=nothing,
            unlisted=open_,
            partner=self._partner(c),
            shape={} if c.event or unlisted else absolute(self.problem, c),
            of=list(SIGNALS)[int(dict(c.shape)["signal"])] if c.cause == "unlisted" else "",
            event=self._event(c),
            rivals=rivals,
            told=tuple(g.key for g in o.told() if g),
        )
        off = [m for m, k in zip(plain.members, c.members, strict=False) if self._is_off(k)]
        if not off or 2 * len(off) >= len(plain.members):
            return [plain]
        return [replace(plain, place=m.place, joint=m.joint, members=(m,)) for m in off]

    def _is_off(self, columns: Sequence[int]) -> bool:
        """Whether a value is beyond its standard error and a healthy robot's tolerance."""
        at = self.parts.columns_of(list(columns))
        usual = np.array([self.problem.tolerance[k] for k in columns])
        size = np.sqrt(np.diag(self.whole.covariance)[at] + usual**2)
        return bool(np.any(np.abs(self.whole.mean[at]) > SIGNIFICANT_SE * size))

    def _partner(self, group: Group) -> int | None:
        joint = self._joint(*group.key)
        return joint - 1 if group.cause == "coupled_drive" and joint else None

    def _event(self, group: Group) -> Event | None:
        if not group.event:
            return None
        shape = dict(group.shape)
        run = int(shape["trial"])
        s = self.trials.runs[run]
        begin, middle = shape["start_s"], (shape["start_s"] + 0.5 * shape["duration_s"]) * s.rate_hz
        part = next(p for p, (k, at) in enumerate(self.trials.parts) if k == run and middle < max(at.stop, 1))
        return Event(part, float(s.time[0] + begin), shape["duration_s"])

    def _members(self, group: Group, posterior: Posterior) -> tuple[Member, ...]:
        out = []
        places = self.model.joints if group.members else (group.place,)
        if group.members:
            known = {int(j) for j in self.trials.joints}
            places = tuple(n for j, n in enumerate(self.model.joints) if j in known)
        for place, columns in zip(places, group.members or (group.columns,), strict=True):
            at = self.parts.columns_of(list(columns))
            own = replace(group, place=place)
            values, errors = physical(
                self.problem, own, posterior.mean[at], posterior.covariance[np.ix_(at, at)]
            )
            out.append(Member(place, self._joint(*own.key), values, errors))
        return tuple(out)

    def by_the_others(self, trial: int) -> tuple[Finding, ...]:
        """The findings that a simulation can have, with values fitted to the other parts.

        They are alone, as in a simulation: tolerances and laws' errors do not take a share of what they do.
        """
        lasting = [o for o in self.odds if not o.chosen.group.event and o.chosen.group.cause != "unlisted"]
        named = [o for o in lasting if self._is_named(o)]
        prior = self._prior([o.chosen for o in named], tolerated=False)
        posterior = self.parts.posterior(self.parts.but(trial), prior)
        return tuple(f for o in named for f in self._findings(o, posterior))

    # --- what they are worth

    def _prior(self, chosen: Sequence[Chosen], *, tolerated: bool = True) -> Array:
        """Variances with some of the found causes in the model; without tolerances on request."""
        prior = self.parts.prior.copy()
        if not tolerated:
            own = {k for c in chosen for k in c.group.columns}
            kept = self.parts.local.copy()
            kept[self.parts.columns_of(sorted(own))] = True
            return np.where(kept, prior, 0.0)
        kept = {k for c in chosen for k in (*c.group.columns, *c.forms)}
        nominal = self.problem.prior(chosen, self.state.posterior.mean)
        for c in self.state.chosen:
            for k in {*c.group.columns, *c.forms} - kept:
                prior[self.parts.columns_of([k])] = nominal[k] if k < len(nominal) else 0.0
        return prior

    def _with_worth(self, kept: Sequence[Odds]) -> list[Finding]:
        """Findings with the shares of the misfit that they remove one after another, and nats by part."""
        steps = [self._prior([o.chosen for o in kept[:k]], tolerated=False) for k in range(len(kept) + 1)]
        whole = self.parts.but(None)
        variance = self.state.posterior.variance
        left = []
        for prior in steps:
            squares, _ = whole.left(self.parts.posterior(whole, prior).mean, np.zeros((len(prior),) * 2))
            left.append(float(np.sum(squares / variance)))
        several = len(self.parts.cells) > 1
        each = (
            [[float(np.sum(s)) for _, s in self.parts.foretold(prior)] for prior in steps] if several else []
        )
        held = [sum(parts) for parts in each]
        done = []
        for k, o in enumerate(kept):
            share = _share(left, k, float(np.sum(whole.rows)))
            lasts = several and not o.chosen.group.event
            out = _share(held, k, float(np.sum(whole.rows))) if lasts else None
            folds = tuple(0.5 * (a - b) for a, b in zip(each[k], each[k + 1], strict=True)) if lasts else ()
            done += [replace(f, in_sample=share, held_out=out, folds=folds) for f in self._findings(o)]
        return done

    def _foretold(self, kept: Sequence[Chosen]) -> Iterator[Foretold]:
        both = [self.parts.foretold(prior) for prior in (self._prior((), tolerated=False), self._prior(kept))]
        variance, rows = self.state.posterior.variance, [c.rows for c in self.parts.cells]
        for t, name in enumerate(self.trials.names[: self._changed]):
            sides, chi2 = [], []
            for side in both:
                left, squares = side[t]
                wide = np.zeros(len(self.model.joints))
                wide[self.trials.joints] = np.sqrt(np.mean(left**2, axis=0))
                sides.append(wide)
                chi2.append(float(squares.sum() / rows[t].sum()))
            noise, torque = np.zeros(len(self.model.joints)), np.zeros(len(self.model.joints))
            mean = np.sum(rows[t] * variance, axis=1) / rows[t].sum(axis=1)
            noise[self.trials.joints] = np.sqrt(mean) * self.parts.unit[t]
            own = self.trials.signals[t].torque
            torque[self.trials.joints] = np.sqrt(np.mean(own**2, axis=0))[self.trials.joints]
            yield Foretold(name, sides[0], sides[1], noise, torque, chi2[0], chi2[1])

    def _chi2(self) -> tuple[float, float, float]:
        """Squares left over the floor's variance, per row: as modelled, with tolerances, with the causes."""
        plain = self.outcome.nothing or self.search
        cells = plain.problem.cells
        nominal = np.array([c.squares for c in cells.channels])
        out = [float(np.sum(nominal / plain.floor) / cells.rows.sum())]
        for search, state in ((plain, plain.fixed(())), (self.search, self.state)):
            cells, p = search.problem.cells, state.posterior
            cells.truncate(len(p.prior))
            left, fitted = cells.left(p.mean, p.covariance)
            free = np.maximum(cells.rows - fitted / p.variance, 0.05 * cells.rows)
            out.append(float(np.sum(left / search.floor) / free.sum()))
        return out[0], out[1], out[2]

    def _word(
        self,
        findings: Sequence[Finding],
        doubtful: Sequence[Finding],
        scatter: Sequence[Scatter],
        chi2: tuple[float, float, float],
    ) -> Verdict:
        clean = chi2[2] <= self.search.settings.clean_chi2
        listed = [f for f in findings if f.cause != "unlisted"]
        if listed:
            return "explained" if clean and len(listed) == len(findings) else "partly_explained"
        if findings or not clean or any(f.nothing < 1.0 - NAMED for f in doubtful):
            return "unexplained"
        return "miscalibrated" if scatter else "consistent"

    # --- what else there is to tell

    def _scatter(self) -> list[Scatter]:
        """Kinds whose tolerated members are off by several tolerances, root mean square."""
        taken = {k for c in self.state.chosen for k in c.group.columns}
        kinds: dict[str, list[tuple[Group, float]]] = {}
        p = self.state.posterior
        for g in (*self.problem.groups, *self.problem.withheld):
            if g.members or (g.shape and any(v for _, v in g.shape)) or taken & set(g.columns):
                continue
            sizes = [self.problem.tolerance[k] for k in g.columns]
            if all(sizes):
                off = float(np.mean([(p.mean[k] / s) ** 2 for k, s in zip(g.columns, sizes, strict=True)]))
                kinds.setdefault(g.cause, []).append((g, off))
        out = []
        for cause, each in kinds.items():
            factor = float(np.sqrt(np.mean([off for _, off in each])))
            if factor > SCATTER:
                far = sorted(each, key=lambda pair: -pair[1])
                members = tuple(m for g, _ in far for m in self._members_of(g))
                sizes = np.array([self.problem.tolerance[k] for k in far[0][0].columns])
                tolerance, _ = physical(self.problem, far[0][0], sizes, np.diag(sizes**2))
                out.append(Scatter(cause, factor, tolerance, members))
        return sorted(out, key=lambda s: -s.factor)

    def _members_of(self, g: Group) -> Iterator[Member]:
        p, k = self.state.posterior, list(g.columns)
        values, errors = physical(self.problem, g, p.mean[k], p.covariance[np.ix_(k, k)])
        yield Member(g.place, self._joint(*g.key), values, errors)

    def _offers(self, search: Search, state: State) -> Iterator[Offer]:
        for nats, chosen in search.offers(state)[:OFFERS]:
            g = chosen.group
            yield Offer(g.cause, g.place, self._joint(*g.key), nats)

    def _limits(self) -> Iterator[Limit]:
        """Sizes that would be noticed nine times in ten, with everything else as it was found."""
        taken = {c.group.key for c in self.state.chosen}
        s = self.search.settings
        open_ = s.open_nats if taken else 0.0
        need = np.sqrt(2.0 * (self.search.against + s.need_nats + open_)) + NOTICED
        for g in self.problem.groups:
            known = g.key in taken or (g.cause, "all joints") in taken
            if known or g.members or g.cause == "unlisted" or any(v for _, v in g.shape):
                continue
            se = self.state.posterior.errors_of(g.columns)
            seen, sizes = need * se < 10.0 * np.array(g.slab), need * se
            if g.cause == "payload":
                told = {NAMES[g.cause][0]: float(sizes[0]) if seen[0] else None}
            elif all(seen) or (any(seen) and g.cause != "gravity_direction"):
                value, _ = physical(self.problem, g, np.where(seen, sizes, 0.0), np.diag(sizes**2))
                told = {n: abs(x) if ok else None for (n, x), ok in zip(value.items(), seen, strict=True)}
            else:
                continue
            yield Limit(g.cause, g.place, self._joint(*g.key), told)

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
        """Residuals of each part: as modelled, and with everything that was found."""
        x = self.state.posterior.mean[self.parts.active]
        variance = self.state.posterior.variance
        out = []
        for t, name in enumerate(self.trials.names[: self._changed]):
            residual, columns = self.parts.series[t]
            unit, rows = self.parts.unit[t], self.parts.cells[t].rows
            sigma = np.sqrt(np.sum(rows * variance, axis=1) / rows.sum(axis=1)) * unit
            before, after = residual * unit, (residual - columns @ x) * unit
            time, s = self.parts.times[t], self.trials.signals[t]
            here = [np.interp(time, s.time, v[:, j]) for j in range(s.q.shape[1]) for v in (s.q,)]
            speed = np.interp(time, s.time, np.sqrt(np.mean((s.dq / s.typical) ** 2, axis=1)))
            quantities = {"speed": speed} | {f"position of joint {j + 1}": q for j, q in enumerate(here)}
            rate = self.parts.cells[t].bands.rates_hz[0]
            wide = np.broadcast_to(sigma, before.shape)
            out.append(
                Trace(
                    name,
                    time,
                    len(time),
                    rate,
                    before,
                    after,
                    wide,
                    before / sigma,
                    after / sigma,
                    quantities,
                )
            )
        return out


def _share(left: Sequence[float], k: int, rows: float) -> float:
    """Share of the misfit above what all leave that one step removes."""
    best = np.minimum.accumulate(np.asarray(left))
    room = max(best[0] - min(rows, best[-1]), 1e-9)
    return float(np.clip((best[k] - best[k + 1]) / room, 0.0, 1.0))
