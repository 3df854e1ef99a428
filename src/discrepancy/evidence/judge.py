"""Turn a search result into a verdict: causes with probabilities, their worth, and what remains open."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Protocol

import numpy as np

from discrepancy.evidence.findings import Finding, Limit, Member, Offer, Rival, Scatter, Word
from discrepancy.evidence.parts import Parts, Values
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.evidence.probability import Odds
from discrepancy.evidence.search import Chosen, Linear, Search, State
from discrepancy.evidence.settings import SETTINGS
from estimator.arrays import Array

OFFERS, RIVALS = 12, 6
Side = tuple[Search, State]


class Tolerant(Linear, Protocol):
    """A linear problem with the prior standard deviations of a healthy machine."""

    @property
    def tolerance(self) -> Sequence[float]:
        """One for each column; 0 if a healthy machine lacks the column."""
        ...


class Judge(ABC):
    """Turn one search result into the fields of a verdict.

    Args:
        problem: linearised around the result.
        found: the search and the likeliest set.
        nothing: the search and the state without causes, linearised around the model as it is.
        parts: normal equations of the parts of the logs.
        odds: of every cause in the set.

    Attributes:
        tolerated: whether the log odds by part let all tolerated columns vary, too.
    """

    tolerated: ClassVar[bool] = False

    def __init__(
        self, problem: Tolerant, found: Side, nothing: Side, parts: Parts, odds: Sequence[Odds]
    ) -> None:
        self.problem, (self.search, self.state), self.nothing, self.parts = problem, found, nothing, parts
        odds = sorted(odds, key=lambda o: -o.over_nothing)
        self.named = [o for o in odds if is_named(o)]
        self.suspected = [o for o in odds if not is_named(o)]
        self.whole = parts.values(parts.prior)

    # --- machine-specific methods

    @property
    def validated(self) -> bool:
        """Whether findings can be tested on trials that were left out of the fit."""
        return self.parts.count > 1

    @abstractmethod
    def joint(self, cause: str, place: str) -> int | None:
        """Number of the joint of a cause at a place, from 1; None if it has no joint."""

    @abstractmethod
    def members(self, group: Group, values: Values) -> tuple[Member, ...]:
        """Places of a group with their values in physical units."""

    @abstractmethod
    def more(self, group: Group) -> Mapping[str, Any]:
        """Further attributes of a finding, by name."""

    @abstractmethod
    def tolerances(self, group: Group) -> Mapping[str, float]:
        """Prior standard deviations of a healthy machine's parameters, in physical units."""

    @abstractmethod
    def sizes(self, group: Group, sizes: Array, seen: Array) -> Mapping[str, float | None] | None:
        """Convert detectable column sizes to physical units.

        A size that is not ``seen`` becomes None. The result is None if the group has no limit to report.
        """

    def fitted(self, problem: Any) -> Sequence[int]:
        """Columns that are fitted even without causes."""
        return ()

    def before(self) -> Side:
        """The search and the state without causes, for the gain of each single cause."""
        return self.nothing

    def unseen(self) -> Collection[Group]:
        """Groups with limits to report but without columns in the problem."""
        return ()

    # --- the verdict

    def told(self) -> dict[str, Any]:
        """All fields of a verdict (``evidence.findings.Verdict``) except trials, notes and traces."""
        findings = self._with_worth()
        doubtful = [f for o in self.suspected for f in self.findings(o)]
        scatter, chi2 = self._scatter(), self._chi2()
        return {
            "verdict": self._word(findings, doubtful, scatter, chi2), "findings": tuple(findings),
            "suspected": tuple(doubtful), "scatter": tuple(scatter), "validated": self.validated,
            "chi2_per_n": chi2, "before": tuple(self._offers(*self.before())),
            "after": tuple(self._offers(self.search, self.state)), "limits": tuple(self._limits()),
        }  # fmt: skip

    def findings(self, o: Odds, values: Values | None = None) -> list[Finding]:
        """Findings of one cause: one, or one for each outlier if few joints of an "all joints" cause are off."""
        c, probability = o.chosen.group, o.probability
        others = o.rivals
        first = next((r for r in others if r.probability > o.probability), None)
        if (
            first and first.group and first.group.cause == "unlisted"
        ):  # report the likelier unlisted effect instead
            others = (
                replace(first, group=c, probability=probability),
                *(r for r in others if r is not first),
            )
            c, probability = first.group, first.probability
        open_ = sum(r.probability for r in o.rivals if r.group and r.group.cause == "unlisted")
        nothing = sum(r.probability for r in o.rivals if r.group is None)
        listed = [r for r in o.rivals if r.group and r.group.cause != "unlisted"]
        kin = sum(r.probability for r in listed if r.group and c.family and r.group.family == c.family)
        rivals = tuple(
            Rival(*r.group.key, self.joint(*r.group.key), r.probability,
                  float(np.log(max(probability, 1e-12) / max(r.probability, 1e-12))))
            for r in others[:RIVALS] if r.group is not None
        )  # fmt: skip
        plain = Finding(
            cause=c.cause,
            place=c.place,
            joint=self.joint(*c.key),
            members=self.members(c, values or self.whole) if c.columns else (),
            probability=probability + kin,
            over_nothing=o.over_nothing,
            nothing=nothing,
            unlisted=open_,
            rivals=rivals,
            told=tuple(g.key for g in o.told() if g),
            **self.more(c),
        )
        off = [m for m, k in zip(plain.members, c.members, strict=False) if self._is_off(k)]
        if not off or 2 * len(off) >= len(plain.members):
            return [plain]
        return [replace(plain, place=m.place, joint=m.joint, members=(m,)) for m in off]

    def fit_of(self, group: Group) -> tuple[Array, Array, Array]:
        """Mean and covariance of a group's values, and their (wide) prior variances."""
        at, (mean, covariance) = self.parts.columns_of(group.columns), self.whole
        if set(group.columns) <= set(self.parts.active.tolist()):
            return mean[at], covariance[np.ix_(at, at)], self.parts.prior[at]
        # A rival that is likelier than the cause in the fit: fit it in the place of that cause.
        other = next(o for o in (*self.named, *self.suspected) if any(r.group == group for r in o.rivals))
        rest = self.search.value(
            [c for c in self.state.chosen if c.group.key != other.chosen.group.key], self.state.posterior
        )
        scale = rest.posterior.gain(group, self.search.settings.octaves)[1]
        p, at = (
            self.search.with_one(rest.chosen, Chosen(group, scale), rest.posterior).posterior,
            list(group.columns),
        )
        return p.mean[at], p.covariance[np.ix_(at, at)], p.prior[at]

    def _is_off(self, columns: Sequence[int]) -> bool:
        """Whether a value exceeds its standard error and the healthy tolerance, combined, by a factor of ``apart``."""
        at, (mean, covariance) = self.parts.columns_of(list(columns)), self.whole
        usual = np.array([self.problem.tolerance[k] for k in columns])
        size = np.sqrt(np.diag(covariance)[at] + usual**2)
        return bool(np.any(np.abs(mean[at]) > SETTINGS.apart * size))

    def _word(
        self, findings: Sequence[Finding], doubtful: Sequence[Finding], scatter: Sequence[Scatter],
        chi2: tuple[float, float, float],
    ) -> Word:  # fmt: skip
        clean = chi2[2] <= self.search.settings.clean_chi2
        listed = [f for f in findings if f.cause != "unlisted"]
        if listed:
            return "explained" if clean and len(listed) == len(findings) else "partly_explained"
        if findings or not clean or any(f.nothing < 1.0 - SETTINGS.named for f in doubtful):
            return "unexplained"
        return "miscalibrated" if scatter else "consistent"

    # --- worth of the causes

    def prior(self, chosen: Sequence[Chosen], *, tolerated: bool = True, events: bool = True) -> Array:
        """Prior variances with the chosen causes in the model, for the active columns, shape (K,).

        Args:
            chosen: the causes to keep.
            tolerated: whether columns within a healthy machine's tolerance may vary.
            events: whether columns of events may vary if ``tolerated`` is false.
        """
        prior = self.parts.prior.copy()
        own = {k for c in chosen for k in c.group.columns}
        if not tolerated:
            kept = self.parts.unknown | self.parts.events if events else self.parts.unknown.copy()
            kept[self.parts.columns_of(sorted(own))] = True
            return np.where(kept, prior, 0.0)
        own |= {k for c in chosen for k in c.forms}
        nominal = self.problem.prior(chosen, self.state.posterior.mean)
        for c in self.state.chosen:
            for k in {*c.group.columns, *c.forms} - own:
                prior[self.parts.columns_of([k])] = nominal[k] if k < len(nominal) else 0.0
        return prior

    def _with_worth(self) -> list[Finding]:
        """Findings with the share of the misfit that each removes in turn, and its log odds by part."""
        parts, kept = self.parts, self.named
        sets = [[o.chosen for o in kept[:k]] for k in range(len(kept) + 1)]
        left = [parts.left(parts.mean(self.prior(own, tolerated=False, events=False))) for own in sets]
        several, rows = self.validated, float(parts.rows.sum())
        kinds = sorted({False, self.tolerated}) if several else []
        sides = [self._predicted_each(sets, tolerated=kind) for kind in kinds]
        held, each = [sum(one) for one in sides[0]] if several else [], sides[-1] if several else []
        done = []
        for k, o in enumerate(kept):
            lasts = several and not set(parts.columns_of(o.chosen.group.columns)) & set(
                np.flatnonzero(parts.events)
            )
            folds = tuple(0.5 * (a - b) for a, b in zip(each[k], each[k + 1], strict=True)) if lasts else ()
            share, out = _share(left, k, rows), _share(held, k, rows) if lasts else None
            done += [replace(f, in_sample=share, held_out=out, folds=folds) for f in self.findings(o)]
        return done

    def _predicted_each(self, sets: Sequence[Sequence[Chosen]], *, tolerated: bool) -> list[list[float]]:
        """For each set, squared residuals over the noise of each part, predicted from the other parts."""
        priors = [self.prior(own, tolerated=tolerated) for own in sets]
        return [
            [self.parts.left(self.parts.predicted(prior, t), t) for t in range(self.parts.count)]
            for prior in priors
        ]

    def _chi2(self) -> tuple[float, float, float]:
        """Reduced chi-square at the noise floor: as modelled, with tolerances, with the causes."""
        plain, p, found = self.nothing[0], self.nothing[1].posterior, self.state.posterior
        kept, out = np.zeros(len(p.prior)), []
        columns = list(self.fitted(plain.problem))
        kept[columns] = p.prior[columns]
        for search, own in ((plain, Posterior(p.cells, kept, plain.floor)), (plain, p), (self.search, found)):
            cells = search.problem.cells
            cells.truncate(len(own.prior))
            left, fitted = cells.left(own.mean, own.covariance)
            free = np.maximum(cells.rows - fitted / own.variance, 0.05 * cells.rows)
            out.append(float(np.sum(left / search.floor) / free.sum()))
        return out[0], out[1], out[2]

    # --- scatter, offers and limits

    def _scatter(self) -> list[Scatter]:
        """Causes whose healthy members deviate by several tolerances, root mean square."""
        taken = {k for c in self.state.chosen for k in c.group.columns}
        kinds: dict[str, list[tuple[Group, float]]] = {}
        p, out = self.state.posterior, []
        for g in (*self.problem.groups, *self.withheld()):
            if g.members or self._shaped(g) or taken & set(g.columns):
                continue
            sizes = [self.problem.tolerance[k] for k in g.columns]
            if sizes and all(sizes):
                off = float(np.mean([(p.mean[k] / s) ** 2 for k, s in zip(g.columns, sizes, strict=True)]))
                kinds.setdefault(g.cause, []).append((g, off))
        for cause, each in kinds.items():
            factor = float(np.sqrt(np.mean([off for _, off in each])))
            if factor > SETTINGS.scatter:
                far, values = (
                    sorted(each, key=lambda pair: -pair[1]),
                    self.parts.values(p.prior[self.parts.active]),
                )
                members = tuple(m for g, _ in far for m in self.members(g, values))
                out.append(Scatter(cause, factor, self.tolerances(far[0][0]), members))
        return sorted(out, key=lambda s: -s.factor)

    def withheld(self) -> Sequence[Group]:
        """Excluded causes, whose tolerances stay in the model."""
        return ()

    def _shaped(self, group: Group) -> bool:
        """Whether a group is a variant shape; only the plain shape has a tolerance."""
        return any(v for _, v in group.shape)

    def _offers(self, search: Search, state: State) -> Iterator[Offer]:
        for nats, chosen in search.offers(state)[:OFFERS]:
            key = chosen.group.key
            yield Offer(*key, self.joint(*key), nats)

    def _limits(self) -> Iterator[Limit]:
        """Sizes that the search would detect with 90 % probability, given what was found."""
        taken, s = {c.group.key for c in self.state.chosen}, self.search.settings
        open_ = s.open_nats if taken else 0.0
        need = np.sqrt(2.0 * (self.search.against + s.need_nats + open_)) + s.noticed
        p = self.state.posterior
        groups = [
            g for g in self.problem.groups if not (g.members or g.cause == "unlisted" or self._shaped(g))
        ]
        cells = self.problem.cells
        count = cells.count
        groups += [self.problem.place(g) for g in self.unseen()]
        p = replace(p, cells=cells, prior=np.append(p.prior, np.zeros(cells.count - len(p.prior))))
        for g in groups:
            if g.key in taken or (g.cause, "all joints") in taken:
                continue
            sizes = need * p.errors_of(g.columns)
            told = self.sizes(g, sizes, sizes < 10.0 * np.array(g.slab))
            if told is not None:
                yield Limit(*g.key, self.joint(*g.key), told)
        cells.truncate(count)


def is_named(o: Odds) -> bool:
    """Whether to name a cause: "nothing" is improbable, and ``told`` has this cause or begins with an unlisted one."""
    nothing = sum(r.probability for r in o.rivals if r.group is None)
    own = o.chosen.group
    told = [g for g in o.told() if g]
    kin = [g for g in told if g.key == own.key or (own.family and g.family == own.family)]
    return nothing < 1.0 - SETTINGS.named and bool(kin or [g for g in told[:1] if g.cause == "unlisted"])


def _share(left: Sequence[float], k: int, rows: float) -> float:
    """Share of the misfit that step k removes; the misfit that all steps leave does not count."""
    best = np.minimum.accumulate(np.asarray(left))
    room = max(best[0] - min(rows, best[-1]), 1e-9)
    return float(np.clip((best[k] - best[k + 1]) / room, 0.0, 1.0))
