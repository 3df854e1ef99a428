"""Turn a search result into a verdict: causes with probabilities, sizes and their benefit."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from scipy.signal import lfilter

from discrepancy.candidate import Candidate
from discrepancy.evidence.findings import Event, Member, Scatter, Verdict
from discrepancy.evidence.judge import Judge, Side
from discrepancy.evidence.parts import Parts, Values
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.evidence.probability import Odds
from discrepancy.evidence.search import State
from discrepancy.formulas.law import Law
from discrepancy.result.traces import Trace
from discrepancy.team.causes import CAUSES
from discrepancy.team.diagnose import TeamOutcome
from discrepancy.team.estimates import Estimate, to_dict
from discrepancy.team.linear.rows import Whitening
from discrepancy.team.problem import TeamProblem
from discrepancy.team.rig import TeamRig
from estimator.arrays import Array


def parts_of(problem: TeamProblem, state: State) -> Parts:
    """Split the rows by trial. Base poses, clocks and causes that act in some trials belong to each trial alone."""
    local = [k for own in problem.local for k in own]
    events = [
        k
        for c in state.chosen
        if c.group.identity in problem.candidates and problem.candidates[c.group.identity].of_trials
        for k in (*c.group.columns, *c.forms)
    ]
    return Parts.of(state, _each(problem, state), [*problem.shared, *local], local, events)


def _each(problem: TeamProblem, state: State) -> Iterator[tuple[Array, Array, float, Array]]:
    """Weighted normal equations of the active columns, and row counts by channel and band, of each trial."""
    cells, active = problem.cells, np.flatnonzero(state.posterior.prior)
    place = np.full(cells.count, -1)
    place[active] = np.arange(len(active))
    lengths = cells.bands.lengths
    trial = np.repeat(np.arange(len(lengths)), 3 * np.array(lengths))[cells.order]
    for t in range(len(lengths)):
        own = trial == t
        G, b, yy, rows = np.zeros((len(active),) * 2), np.zeros(len(active)), 0.0, []
        for channel, variance in zip(cells.channels, state.posterior.variance, strict=True):
            band = np.repeat(np.arange(len(variance)), np.diff(channel.starts))[own]
            keep = np.flatnonzero(place[channel.columns] >= 0)
            X, y, at = channel.X[np.ix_(own, keep)], channel.y[own], place[channel.columns[keep]]
            weighted = X / variance[band][:, None]
            G[np.ix_(at, at)] += weighted.T @ X
            b[at] += weighted.T @ y
            yy += float(np.sum(y**2 / variance[band]))
            rows.append(np.bincount(band, minlength=len(variance)))
        yield G, b, yy, np.array(rows, dtype=float)


STEPS = 10.0
"""Prior standard deviation of a shape number, in steps of the search. Chosen: wide enough to have no influence."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TeamVerdict(Verdict):
    """Verdict on a model of a team.

    Attributes:
        rig: the recordings.
        candidates: by cause and place, as in the findings.
        left: whitened residual rows, of the given model (``before``) and with all findings (``after``).
        estimates: of the payload, by the same names.
    """

    rig: TeamRig
    candidates: Mapping[tuple[str, str], Candidate]
    left: Mapping[str, Sequence[Array]]
    estimates: Mapping[str, Estimate]


def judged_team(
    outcome: TeamOutcome, odds: Sequence[Odds], notes: Sequence[str] = (), *, contradicted: bool = False
) -> TeamVerdict:
    """Turn a search result into a verdict.

    Args:
        outcome: of the search.
        odds: of its causes.
        notes: sentences on the recordings.
        contradicted: whether the causes make the simulated response worse.
    """
    verdict = _TeamJudge(outcome, odds).verdict(outcome, notes)
    if contradicted and verdict.verdict == "explained":
        return replace(verdict, verdict="partly_explained")
    return verdict


