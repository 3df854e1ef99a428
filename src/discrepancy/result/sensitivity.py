"""What these recordings could have shown: the smallest size of every cause that would have been noticed."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.engine.explanation import Explanation
from discrepancy.inference.learn import widest
from discrepancy.result.evidence_list import needed_nats
from estimator.arrays import Array

FINER = 16
"""Sizes tried in the octave of a limit, and then in their step: to 0.4 %."""
LEARNT = 2.0 ** np.arange(0.0, np.log2(rules.MOST_SPREAD), 0.25)
"""Spreads that a kind may be taken to have, in units."""


def detection_limits(explanation: Explanation) -> list[dict[str, Any]]:
    """Detection limit of every parameter at every place: {cause, kind, robot, joint, parameters: {name: size}}.

    A size is None where the data say nothing about it. Causes that are found, and transients, are left out.
    """
    return [entry for _, entry in _judged(explanation)]


def blind_spots(explanation: Explanation) -> list[dict[str, Any]]:
    """Causes and places about which these recordings say nothing at all, in the form of ``Rig.undecidable``."""
    places: dict[str, list[str]] = {}
    for candidate, entry in _judged(explanation):
        if all(size is None for size in entry["parameters"].values()):
            places.setdefault(candidate.kind, []).append(candidate.place)
    return [
        {
            "what": f"{cause} ({'; '.join(where)})",
            "why": "its trace in these recordings cannot be told from the unknowns",
            "remedy": "motion in more directions, where any helps",
        }
        for cause, where in places.items()
    ]


def _judged(explanation: Explanation) -> Iterator[tuple[Candidate, dict[str, Any]]]:
    fit, problem = explanation.fit, explanation.problem
    kinds: dict[str, list[int]] = {}
    for index, candidate in enumerate(problem.candidates):
        if index not in fit.free and not candidate.transient and not candidate.hidden:
            kinds.setdefault(candidate.cause, []).append(index)
    for kind, members in kinds.items():
        told = [_along(*fit.told(index)) for index in members]
        scatters = problem.has_tolerance(members[0]) and len(members) > 1
        spreads = np.zeros(1)
        if problem.has_tolerance(members[0]):  # of one alone, as its family scatters
            spreads = problem.spread[problem.columns_of(members[0])][:1]
        if scatters:
            most_spread = widest([problem.candidates[index] for index in members])
            spreads = LEARNT[most_spread >= LEARNT]
        healthy = np.array([_log_evidence(z, lam, spreads) for lam, z, _ in told])
        prior = np.zeros(len(spreads))
        if scatters:
            prior = explanation.hypothesis.learnt.levels[kind].prior(spreads)[0]
        for k, index in enumerate(members):
            candidate, (lam, _, vectors) = problem.candidates[index], told[k]
            rest = np.delete(healthy, k, axis=0).sum(axis=0) - prior
            # Where all scatter, nothing small can stand out.
            most = rules.ABSURD_UNITS * max(float(problem.spread[problem.columns_of(index)][0]), 1.0)
            sizes = noticed(lam, vectors, spreads, rest, needed_nats(problem, candidate), most)
            parameters = {
                p.name: float(size * p.unit) if size < most else None
                for p, size in zip(candidate.parameters, sizes, strict=True)
            }
            place = dict(zip(("cause", "robot", "joint"), candidate.key, strict=True))
            yield candidate, {"kind": candidate.kind, **place, "parameters": parameters}


def noticed(
    lam: Array, vectors: Array, spreads: Array, rest: Array, needed: float, most: float = rules.ABSURD_UNITS
) -> Array:
    """Size of every parameter, each alone, whose log Bayes factor reaches ``needed`` nine times in ten.

    A fault competes with a spread of the whole kind that is large enough to hold it.

    Args:
        lam, vectors: information about the parameters given all else, in units: what is visible of its eigenvalues (m,)
            and eigenvectors, shape (k, m).
        spreads: that the kind may have, in units, shape (s,).
        rest: log evidence of each of them without this candidate, prior included, shape (s,).
        needed: nats.
        most: largest size that is sought.

    Returns:
        Sizes in units, shape (k,); infinite where no size does.
    """
    out = np.full(len(vectors), np.inf)
    for k, along in enumerate(vectors):
        known = float(along**2 @ lam)
        if known < rules.LEAST_INFORMATION:
            continue

        def least(sizes: Array, score: Array = lam * along) -> int:
            """Which of some sizes is the first that reaches it; how many there are where none does."""
            z = sizes[:, None] * score
            slabs = np.sqrt(np.mean((z / lam) ** 2, axis=1))[:, None] * 2.0 ** np.arange(-2.0, 2.5)
            if spreads[0] > 0.0:
                slabs = np.maximum(slabs, rules.LEAST_SLAB)
            there = rest.max() + _log_evidence(z, lam, slabs).max(axis=1)
            reached = there - (rest + _log_evidence(z, lam, spreads)).max(axis=1) >= needed
            return int(np.argmax(reached)) if reached.any() else len(sizes)

        octaves = 2.0 ** np.arange(-20.0, np.log2(most) + 1.0)
        if (which := least(octaves)) < len(octaves):
            low, high = octaves[which] / 2.0, octaves[which]
            for _ in range(2):
                steps = np.linspace(low, high, FINER + 1)[1:]
                which = min(least(steps), FINER - 1)
                low, high = steps[which] - (high - low) / FINER, steps[which]
            out[k] = high + rules.NOTICED_SE / np.sqrt(known)  # noise takes as much away one time in ten
    return out


def _along(information: Array, score: Array) -> tuple[Array, Array, Array]:
    """What the data see of a candidate: eigenvalues of the information, the score along them, eigenvectors."""
    lam, vectors = np.linalg.eigh(information)
    keep = lam > rules.LEAST_INFORMATION
    return lam[keep], vectors[:, keep].T @ score, vectors[:, keep]


def _log_evidence(z: Array, lam: Array, spreads: Array) -> Array:
    """Of values (..., m) that are normal with each of some spreads (..., s), over none; see ``engine.scan``."""
    square = np.asarray(spreads)[..., None] ** 2
    told = lam * square
    return 0.5 * np.sum(z[..., None, :] ** 2 * square / (1.0 + told) - np.log1p(told), axis=-1)
