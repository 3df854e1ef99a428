"""Of what the error is a function: every formula of the dictionary at the likeliest places, by its evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy import rules
from discrepancy.inference.scan import log_bayes_factor
from discrepancy.laws.bench import Bench
from discrepancy.laws.dictionary import hums, terms_at
from discrepancy.laws.lines import peaks_hz
from discrepancy.laws.place import Place
from discrepancy.laws.term import Term
from discrepancy.laws.told import Beside
from discrepancy.least_squares.fit import Fit
from estimator.arrays import Array


@dataclass(frozen=True)
class Judged:
    """A formula at a place.

    Attributes:
        place, term: which.
        nats: log Bayes factor that it is there beside all in the model.
    """

    place: Place
    term: Term
    nats: float


def judged(fit: Fit, bench: Bench, places: Sequence[Place]) -> list[Judged]:
    """Every formula at every one of some places, the likeliest first."""
    beside = Beside(fit)
    trials = fit.problem.trials
    out, peaks = [], peaks_hz(fit, bench)
    for place in places:
        spread = lambda variable: np.concatenate([bench.signal(t, variable) for t in trials])  # noqa: E731
        terms = terms_at(place, bench.variables, spread) + hums(peaks)
        out += _at_place(beside, bench, place, terms, trials)
    # A hum is too fast to be seen in the error of a place over time.
    for place in bench.places if peaks else ():
        if place not in places:
            out += _at_place(beside, bench, place, hums(peaks), trials)
    return sorted(out, key=lambda one: -one.nats)


def _at_place(
    beside: Beside,
    bench: Bench,
    place: Place,
    terms: Sequence[Term],
    trials: Sequence[int],
) -> list[Judged]:
    out, at, first = [], 0, trials[0]
    while at < len(terms):
        chunk, made, groups = list[Term](), list[Array](), list[int]()
        while at < len(terms) and sum(groups) < rules.LAW_CHUNK:
            chunk.append(terms[at])
            made.append(_values(bench, place, first, chunk[-1]))
            groups.append(made[-1].shape[1] * len(place.axes))
            at += 1
        # A trial at a time, for the sake of memory.
        blocks = (
            _columns(
                bench, place, t, made if t == first else [_values(bench, place, t, term) for term in chunk]
            )
            for t in trials
        )
        for term, (information, score) in zip(chunk, beside.each(blocks, groups), strict=True):
            out.append(Judged(place, term, _nats(information, score)))
    return out


def _values(bench: Bench, place: Place, trial: int, term: Term) -> Array:
    return bench.with_offset(place, term, bench.of_term(trial, term))


def _columns(bench: Bench, place: Place, trial: int, values: Sequence[Array]) -> Array:
    """What formulas of such values add to a trial's whitened residual, shape (n, C, k)."""
    directions = bench.directions(trial, place)
    return bench.white(trial, bench.moved(trial, directions, np.concatenate(values, axis=1)))


def _nats(information: Array, score: Array) -> float:
    """Log Bayes factor, every column in units in which it is just seen."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    return log_bayes_factor(information * np.outer(scale, scale), score * scale, 0.0)
