"""When an event acted: the interval that explains most, and whether it grew and faded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate, Transient
from discrepancy.least_squares.fit import Fit
from discrepancy.rig import Rig
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Elements:
    """An event in short intervals one after the other, of which any longer one is made.

    Attributes:
        event: in one of its intervals.
        nodes: between them [s], shape (J + 1,).
        columns: of the event in all of them, in its units, shape (n, C, J k) per trial.
    """

    event: Candidate
    nodes: Array
    columns: Sequence[Array]

    @classmethod
    def of(cls, rig: Rig, event: Candidate, nodes: Array) -> Elements:
        """Of the intervals between some times."""
        ramp = {"ramp_s": 0.0} if event.shape.get("ramp_s") else {}
        each = [
            event.in_shape({"start_s": a, "duration_s": b - a} | ramp) for a, b in pairwise(nodes.tolist())
        ]
        units, parts = np.tile(event.units, len(each)), [rig.columns(one) for one in each]
        columns = [
            np.concatenate([part[t] for part in parts], axis=2) * units
            if event.acts_in(t)
            else np.broadcast_to(0.0, (*parts[0][t].shape[:2], len(units)))
            for t in range(len(parts[0]))
        ]
        return cls(event, nodes, columns)

    def within(self, event: Candidate) -> bool:
        """Whether an event neither begins nor ends where they do."""
        at = event.transient
        assert at is not None
        return self.nodes[1] < at.start_s and at.start_s + at.duration_s < self.nodes[-2]

    def best(self, fit: Fit, shares: Sequence[float]) -> list[tuple[Candidate, float]]:
        """The event between the two nodes where it explains most, and half of what that takes off chi-square [nats].

        Args:
            fit: without the event.
            shares: of its duration in which it grows and fades; one result for each.
        """
        count, k = len(self.nodes) - 1, len(self.event.parameters)
        information, score = fit.told_by(self.columns)
        information, score = information.reshape(count, k, count, k), score.reshape(count, k)
        pairs, found = np.transpose(np.triu_indices(count + 1, 1)), []
        pairs = pairs[np.diff(self.nodes[pairs])[:, 0] > rules.EVENT_SHORTEST_S]
        for share in shares:
            whens = [self._between(start, end, share) for start, end in self.nodes[pairs].tolist()]
            weights = np.array([np.diff(when.acted(self.nodes)) for when in whens]) / np.diff(self.nodes)
            half = np.tensordot(weights, information, axes=(1, 0))  # (pairs, k, J, k)
            own = np.einsum("pkjl,pj->pkl", half, weights) + rules.LEAST_INFORMATION * np.eye(k)
            told = weights @ score
            gain = 0.5 * np.sum(told * np.linalg.solve(own, told[..., None])[..., 0], axis=1)
            most = int(np.argmax(gain))
            found.append((self.event.in_shape({"ramp_s": 0.0} | whens[most].shape), float(gain[most])))
        return found

    def _between(self, start: float, end: float, share: float) -> Transient:
        at = self.event.transient
        assert at is not None
        return Transient(at.trial, start, end - start, share * (end - start))


def all_around(rig: Rig, event: Candidate) -> Elements:
    """Intervals around that of an event, up to three times as long."""
    at = event.transient
    assert at is not None
    ends = at.start_s - at.duration_s, at.start_s + 2.0 * at.duration_s
    return Elements.of(rig, event, np.linspace(*ends, 3 * rules.EVENT_PARTS + 1))


def best_event(fit: Fit, around: Elements, rig: Rig) -> list[Candidate]:
    """The event in the interval that explains most, and with ramps if it explains more with them.

    Args:
        fit: without the event.
        around: intervals in which it is.
        rig: for columns of shorter ones at its ends.
    """
    (square, _), *ramped = around.best(fit, rules.EVENT_RAMPS)
    at = square.transient
    assert at is not None
    near = float(around.nodes[1] - around.nodes[0]) * np.linspace(-1.0, 1.0, rules.EVENT_PARTS + 1)
    near = near[np.abs(near) < 0.5 * at.duration_s]
    nodes = np.concatenate([at.start_s + near, at.start_s + at.duration_s + near])
    ((square, gain),) = Elements.of(rig, square, nodes).best(fit, (0.0,))
    other, more = max(ramped, key=lambda one: one[1])
    return [square, other] if more > gain else [square]