class _TeamJudge(Judge):
    problem: TeamProblem
    tolerated = True

    def __init__(self, outcome: TeamOutcome, odds: Sequence[Odds]) -> None:
        self.rig, plain = outcome.rig, outcome.nothing
        parts = parts_of(outcome.problem, outcome.state)
        super().__init__(outcome.problem, (outcome.search, outcome.state), plain, parts, odds)

    def verdict(self, outcome: TeamOutcome, notes: Sequence[str]) -> TeamVerdict:
        """Assemble the verdict."""
        told, problem, rig = self.told(), self.problem, self.rig
        prior, fitted = np.zeros(len(self.state.posterior.prior)), self.fitted(problem)
        prior[fitted] = self.state.posterior.prior[fitted]
        plain = Posterior(problem.cells, prior, self.search.floor).mean
        values = {"before": plain, "after": self.state.posterior.mean}
        left = {name: problem.left(x) for name, x in values.items()}
        return TeamVerdict(
            **told,
            trials=tuple(rig.trials),
            notes=tuple(notes),
            finished=outcome.finished,
            traces=lambda: traces(rig, problem.opened, left),
            rig=rig,
            candidates=self._candidates,
            left=left,
            estimates={
                name: to_dict(rig.linear[0].shared.moved(-x[problem.shared])) for name, x in values.items()
            },
        )

    # --- groups

    @property
    def _candidates(self) -> dict[tuple[str, str], Candidate]:
        plain = self.nothing[0].problem
        assert isinstance(plain, TeamProblem)
        known = {**plain.candidates, **self.problem.candidates}
        return {(key[0], key[1]): candidate for key, candidate in known.items() if isinstance(key, tuple)}

    def joint(self, cause: str, place: str) -> int | None:
        candidate = self._candidates.get((cause, place))
        return candidate and candidate.joint

    def more(self, group: Group) -> Mapping[str, Any]:
        if group.late and group.columns:
            return {"law": self._law(group)}
        candidate = self.problem.candidates.get(group.identity)
        at = candidate and candidate.transient
        if candidate is None or at is None:
            return {"shape": dict(candidate.shape) if candidate else {}}
        return {"event": Event(at.trial, float(at.start_s), float(at.duration_s))}

    @cache  # noqa: B019
    def _law(self, group: Group) -> Law:
        """The unlisted law with its formula."""
        return self.problem.laws_of.told(group, *self.fit_of(group))

    def members(self, group: Group, values: Values) -> tuple[Member, ...]:
        if group.late:
            law = self._law(group)
            return (Member(group.place, law.joint, *law.numbers),)
        candidate = self.problem.candidates[group.identity]
        covariance, at = values[1], self.parts.columns_of(group.columns)
        x, C = np.zeros(len(candidate.parameters)), np.zeros((len(candidate.parameters),) * 2)
        which = self._parameters(group)
        x[which], C[np.ix_(which, which)] = values[0][at], covariance[np.ix_(at, at)]
        if group in [c.group for c in self.state.chosen]:
            C = self._with_shape(group, candidate, x, C)
        numbers, errors = CAUSES[candidate.cause].report(x, C, self.rig._context(candidate))
        return (Member(group.place, candidate.joint, numbers, errors),)

    def _parameters(self, group: Group) -> list[int]:
        """Parameter index of each column of a group."""
        labels = [self.problem.labels[k] if k < len(self.problem.labels) else None for k in group.columns]
        return [n if label is None else label[1] for n, label in enumerate(labels)]

    def _with_shape(self, group: Group, candidate: Candidate, x: Array, C: Array) -> Array:
        """Covariance of values and of the shape numbers that the data determine, shape (k + s, k + s)."""
        cells, p, k = self.problem.cells, self.state.posterior, len(x)
        count = cells.count
        index, _, size = self.problem.slopes(candidate, x)
        if index:
            prior = np.append(p.prior, np.zeros(cells.count - len(p.prior)))
            prior[self.parts.active], prior[index] = self.parts.prior, (STEPS * size) ** 2
            at, to = [*group.columns, *index], [*self._parameters(group), *range(k, k + len(index))]
            C = np.zeros((k + len(index),) * 2)
            C[np.ix_(to, to)] = Posterior(cells, prior, p.variance).covariance[np.ix_(at, at)]
        cells.truncate(count)
        return C

    def tolerances(self, group: Group) -> Mapping[str, float]:
        return {p.name: p.tolerance for p in self.problem.candidates[group.identity].parameters}

    def sizes(self, group: Group, sizes: Array, seen: Array) -> Mapping[str, float | None] | None:
        told: dict[str, float | None] = dict.fromkeys(self.tolerances(group))
        names = list(told)
        for n, size, ok in zip(self._parameters(group), sizes, seen, strict=True):
            told[names[n]] = float(size) if ok else None
        return told

    def fitted(self, problem: Any) -> Sequence[int]:
        return [*problem.shared, *(k for own in problem.local for k in own)]

    def before(self) -> Side:
        """The state without causes, with the noise and spreads found with them, so that these absorb no cause."""
        p, prior = self.state.posterior, self.state.posterior.prior.copy()
        nominal = np.append(self.problem.prior((), None), np.zeros(len(prior)))
        own = [k for c in self.state.chosen for k in (*c.group.columns, *c.forms)]
        prior[own] = nominal[own]
        return self.search, replace(
            self.state, chosen=(), posterior=Posterior(self.problem.cells, prior, p.variance)
        )

    def unseen(self) -> Collection[Group]:
        """Causes without tolerances, in their first shapes."""
        first: dict[tuple[str, str], Group] = {}
        known = {g.key for g in self.problem.groups}
        for g in self.problem.listed.groups if self.problem.listed else ():
            if g.key not in known:
                first.setdefault(g.key, g)
        return first.values()

    def _shaped(self, group: Group) -> bool:
        return False  # other shapes are listed separately

    def _scatter(self) -> list[Scatter]:
        """Causes whose parameters are inflated everywhere, limited to parameters with tolerances."""
        return [
            replace(
                s,
                members=tuple(
                    replace(m, values={n: x for n, x in m.values.items() if n in s.tolerance})
                    for m in s.members
                ),
            )
            for s in super()._scatter()
        ]


