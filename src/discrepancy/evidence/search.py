"""Search the likeliest set of causes: add, delete and exchange by exact evidence, and learn the noise of every set."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Protocol

import numpy as np

from discrepancy.evidence.cells import Cells, Series
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.evidence.settings import SETTINGS, Settings
from estimator.arrays import Array

Key = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Chosen:
    """A cause in the set.

    Attributes:
        group: the cause with its place and columns.
        scale: factor on its prior standard deviation.
        forms: columns for the error of its law.
    """

    group: Group
    scale: float
    forms: tuple[int, ...] = ()

    @property
    def open(self) -> Chosen:
        """Only the law error without the law itself: an unknown effect with a similar trace."""
        g = self.group
        nothing = Group("open", g.place, (), (), g.log_prior, event=g.event)
        return replace(self, group=nothing)


class Linear(Protocol):
    """The logs of a machine as a linear problem with K columns and C channels."""

    cells: Cells

    @property
    def groups(self) -> Sequence[Group]:
        """All causes at all places in all shapes."""
        ...

    @property
    def sensors(self) -> Array | None:
        """Variances of the sensor noise, shape (C, bands); None: unknown."""
        ...

    @property
    def families(self) -> Sequence[Sequence[int]]:
        """Columns of random effects with a common variance factor to be learnt."""
        ...

    @property
    def laws(self) -> Sequence[Sequence[int]]:
        """Columns for errors of the model's own laws, with a common variance factor to be learnt."""
        ...

    def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
        """Prior variances without the chosen causes, shape (K,); they may depend on the causes' ``values``."""
        ...

    def proposals(self, posterior: Posterior, *, late: bool = False) -> Sequence[Group]:
        """Events and shapes that have no columns yet, likeliest first; ``late``: include unlisted laws."""
        ...

    def place(self, group: Group) -> Group:
        """Add the columns of a proposed group to the problem, and return the group with their indices."""
        ...

    def nearby(self, group: Group, posterior: Posterior) -> Sequence[Group]:
        """The same cause in neighbouring shapes: an event slightly earlier, later, shorter and longer."""
        ...

    def forms(self, group: Group, values: Array) -> list[Series]:
        """Columns for the error of a cause's law at these values, each with a standard deviation of one."""
        ...


@dataclass(frozen=True, eq=False)
class State:
    """A set of causes with its posterior.

    Attributes:
        chosen: the causes.
        posterior: of all columns, with the noise learnt for this set.
        evidence: log joint probability of the set and the data, up to a constant.
    """

    chosen: tuple[Chosen, ...]
    posterior: Posterior
    evidence: float

    @property
    def keys(self) -> set[Key]:
        """Cause and place of each chosen cause."""
        return {c.group.key for c in self.chosen}


Bent = Callable[[State, frozenset[str]], bool]
"""Test whether the problem needs a new linearisation at a state with these new causes."""


