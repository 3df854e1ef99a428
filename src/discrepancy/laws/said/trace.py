"""A law beside the error that was located at its place: what the formula was made from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from discrepancy import rules
from discrepancy.laws.bench import Bench
from discrepancy.laws.candidate import LawCandidate
from discrepancy.laws.said.numbers import physical
from discrepancy.laws.where import Located
from estimator.arrays import Array


def traces_of(
    candidate: LawCandidate, values: Array, located: Sequence[Located], bench: Bench
) -> list[dict[str, Any]]:
    """One entry a trial: ``time_s``, ``signal`` (of the law), and by component ``error``, ``se`` and ``law``.

    The error is what explains most at that place over time, found without any formula; it is determined up to what
    unknowns and tolerances can explain, such as a constant, and is shifted by a constant onto the law. None where the
    place was not located, or with knots too far apart to show the law.

    Args:
        candidate: the law.
        values: of its parameters, shape (k,).
        located: places with their errors.
        bench: of the rig.
    """
    found = next((one for one in located if one.place.key == candidate.at.key), None)
    if found is None:
        return []
    table, out, offset = values.reshape(-1, len(candidate.at.axes)), [], np.zeros(len(candidate.at.axes))
    laws, all_, missed = [], 0.0, 0.0
    for trial, knots in enumerate(found.knots_s):
        time = np.arange(bench.length(trial)) / bench.rate_hz(trial)
        law = bench.values(trial, candidate) @ table
        laws.append(np.stack([np.interp(knots, time, x) for x in law.T], axis=1))
        between = np.stack([np.interp(time, knots, x) for x in laws[-1].T], axis=1)
        all_, missed = (
            all_ + float(np.var(law, axis=0).sum()),
            missed + float(np.mean((law - between) ** 2, axis=0).sum()),
        )
    if missed > rules.LAW_KNOTS_MISS * all_:
        return []
    weights = [1.0 / np.maximum(se, 1e-300) ** 2 for se in found.se]
    total = np.sum([w.sum(axis=0) for w in weights], axis=0)
    offset = np.sum(
        [(w * (e - x)).sum(axis=0) for w, e, x in zip(weights, found.errors, laws, strict=True)], axis=0
    )
    offset = offset / total
    for trial, (knots, error, se, law) in enumerate(
        zip(found.knots_s, found.errors, found.se, laws, strict=True)
    ):
        time = np.arange(bench.length(trial)) / bench.rate_hz(trial)
        signal, rows = (
            np.interp(knots, time, _signal(bench, trial, candidate, values)),
            bench.row_times(trial),
        )
        seen = (knots >= rows.min()) & (knots <= rows.max())  # of the rest nothing is known
        out.append(
            {
                "time_s": knots[seen].tolist(),
                "signal": signal[seen].tolist(),
                "error": (error - offset)[seen].T.tolist(),
                "se": se[seen].T.tolist(),
                "law": law[seen].T.tolist(),
            }
        )
    return out


def _signal(bench: Bench, trial: int, candidate: LawCandidate, values: Array) -> Array:
    """What the law is a function of, shape (Q,); of a vector along the direction that counts most."""
    of = candidate.term.of
    if not of.parts:
        return bench.signal(trial, of)
    now = physical(candidate, values, candidate.term.numbers)
    return np.sum(
        [now[f"by_{axis}"] * bench.signal(trial, part) for axis, part in zip(of.axes, of.parts, strict=True)],
        axis=0,
    )


def places_to_dict(located: Sequence[Located], most: int) -> list[dict[str, Any]]:
    """The likeliest places: name, robot, joint, and by how many nats an error there is likelier than nothing."""
    return [
        {"place": one.place.name, "robot": one.place.robot, "joint": one.place.joint, "nats": float(one.nats)}
        for one in located[:most]
    ]