def traces(rig: TeamRig, opened: Sequence[Array] | None, left: Mapping[str, Sequence[Array]]) -> list[Trace]:
    """Residuals of every trial, for plots.

    Args:
        rig: the recordings.
        opened: whitening against the latent states of the chosen causes, shape (n, C, C) a trial; or None.
        left: residual rows after that whitening, ``before`` and ``after``, shape (n, C) a trial.
    """
    out = []
    for t, (linear, white) in enumerate(zip(rig.linear, rig.whitening, strict=True)):
        z = [left[name][t] for name in ("before", "after")]
        if opened is not None:
            z = [np.asarray(np.linalg.solve(opened[t], x[..., None])[..., 0], dtype=np.float64) for x in z]
        sigma = np.empty_like(z[0])
        sigma[: white.moving] = white.loudness * np.linalg.norm(white.chol_moving, axis=1)
        sigma[white.moving :] = np.linalg.norm(white.chol_alone, axis=1)
        before, after = (unwhitened(white, x) for x in z)
        out.append(Trace(rig.trials[t], linear.reduction.time, white.moving, rig.row_rate_hz(t), before, after, sigma,
                         z[0], z[1], rig.quantities(t)))  # fmt: skip
    return out


def unwhitened(white: Whitening, y: Array) -> Array:
    """Invert the whitening, shape (n, C) -> (n, C)."""
    order, moving = white.ar.shape[1], white.moving
    z = y[:moving].copy()
    for c in range(y.shape[1] if moving > order else 0):
        a = np.concatenate([[1.0], -white.ar[c]])
        # The first rows were not predicted; they are the past of the first predicted row.
        past = [
            float(np.dot(white.ar[c][k:], z[order - 1 :: -1, c][: order - k] if order else []))
            for k in range(order)
        ]
        z[order:, c], _ = lfilter([1.0], a, white.innovation[c] * z[order:, c], zi=np.array(past))
    return np.concatenate([white.loudness * (z @ white.chol_moving.T), y[moving:] @ white.chol_alone.T])