@dataclass(eq=False)
class Search:
    """The search on one linear problem.

    Attributes:
        problem: columns and groups.
        floor: noise floor, the prior value of the noise variances, shape (C, bands).
        settings: constants of the search.
        say: receives a line of text about each step.
        stop: returns whether to stop early.
        best: the last accepted set, for use after an interruption.
        against: prior log odds against any one cause.
    """

    problem: Linear
    floor: Array
    settings: Settings = SETTINGS
    say: Callable[[str], object] = lambda _: None
    stop: Callable[[], bool] = lambda: False
    best: State | None = None
    against: float = field(init=False)

    def __post_init__(self) -> None:
        self.against = self.settings.cause_nats + float(np.log(len({g.key for g in self.problem.groups})))

    def value(self, chosen: Sequence[Chosen], near: Posterior | None, steps: int | None = None) -> State:
        """Compute the evidence of a set, and learn its noise and the variance factors of its random effects.

        Args:
            chosen: the set.
            near: a nearby posterior to start from; None: start from the noise floor.
            steps: learning steps; None: the default of the settings.
        """
        cells, s = self.problem.cells, self.settings
        nominal = self.prior(chosen, None if near is None else near.mean)
        weight = s.floor_rows
        loose = (*self.problem.laws, *(c.forms for c in chosen if c.forms))
        free = [k for c in chosen for k in c.group.columns]  # learn the spread from healthy columns only
        kin = [(np.setdiff1d(k, free), s.spread_rows, np.inf) for k in self.problem.families]
        kin += [(np.asarray(k), 0.0, s.most_spread) for k in loose]
        kin = [k for k in kin if len(k[0]) and nominal[k[0][0]] > 0]
        S, spread = nominal.copy(), np.ones(len(kin))
        for k, _, _ in kin:
            if near is not None and k[-1] < len(near.prior) and near.prior[k[0]] > 0:
                S[k] *= near.prior[k[0]] / nominal[k[0]]
        p = Posterior(cells, S, self.floor if near is None else near.variance)
        for _ in range(steps or (s.start_steps if near is None else s.noise_steps)):
            S = nominal.copy()
            for f, (k, rows, most) in enumerate(kin):
                share = np.sum((p.mean[k] ** 2 + p.variances[k]) / nominal[k])
                spread[f] = np.clip((rows + share) / (rows + len(k)), s.least_spread, most)
                S[k] *= spread[f]
            p = Posterior(cells, S, p.better_noise(self.floor, weight))
        evidence = p.log_evidence
        for c in chosen:
            evidence += c.group.log_prior - self.against + p.possible(c.group, c.scale)
        evidence -= 0.5 * float(
            np.sum(weight * (np.log(p.variance / self.floor) + self.floor / p.variance - 1.0))
        )
        rows = np.array([k[1] for k in kin])
        evidence -= 0.5 * float(np.sum(rows * (np.log(spread) + 1.0 / spread - 1.0)))
        return State(tuple(chosen), p, evidence)

    def prior(self, chosen: Sequence[Chosen], values: Array | None) -> Array:
        """Prior variances of all columns with the chosen causes in the model, shape (K,)."""
        S = np.zeros(self.problem.cells.count)
        base = self.problem.prior(chosen, values)
        S[: len(base)] = base
        for c in chosen:
            S[list(c.group.columns)] += (np.array(c.group.slab) * c.scale) ** 2
            S[list(c.forms)] += self.settings.form_share**2
        return S

    def fixed(self, chosen: Sequence[Chosen]) -> State:
        """Compute a fixed set with law errors, then drop causes that lower the evidence."""
        state = self.value([replace(c, forms=()) for c in chosen], None)
        for one in state.chosen:
            state = self._with_errors(state, one)
        return self._pruned(self.settled(state), fresh=False)

    def run(self, state: State, bent: Bent = lambda state, new: False) -> State:
        """Search from a state for the likeliest set; stop early if ``bent`` asks for a new linearisation."""
        state = self._pruned(self.settled(state), fresh=False)
        while len(state.chosen) < self.settings.most_causes and not self.stop():
            self.best = state
            self.say(f"{len(state.chosen)} found, looking for more")
            grown = self._grown(state) or self._exchanged(state) or self._grown(state, late=True)
            settled = None if grown is None else self.settled(grown)
            if settled is None or settled.evidence < state.evidence + 0.5 * self.settings.need_nats:
                break  # require that evidence increases, to prevent cycles
            state, before = settled, state
            if bent(state, frozenset(cause for cause, _ in state.keys - before.keys)):
                break
        return self._pruned(self._named(state), fresh=False)

    def settled(self, state: State) -> State:
        """Learn the noise to convergence; otherwise a larger set would gain from additional learning steps alone."""
        for _ in range(self.settings.settle_steps):
            before, state = state.evidence, self.value(state.chosen, state.posterior)
            if abs(state.evidence - before) < 0.1 * self.settings.need_nats:
                break
        return state

    def _exchanged(self, state: State) -> State | None:
        """Replace one cause by another if the evidence increases; otherwise None."""
        cells = self.problem.cells
        for out in state.chosen:
            rest = [c for c in state.chosen if c is not out]
            without = self.value(rest, state.posterior)
            count, parts = cells.count, self._dissolved(state, without, out.group)
            if parts is not None and parts.evidence - state.evidence >= self.settings.need_nats:
                self.say(f"{out.group.name} -> members: {parts.evidence - state.evidence:.0f} nats")
                return parts
            cells.truncate(count)
            rivals = [c for c in self.rivals(without, out.group) if out.group.second or not c.group.second]
            for chosen in rivals[: self.settings.tried]:
                count = cells.count
                other = self.with_one(rest, chosen, without.posterior)
                if other.evidence > state.evidence - self.settings.within_nats:
                    other = self._pruned(self.settled(self.formed(other)))
                if other.evidence - state.evidence >= self.settings.need_nats:
                    gap = other.evidence - state.evidence
                    self.say(f"{out.group.name} -> {chosen.group.name}: {gap:.0f} nats")
                    return other
                cells.truncate(count)
        return None

    def _named(self, state: State) -> State:
        """Replace each "all joints" cause by its outlying members unless the evidence drops by ``within_nats``."""
        for kind in [c for c in state.chosen if c.group.members]:
            count = self.problem.cells.count
            without = self.value([c for c in state.chosen if c is not kind], state.posterior)
            parts = self._dissolved(state, without, kind.group)
            if parts is not None and parts.evidence > state.evidence - self.settings.within_nats:
                state = parts
            else:
                self.problem.cells.truncate(count)
        return state

    def _dissolved(self, state: State, without: State, kind: Group) -> State | None:
        """Replace an "all joints" cause by its members beyond tolerance; None if these are none or more than half."""
        p, healthy, far = state.posterior, self.problem.prior((), None), self.settings.apart**2
        at = [np.array(k) for k in kind.members]
        out = [tuple(k.tolist()) for k in at if np.any(p.mean[k] ** 2 > far * (p.variances[k] + healthy[k]))]
        if 2 * len(out) > len(kind.members):
            return None
        parts = without
        for g in self.problem.groups:
            if g.cause == kind.cause and g.columns in out:
                scale = parts.posterior.gain(g, self.settings.octaves)[1]
                parts = self.formed(self.value((*parts.chosen, Chosen(g, scale)), parts.posterior))
        return self._pruned(self.settled(parts)) if out else None

    def rivals(self, without: State, own: Group) -> list[Chosen]:
        """Candidates to replace a cause: their linear gain is at most ``within_nats`` below its own."""
        gain = without.posterior.gain(own, self.settings.octaves)[0] + own.log_prior - self.against
        least = gain - self.settings.within_nats
        return [
            c for g, c in self.offers(without, late=own.second)
            if g >= least and c.group.name != own.name and not (own.event and c.group.cause == own.cause)
        ]  # fmt: skip

    def offers(self, state: State, *, late: bool = False) -> list[tuple[float, Chosen]]:
        """All groups that fit into the set with their linear gain, the log odds at the present noise; largest first."""
        taken, families = state.keys, {c.group.family for c in state.chosen} - {""}

        def fits(g: Group) -> bool:
            return not (g.key in taken or (g.cause, "all joints") in taken or g.family in families)

        cells, p = self.problem.cells, state.posterior
        proposed = [g for g in self.problem.proposals(p, late=late) if fits(g)]
        count, placed = cells.count, [self.problem.place(g) for g in proposed]
        prior = np.zeros(cells.count)  # an interrupted search may have left or removed columns
        prior[: len(p.prior)] = p.prior[: cells.count]
        wider = Posterior(cells, prior, p.variance)
        pairs = [*((g, g) for g in self.problem.groups if fits(g)), *zip(proposed, placed, strict=True)]
        out = []
        for plain, g in pairs:
            gain, scale = wider.gain(g, self.settings.octaves)
            out.append((gain + g.log_prior - self.against, Chosen(plain, scale)))
        cells.truncate(count)
        return sorted(out, key=lambda offer: -offer[0])

    def with_one(self, rest: Sequence[Chosen], chosen: Chosen, near: Posterior) -> State:
        """Compute the set with one more cause; add its columns if the problem lacks them."""
        kind = chosen.group.cause if chosen.group.members else None
        if not chosen.group.columns:
            chosen = replace(chosen, group=self.problem.place(chosen.group))
        return self.value((*(c for c in rest if c.group.cause != kind), chosen), near)

    def _grown(self, state: State, *, late: bool = False) -> State | None:
        """Add the best cause, with its law error, if the evidence increases; otherwise None."""
        cells = self.problem.cells
        count, tried = cells.count, []
        for chosen in self._likely(state, late=late):
            tried.append((self.with_one(state.chosen, chosen, state.posterior).evidence, chosen))
            cells.truncate(count)
        for _, chosen in sorted(tried, key=lambda pair: -pair[0])[:2]:
            best = self.with_one(state.chosen, chosen, state.posterior)
            if best.evidence - state.evidence < self.settings.need_nats:
                best = self.settled(best)
            if best.evidence - state.evidence < self.settings.need_nats:
                break
            grown = self._pruned(self.formed(best))
            if grown.evidence - state.evidence >= self.settings.need_nats:
                self.say(f"+ {best.chosen[-1].group.name}: {grown.evidence - state.evidence:.0f} nats")
                return grown
            cells.truncate(count)
        cells.truncate(count)
        return None

    def _likely(self, state: State, *, late: bool) -> list[Chosen]:
        """Preselect causes for exact evidence by linear gain, at the learnt noise and at the noise floor.

        A band of a short log has few rows, so the learnt noise can absorb the effect of a cause.
        """
        p, s = state.posterior, self.settings
        quiet = replace(state, posterior=Posterior(p.cells, p.prior, np.minimum(p.variance, self.floor)))
        out: list[Chosen] = []
        for where, most, least in ((state, s.tried, -s.within_nats), (quiet, s.tried_quiet, s.need_nats)):
            offers = [
                (gain, c)
                for gain, c in self.offers(where, late=late)
                if c.group.second == late and gain > least
            ]
            known = {c.group.name for c in out}
            out += [c for _, c in offers[:most] if c.group.name not in known]
        return out

    def formed(self, state: State) -> State:
        """Refine the shape of the last cause, and add its law error."""
        state = self._moved(state)
        return self._with_errors(state, state.chosen[-1])

    def _with_errors(self, state: State, one: Chosen) -> State:
        """Add the law error of a cause, unless the law error alone has the higher evidence."""
        forms = self.problem.forms(one.group, state.posterior.mean)
        if not forms:
            return state
        count = self.problem.cells.count
        own = replace(one, forms=tuple(self.problem.cells.add(forms)))
        formed, without = (
            self.value([new if c is one else c for c in state.chosen], state.posterior, 3)
            for new in (own, own.open)
        )
        if without.evidence < formed.evidence:
            return formed
        self.problem.cells.truncate(count)
        return state

    def _moved(self, state: State) -> State:
        """Move the last cause to the best neighbouring shape."""
        cells, (*rest, last) = self.problem.cells, state.chosen
        for _ in range(self.settings.event_steps):
            count, tried = cells.count, []
            for group in self.problem.nearby(last.group, state.posterior):
                moved = Chosen(self.problem.place(group), last.scale)
                tried.append(self.value((*rest, moved), state.posterior))
            better = max(tried, key=lambda t: t.evidence, default=state)
            if better.evidence <= state.evidence:
                cells.truncate(count)
                break
            gain, state, last = better.evidence - state.evidence, better, better.chosen[-1]
            if gain < self.settings.need_nats:
                break
        return state

    def _pruned(self, state: State, *, fresh: bool = True) -> State:
        """Drop causes while the evidence does not decrease; ``fresh``: keep the last one."""
        while len(state.chosen) > fresh:
            loose = state.chosen[: len(state.chosen) - fresh]
            if any(
                c.group.late for c in state.chosen
            ):  # an unlisted law must not displace a clear listed cause
                small, size = self.settings.within_nats, state.posterior.size
                loose = tuple(c for c in loose if c.group.late or size(c.group.columns) < small)
            gone = [{c} for c in loose]
            gone += [{c, d} for c, d in combinations(loose, 2) if c.group.place == d.group.place]
            gone = [out for out in gone if self._worth(state, out) < self.settings.within_nats]
            if not gone:
                return state
            shorter = [self.value([c for c in state.chosen if c not in out], state.posterior) for out in gone]
            best = max(shorter, key=lambda s: s.evidence)
            if best.evidence < state.evidence:
                return state
            names = " and ".join(c.group.name for c in state.chosen if c not in best.chosen)
            self.say(f"- {names}: {best.evidence - state.evidence:.0f} nats")
            state = best
        return state

    def tolerated(self, state: State, own: Chosen) -> float:
        """Log evidence that a cause's columns gain within their tolerance, at the noise learnt with the cause."""
        columns = sorted(own.group.columns)
        healthy = self.prior([c for c in state.chosen if c is not own], None)[columns]
        worth = state.posterior.worth
        return (
            max(worth(columns, np.zeros(len(columns))) - worth(columns, healthy), 0.0)
            if healthy.any()
            else 0.0
        )

    def is_within_tolerance(self, state: State, own: Chosen) -> bool:
        """Whether all values of a cause are within ``apart`` tolerances, scaled by the spread of the healthy values."""
        plain = next((g for g in self.problem.groups if g.key == own.group.key), None)
        if plain is None or len(plain.columns) != len(own.group.columns) or own.group.members:
            return False
        nominal, p = self.problem.prior((), None), state.posterior
        free = {k for c in state.chosen for k in c.group.columns}
        every = [k for g in self.problem.groups for k in g.columns if not g.members]
        kin = next((k for k in self.problem.families if plain.columns[0] in k), every)
        spreads = [p.prior[k] / nominal[k] for k in kin if k not in free and nominal[k] > 0.0]
        spread = float(np.median(spreads)) if spreads else 1.0
        most = self.settings.apart**2 * spread * nominal[list(plain.columns)]
        return bool(np.all(p.mean[list(own.group.columns)] ** 2 < most))

    def _worth(self, state: State, out: Collection[Chosen]) -> float:
        """Log posterior odds of some causes, at the noise learnt with them."""
        kept = self.prior([c for c in state.chosen if c not in out], None)
        own = sorted({k for c in out for k in (*c.group.columns, *c.forms)})
        odds = sum(c.group.log_prior - self.against for c in out)
        return state.posterior.worth(own, kept[own]) + odds


