"""Probability of each cause of a set: remove it, and compare everything that could take its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discrepancy.evidence.posterior import Group
from discrepancy.evidence.search import Chosen, Search, State


@dataclass(frozen=True)
class Rival:
    """An alternative to a cause.

    Attributes:
        group: a cause; None: nothing, or an error of the other causes' laws.
        probability: its probability.
    """

    group: Group | None
    probability: float


@dataclass(frozen=True)
class Odds:
    """A cause of the set with its alternatives.

    Attributes:
        chosen: the cause.
        probability: probability of this cause at this place.
        over_nothing: log odds over nothing in its place [nats].
        rivals: all alternatives, likeliest first.
    """

    chosen: Chosen
    probability: float
    over_nothing: float
    rivals: tuple[Rival, ...]

    def told(self, share: float = 0.9) -> tuple[Group | None, ...]:
        """The smallest set of alternatives that holds a share of the probability, likeliest first."""
        every = sorted([(self.probability, self.chosen.group), *((r.probability, r.group) for r in self.rivals)],
                       key=lambda pair: -pair[0])  # fmt: skip
        total, out = 0.0, []
        share *= sum(probability for probability, _ in every)
        for probability, group in every:
            out.append(group)
            total += probability
            if total >= share:
                break
        return tuple(out)


def without_unfounded(search: Search, state: State) -> State:
    """Drop causes, weakest first, that are more likely to be errors of the other causes' laws."""
    while len(state.chosen) > 1:
        shorter = [_without(search, state, c) for c in state.chosen]
        k = int(np.argmax([s.evidence for s in shorter]))
        if _nothing(search, state, state.chosen[k], shorter[k]) < state.evidence:
            break
        state = shorter[k]
    return state


def odds_of(search: Search, state: State) -> list[Odds]:
    """Probabilities of all causes of a search result."""
    return [_odds(search, state, c) for c in state.chosen]


def _without(search: Search, state: State, own: Chosen) -> State:
    return search.settled(search.value([c for c in state.chosen if c is not own], state.posterior))


def _nothing(search: Search, state: State, own: Chosen, without: State) -> float:
    """Log evidence that a cause is absent: its trace is within tolerance, or is an error of the other causes' laws.

    A law's error explains less than the law, so the worth of the laws is the upper limit of this evidence. It excludes
    what the tolerance explains. Beside an unlisted law, events and further unlisted laws must explain more, because
    such a law is fitted, not derived.
    """
    s = search.settings
    room = s.open_nats
    laws = [c for c in without.chosen if c.group.late]
    if own.group.second and laws:
        bare = [c for c in without.chosen if not c.group.late]
        bare_evidence = search.settled(search.value(bare, without.posterior)).evidence
        room = max(room, s.unlisted_share * (without.evidence - bare_evidence))
    empty = search.settled(search.value((), without.posterior))
    worth = without.evidence - empty.evidence - search.tolerated(state, own)
    return without.evidence + float(np.clip(worth, 0.0, room))


def _odds(search: Search, state: State, own: Chosen) -> Odds:
    cells = search.problem.cells
    rest = [c for c in state.chosen if c is not own]
    without = _without(search, state, own)
    weighed: list[tuple[float, Group | None]] = [(_nothing(search, state, own, without), None)]
    for chosen in search.rivals(without, own.group)[: search.settings.most_rivals]:
        count = cells.count
        rival = search.with_one(rest, chosen, without.posterior)
        if rival.evidence > state.evidence - search.settings.within_nats:
            rival = search.settled(search.formed(rival))
        weighed.append((rival.evidence, chosen.group))
        cells.truncate(count)
    logs = np.array([state.evidence, *(w[0] for w in weighed)])
    share = np.exp(logs - logs.max())
    share /= share.sum()
    if search.is_within_tolerance(state, own):
        share = np.eye(len(share))[1]  # a value within tolerance is no fault
    merged: dict[tuple[str, str] | None, Rival] = {}
    for (_, group), p in zip(weighed, share[1:], strict=True):
        key = None if group is None else group.key
        if key == own.group.key or (group and own.group.columns in group.members):
            share[0] += p  # another shape of the same cause, or the cause at all joints
        elif key not in merged or merged[key].probability < p:
            merged[key] = Rival(group, float(p))
    rivals = sorted(merged.values(), key=lambda r: -r.probability)
    return Odds(own, float(share[0]), float(state.evidence - without.evidence), tuple(rivals))
