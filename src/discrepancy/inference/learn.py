"""What is not known beforehand: how much every kind scatters, how strong the noise is, how large what is hidden."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, get_lapack_funcs

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.inference.prior import Level
from discrepancy.inference.twins import twins
from discrepancy.least_squares.problem import Problem
from estimator.arrays import Array

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Learnt:
    """A hypothesis at its best: some candidates are there, and spreads and powers are as likely as can be.

    Empirical Bayes: the marginal likelihood, in which all unknowns are integrated out, times the priors of spreads and
    powers is maximal; found by MacKay's fixed point ("Bayesian interpolation", Neural Computation 4, 1992, eq. 2.22).

    Attributes:
        problem: with the spreads and powers.
        free: candidates that are there; the spread of each is its own.
        log_evidence: of all data, up to what all hypotheses have in common [nats].
        levels: what the spread of every kind at several places is held against besides its tolerance.
    """

    problem: Problem
    free: tuple[int, ...]
    log_evidence: float
    levels: Mapping[str, Level]


@dataclass(frozen=True, eq=False)
class _Parts:
    """The columns that are in a hypothesis.

    Attributes:
        grams: upper triangles of the Gram matrices of every cell that has numbers, the residual last, shape (K, half)
            with half = m (m + 1) / 2 and m = used + 1.
        upper: which of a whole matrix's numbers, one row after the other, these are, shape (half,).
        at: which of these each of a whole matrix's numbers is, shape (m, m).
        lower: which of the numbers of a matrix (used, used) are in its lower triangle.
        sizes: numbers in every cell that trials' own unknowns leave, shape (K,).
        group: of every used column: -1 for shared unknowns, else the number of its spread.
        least, most: spread that a group has at least and at most, shape (groups,).
        several: which groups are of kinds at several places, whose spread has a prior, in the order of ``kinds``.
        own: which groups are spreads of free candidates.
        kinds: group of every kind with a spread.
        like: of every kind at one place, groups of the kinds of its family at several, which it is as far off as.
    """

    grams: Array
    upper: Indices
    at: Indices
    lower: NDArray[np.bool_]
    sizes: Array
    group: Indices
    least: Array
    most: Array
    several: NDArray[np.bool_]
    own: NDArray[np.bool_]
    kinds: Mapping[str, int]
    like: Mapping[int, Indices]


def learnt(problem: Problem, free: Sequence[int] = (), rounds: int = rules.LEARN_ROUNDS) -> Learnt:
    """Spreads, powers and evidence of a hypothesis.

    Args:
        problem: where to start; its powers and spreads should be near.
        free: candidates that are there.
        rounds: largest number of steps.
    """
    names, parts = _parts(problem, free)
    power = np.concatenate([p[c.sizes > 0] for p, c in zip(problem.power, problem.cells, strict=True)])
    start = np.array([np.sqrt(np.mean(problem.spread[at] ** 2)) for at in names])
    for one, family in parts.like.items():  # where it was free before, its spread was its own
        start[one] = _middle(start[family], np.ones(len(family)))
    evidence, power, spread, level = _climbed(parts, power, np.clip(start, parts.least, parts.most), rounds)
    # Two kinds that leave the same trace share a scatter, a saddle: one of them alone is likelier.
    wide = [kind for kind, group in parts.kinds.items() if spread[group] > rules.HELD_FACTOR]
    for pair in twins(problem, wide):
        a, b = (parts.kinds[kind] for kind in pair)
        for one, other in ((a, b), (b, a)):
            apart = np.array(spread)
            apart[one], apart[other] = min(np.sqrt(2.0) * spread[one], parts.most[one]), parts.least[other]
            alone = _climbed(parts, power, apart, rounds)
            if alone[0] > evidence:
                evidence, power, spread, level = alone
    evidence -= problem.price
    found, at = [], 0
    for old, cells in zip(problem.power, problem.cells, strict=True):
        new, filled = np.array(old), cells.sizes > 0
        new[filled] = power[at : at + int(filled.sum())]
        found.append(new)
        at += int(filled.sum())
    spreads = np.array(problem.spread)
    for where, value in zip(names, spread, strict=True):
        spreads[where] = value
    several = [kind for kind, k in parts.kinds.items() if parts.several[k]]
    levels = {kind: Level(level.spread[k], level.numbers[k]) for k, kind in enumerate(several)}
    return Learnt(problem.with_noise(found, spreads), tuple(free), evidence, levels)


def _climbed(parts: _Parts, power: Array, spread: Array, rounds: int) -> tuple[float, Array, Array, Level]:
    """Log evidence, powers, spreads and levels at the maximum uphill from some, or after so many steps."""
    last = -np.inf
    while True:
        evidence, power_next, spread_next, level = _step(parts, power, spread)
        if not rounds or (evidence - last < rules.LEARN_NATS and np.isfinite(last)):
            return evidence, power, spread, level
        last, power, spread, rounds = evidence, power_next, spread_next, rounds - 1


def widest(kind: Sequence[Candidate]) -> float:
    """Largest spread over its tolerance that is learnt of a kind."""
    return min(rules.MOST_SPREAD, *(candidate.most_spread for candidate in kind))


def _parts(problem: Problem, free: Sequence[int]) -> tuple[list[Indices], _Parts]:
    count = problem.shared + len(problem.tolerant)
    group = np.full(count, -2)
    group[: problem.shared] = -1
    names: list[Indices] = []
    least, most, several, own = [], [], [], []
    kinds: dict[str, list[int]] = {}
    for index, candidate in enumerate(problem.candidates):
        if index not in free and problem.has_tolerance(index):
            kinds.setdefault(candidate.cause, []).append(index)
    groups: dict[str, int] = {}
    for kind, members in kinds.items():
        groups[kind] = len(names)
        at = np.concatenate([np.r_[problem.columns_of(i)] for i in members])
        group[problem.shared + at] = len(names)
        names.append(at)
        least.append(1.0)
        # What was left out may not take what it is not to be named for.
        named = not problem.candidates[members[0]].hidden
        most.append(widest([problem.candidates[i] for i in members]) if named else 1.0)
        several.append(len(members) > 1)
        own.append(False)
    like = _like(problem, kinds, groups)
    for index in free:
        at = np.r_[problem.columns_of(index)]
        group[problem.shared + at] = len(names)
        names.append(at)
        least.append(
            rules.LEAST_SLAB if problem.candidates[index].parameters[0].tolerance else rules.LEAST_SIZE
        )
        most.append(np.inf)
        several.append(False)
        own.append(True)
    used = np.flatnonzero(group > -2)
    both = np.append(used, count)
    sizes = [own[c.sizes > 0] for own, c in zip(problem.degrees, problem.cells, strict=True)]
    rows, columns = np.triu_indices(len(both))
    whole = both[rows] * (count + 1) + both[columns]
    at = np.empty((len(both), len(both)), dtype=np.intp)
    at[rows, columns] = at[columns, rows] = np.arange(len(rows))
    pairs = zip(problem.cell_grams, problem.cells, strict=True)
    filled = (gram for own, c in pairs for gram in own.each(np.flatnonzero(c.sizes).tolist()))
    grams = np.empty((sum(map(len, sizes)), len(rows)))
    for one, gram in zip(grams, filled, strict=True):
        np.take(gram, whole, out=one, mode="clip")
    parts = _Parts(
        grams, rows * len(both) + columns, at, np.tri(len(used), dtype=bool), np.concatenate(sizes), group[used],
        np.array(least), np.array(most), np.array(several, dtype=bool), np.array(own, dtype=bool), groups, like,
    )  # fmt: skip
    return names, parts


def _like(
    problem: Problem, kinds: Mapping[str, Sequence[int]], groups: Mapping[str, int]
) -> dict[int, Indices]:
    """Groups of the kinds at several places whose family a kind at one place shares, by the group of that."""
    family = {kind: problem.candidates[members[0]].family for kind, members in kinds.items()}
    return {
        groups[kind]: np.array(
            [groups[k] for k in kinds if family[k] == family[kind] and len(kinds[k]) > 1], dtype=np.intp
        )
        for kind, members in kinds.items()
        if len(members) == 1
    }


def _step(parts: _Parts, power: Array, spread: Array) -> tuple[float, Array, Array, Level]:
    """Log evidence with its priors at given powers and spreads, the next ones, and the kinds' level."""
    count = len(parts.group) + 1
    gram = ((1.0 / power) @ parts.grams).take(parts.at)
    H, b, c = gram[:-1, :-1], gram[:-1, -1], gram[-1, -1]
    shared = parts.group < 0
    with np.errstate(divide="ignore"):
        prior = np.where(shared, rules.FLAT_SHARE * np.diag(H), np.append(spread, 1.0)[parts.group] ** -2.0)
    H = H + np.diag(np.maximum(prior, 1e-300))
    scale = 1.0 / np.sqrt(np.diag(H))
    factor = cholesky(H * np.outer(scale, scale), lower=True) if len(H) else H
    solution = scale * cho_solve((factor, True), scale * b) if len(H) else b
    (potri,) = get_lapack_funcs(("potri",), (factor,))
    inverse = potri(factor, lower=1)[0] if len(H) else H
    inverse = np.where(parts.lower, inverse, inverse.T)
    covariance = inverse * np.outer(scale, scale)
    log_det = 2.0 * float(np.sum(np.log(np.diag(factor)) - np.log(scale)))
    numbers = np.bincount(parts.group[~shared], minlength=len(spread)).astype(float)
    evidence = -0.5 * (float(c - b @ solution) + log_det) - float(
        numbers @ np.log(np.maximum(spread, 1e-300))
    )
    evidence -= 0.5 * float(parts.sizes @ np.log(power))
    evidence -= 0.5 * rules.POWER_NUMBERS * float(np.sum(np.log(power) + 1.0 / power - 1.0))
    variance = np.bincount(parts.group[~shared], np.diag(covariance)[~shared], minlength=len(spread))
    told = np.clip(numbers - variance / spread**2, 1e-6, None)
    several, near, weight = parts.several, np.ones(len(spread)), np.zeros(len(spread))
    level = Level.of(spread[several], (told / numbers)[several])
    loss, near[several], weight[several] = level.prior(spread[several])
    evidence -= float(np.sum(loss))
    # Next powers: what is left over the numbers that are not spent on unknowns.
    x = np.append(-solution, 1.0)
    both = np.zeros((2, count, count))
    both[0], both[1, :-1, :-1] = np.outer(x, x), covariance
    both *= 2.0 - np.eye(count)  # what is below the diagonal counts, too
    left, spent = (parts.grams @ one.take(parts.upper) for one in both)
    spent = spent / power
    power_next = (left + rules.POWER_NUMBERS) / (np.maximum(parts.sizes - spent, 1.0) + rules.POWER_NUMBERS)
    # Next spreads: squares over the numbers that the data determine.
    squares = np.bincount(parts.group[~shared], solution[~shared] ** 2, minlength=len(spread))
    spread_next = np.sqrt((squares + weight * near**2) / (told + weight))
    spread_next = np.clip(spread_next, parts.least, parts.most)
    for one, others in parts.like.items():
        spread_next[one] = min(_middle(spread_next[others], told[others]), parts.most[one])
    return evidence, np.maximum(power_next, rules.LEAST_POWER), spread_next, level


def _middle(spreads: Array, weights: Array) -> float:
    """Weighted median of some spreads; of none, that within tolerances.

    One of a kind cannot show how its kind scatters: it is off or not. Where robots rub ten times as much as they
    should, though, a payload that is dragged ten times as much is no news: it is as far off as its family is.
    """
    if not len(spreads):
        return 1.0
    order = np.argsort(spreads)
    passed = np.cumsum(weights[order])
    return float(spreads[order][np.searchsorted(passed, 0.5 * passed[-1])])


def worth_spreads(one: Learnt, kinds: Collection[str]) -> dict[str, float]:
    """By how many nats the data want each kind to scatter more than its tolerance; 0 where they do not."""
    if not kinds:
        return {}
    problem, out = one.problem, {}
    names, parts = _parts(problem, one.free)
    power = np.concatenate([p[c.sizes > 0] for p, c in zip(problem.power, problem.cells, strict=True)])
    values = np.array([np.sqrt(np.mean(problem.spread[at] ** 2)) for at in names])
    for kind in kinds:
        held = values.copy()
        if kind in parts.kinds:
            held[parts.kinds[kind]] = 1.0
        out[kind] = one.log_evidence + problem.price - _step(parts, power, held)[0]
    return out
