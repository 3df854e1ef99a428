"""What real causes leave of the catalogue's laws, as columns of one standard deviation each."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.causes.base import Shape
from discrepancy.rules import serial as rules
from discrepancy.serial.candidate import SerialCandidate, place_of
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.rows.other_forms import other_forms
from discrepancy.serial.serial_rows import SerialRows
from estimator.arrays import Array


def forms_beside(
    rows: SerialRows, candidate: Candidate, values: Array, there: Sequence[tuple[Candidate, Array]],
    rival: Candidate | None = None,
) -> list[Array]:  # fmt: skip
    """Whitened columns (n, C, k) per block of what a joint's causes leave if their laws have other forms.

    Friction in all its forms is one thing: what the catalogue has of it may be added up. But friction that the model
    names may give way before it slips, by as much as it is known; and that which was found has the shape in which it
    came first, so that another of its shapes would be no second kind.

    Args:
        rows: of the logs.
        candidate: which is judged beside them.
        values: of its parameters, in their units.
        there: causes with their values.
        rival: only what matters for this one in the candidate's place, too; None for all.
    """
    both = [candidate] if rival is None else [candidate, rival]
    if any(charged_as(one) is None for one in both):
        return []
    rubs = any(map(_rubs, both))
    own = [(c, v) for c, v in there if _at_a_joint(c) and not (rubs and _rubs(c))]
    soft: list[list[Array]] = []
    if all(map(_rubs, both)):
        soft = [*_named_friction(rows, candidate, values), *_shapes_of_found(rows, candidate, there)]
    driven = [] if rubs else [motor.joint for motor in rows.motors]
    if not own and not soft and not driven:
        return []
    traces = [[x @ v for x in rows.physical(c)] for c, v in own]
    sizes = [np.sqrt(np.mean(np.concatenate(trace) ** 2, axis=0)) for trace in traces]
    out = []
    for t in range(len(rows.trials)):
        part, k = rows.block_of[t]
        columns = [x[t] for x in soft]
        for (c, _), trace, size in zip(own, traces, sizes, strict=True):
            forms = other_forms(part.signals, part.reduction.samples[k], place_of(c), CAUSES[c.cause].family)
            columns += [rules.FORM_SHARE * trace[t] * m[:, None] for m in forms.times]
            columns += [rules.FORM_SHARE * size * m[:, None] for m in forms.besides]
        columns += [column for j in driven for column in _worth(rows, t, j)]
        out.append(rows.whitening[t](np.stack(columns, axis=2)))
    return out


def charged_as(candidate: Candidate) -> Literal["friction", "other"] | None:
    """Which causes are judged beside the same forms; None of those that are beside none."""
    if candidate.cause not in CAUSES or candidate.transient is not None:
        return None
    return "friction" if _rubs(candidate) else "other"


def _worth(rows: SerialRows, trial: int, j: int) -> list[Array]:
    """What a volt or an ampere of a drive is worth may be another here than there, rows (n, C) of one block.

    In every log, too: a winding that is 25 K warmer has a tenth more resistance.
    """
    part, k = rows.block_of[trial]
    torque = np.zeros_like(part.signals.torque)
    torque[:, j] = part.signals.torque[:, j]
    trace = part.reduction(torque)[k][:, rows.joints]
    forms = other_forms(part.signals, part.reduction.samples[k], j, "")
    here = [rules.UNKNOWN_SCALE_SHARE * trace * m[:, None] for m in forms.times]
    own = rules.UNKNOWN_SCALE_SHARE * trace
    return here + [own if other is part else np.zeros_like(own) for other in rows.parts]


def _at_a_joint(candidate: Candidate) -> bool:
    lasting = candidate.cause in CAUSES and candidate.transient is None
    return lasting and isinstance(candidate, SerialCandidate) and candidate.part == "joint"


def _rubs(candidate: Candidate) -> bool:
    cause = CAUSES[candidate.cause]
    return cause.dry or cause.family in ("friction", "asymmetric_friction")


def _shapes_of_found(
    rows: SerialRows, candidate: Candidate, there: Sequence[tuple[Candidate, Array]]
) -> list[list[Array]]:
    """How dry friction that was found at a joint changes in each of its other shapes, for another kind, rows (n, C)."""
    if not (_at_a_joint(candidate) and _rubs(candidate)) or candidate.cause == "friction":
        return []
    return [
        change
        for c, v in there
        if c.cause == "friction" and c.joint == candidate.joint
        for change in _changes(rows, c, CAUSES["friction"].shapes(rows.hints, place_of(c)), float(v[0]))
    ]


def _changes(
    rows: SerialRows, friction: Candidate, shapes: Sequence[Shape], much: float
) -> list[list[Array]]:
    """How so much dry friction changes if it has other shapes than its own, rows (n, C) of every block each."""
    first = rows.physical(friction)
    others = [replace(friction, shape=dict(s)) for s in shapes if dict(s) != friction.shape]
    return [
        [much * (x[..., 0] - y[..., 0]) for x, y in zip(rows.physical(other), first, strict=True)]
        for other in others
    ]


def _named_friction(rows: SerialRows, candidate: Candidate, values: Array) -> list[list[Array]]:
    """How the friction that the model names changes if it gives way, by each length of bristles, rows (n, C)."""
    if not CAUSES[candidate.cause].dry or candidate.joint is None:
        return []
    at = place_of(candidate)
    much = float(rows.tree.coulomb[at])
    # Friction that is off by more than a healthy one's may give way itself.
    if candidate.cause == "friction" and abs(values[0]) > rules.RUBS_MORE * rules.JOINT_SHARE * much:
        return []
    shapes = CAUSES["friction"].shapes(rows.hints, at)
    if not much or not shapes:
        return []
    rigid = CAUSES["friction"].at(rows.tree, rows.model.joints, at, shapes[0])
    return _changes(rows, rigid, [s for s in shapes if "bristle_rad" in s], rules.JOINT_SHARE * much)