def floor_of(problem: Linear, slabs: Array, settings: Settings = SETTINGS) -> Array:
    """Noise variances left by all causes together, smoothed over neighbouring bands, shape (C, bands).

    Args:
        problem: the columns.
        slabs: prior variances with every cause in the model, shape (K,).
        settings: constants of the iteration.
    """
    cells = problem.cells
    power = np.array([c.squares for c in cells.channels]) / cells.rows
    least = problem.sensors
    if least is None:
        least = np.broadcast_to(settings.least_floor * power.min(axis=1, keepdims=True), power.shape)
    # Start from the smallest noise. Use expectation maximisation: MacKay's step is unsafe with more columns than rows.
    p = Posterior(cells, slabs, least)
    for _ in range(settings.floor_steps):
        left, fitted = p.left
        better = np.maximum((left + fitted) / cells.rows, least)
        settled = np.all(np.abs(np.log(better / p.variance)) < settings.floor_change)
        p = Posterior(cells, slabs, better)
        if settled:
            break
    log = np.pad(np.log(p.variance), ((0, 0), (1, 1)), mode="edge")
    return np.exp(0.25 * log[:, :-2] + 0.5 * log[:, 1:-1] + 0.25 * log[:, 2:])


@dataclass
class Until:
    """Stop criterion of a search: a time limit or an interruption by the user.

    Attributes:
        end_s: time limit on the monotonic clock [s].
        broken: whether the search was stopped.
    """

    end_s: float = math.inf
    broken: bool = False

    def __call__(self) -> bool:
        """Whether to stop."""
        self.broken = self.broken or time.monotonic() > self.end_s
        return self.broken

    def run(self, search: Search, state: State, bent: Bent = lambda state, new: False) -> State:
        """Run the search; after an interruption, return the best set so far."""
        try:
            return search.run(state, bent)
        except KeyboardInterrupt:
            self.broken = True
            return search.best or state
