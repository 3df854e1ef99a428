"""The likeliest set of causes: add, delete, exchange on exact evidence, noise learnt with every set."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from discrepancy.evidence.cells import Cells
from discrepancy.evidence.posterior import Group, Noise, Posterior, smoothed_floor
from estimator.arrays import Array

Forms = Callable[[Group, Array], list]
"""Columns that a cause of such values brings besides."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """A cause in the model.

    Attributes:
        group: it.
        scale: of its prior's standard deviation.
        forms: indices of the columns that its law's error brings.
        form_std: their standard deviation.
    """

    group: Group
    scale: float
    forms: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class State:
    chosen: tuple[Chosen, ...]
    posterior: Posterior
    evidence: float

    @property
    def keys(self):
        return {(c.group.cause, c.group.place) for c in self.chosen}


@dataclass(eq=False)
class Search:
    cells: Cells
    base: Array
    groups: Mapping[str, Group]
    noise: Noise
    make_forms: Callable[[Group, Array], list]
    reprior: Callable[[Sequence[Chosen], Array], Array]
    prior_nats: float
    delta: float = 0.1
    families: Sequence = ()
    fw: float = 5.0
    say: Callable[[str], object] = lambda _: None

    def prior(self, chosen: Sequence[Chosen], x: Array | None = None) -> Array:
        S = np.zeros(self.cells.count)
        S[: len(self.base)] = self.base
        if x is not None:
            S = self.reprior(chosen, S, x)
        for c in chosen:
            S[list(c.group.columns)] += (np.array(c.group.slab) * c.scale) ** 2
            S[list(c.forms)] += self.delta**2
        return S

    def value(self, chosen: Sequence[Chosen], variance: Array, x: Array | None, rounds: int = 2) -> State:
        nominal = self.prior(chosen, x)
        p = Posterior(self.cells, nominal, variance)
        spread = np.ones(len(self.families))
        for _ in range(rounds):
            S = nominal.copy()
            for f, idx in enumerate(self.families):
                if nominal[idx[0]] > 0:
                    share = (p.mean[idx] ** 2 + np.diag(p.covariance)[idx]) / nominal[idx]
                    spread[f] = (self.fw + share.sum()) / (self.fw + len(idx))
                    S[idx] *= spread[f]
            p = Posterior(self.cells, S, p.noise(self.noise.floor, self.noise.weight))
        e = self.noise.evidence(p) + sum(c.group.log_prior - self.prior_nats for c in chosen)
        e -= 0.5 * self.fw * float(np.sum(np.log(spread) + 1.0 / spread - 1.0))
        return State(tuple(chosen), p, e)

    def run(self, most: int = 12, need: float = 1.0) -> State:
        start = self.value((), self.noise.floor, None, 8)
        state = start
        while len(state.chosen) < most:
            best = self.best_addition(state)
            if best is None or best.evidence - state.evidence < need:
                break
            gain = best.evidence - state.evidence
            count = self.cells.count
            grown = self.pruned(self.with_forms(best))
            if grown.evidence - state.evidence < need:
                self.cells.truncate(count)
                break
            state = grown
            self.say(f"+ {best.chosen[-1].group.name} {gain:.0f} -> {state.evidence:.0f}")
        return state

    def best_addition(self, state: State, count: int = 6) -> State | None:
        p = state.posterior
        offers = []
        for g in self.groups.values():
            if (g.cause, g.place) in state.keys:
                continue
            gain, scale = p.gain(g)
            offers.append((gain + g.log_prior, scale, g))
        offers.sort(key=lambda o: -o[0])
        seen, tried = set(), []
        for gain, scale, g in offers:
            if gain < self.prior_nats - 3.0 or len(tried) == count:
                break
            tried.append(self.value((*state.chosen, Chosen(g, scale)), p.variance, p.mean))
        return max(tried, key=lambda s: s.evidence, default=None)

    def with_forms(self, state: State) -> State:
        """Give the last cause its forms."""
        last = state.chosen[-1]
        forms = self.make_forms(last.group, state.posterior.mean)
        if not forms:
            return state
        index = tuple(self.cells.add(forms))
        chosen = (*state.chosen[:-1], replace(last, forms=index))
        return self.value(chosen, state.posterior.variance, state.posterior.mean, 3)

    def pruned(self, state: State) -> State:
        while len(state.chosen) > 1:
            others = [self.value([c for c in state.chosen if c is not out], state.posterior.variance, state.posterior.mean) for out in state.chosen]
            best = max(others, key=lambda s: s.evidence)
            if best.evidence < state.evidence:
                return state
            (gone,) = [c for c in state.chosen if c not in best.chosen]
            self.say(f"- {gone.group.name} {best.evidence - state.evidence:.1f}")
            state = best
        return state


def floor_of(cells: Cells, full: Array, rounds: int = 8) -> Array:
    """Noise that the whole dictionary leaves."""
    start = np.array([c.squares / np.maximum(np.diff(c.starts), 1) for c in cells.channels])
    p = Posterior(cells, full, start)
    rows = cells.rows
    for _ in range(rounds):
        p = Posterior(cells, full, p.noise(start, 0.0))
    return smoothed_floor(cells, p.variance * rows)
