"""Which part of the names tells the robot, and which names are one channel of all robots."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mocobot_logs.draft.candidates import Candidate

HOLE = "\0"
"""Stands for the robot in a name."""


@dataclass(frozen=True)
class Robots:
    """How names tell robots.

    Attributes:
        called: what tells each robot in names, in order; nothing where there is a single one.
        placeholder: of a map: ``{robot}``, ``{robot0}`` or ``{name}``; "" for a single robot.
    """

    called: tuple[str, ...]
    placeholder: str


Templates = dict[str, dict[str, Candidate]]
"""Names with ``HOLE`` in the place of the robot, and what fills it."""


def templates_of(candidates: Sequence[Candidate]) -> Templates:
    """Every way in which names of one channel may differ by the robot alone."""
    found: Templates = defaultdict(dict)
    for candidate in candidates:
        name = candidate.name
        for told in {name[a:b] for a, b in candidate.reading.rest}:
            template, at = "", 0
            for a, b in candidate.reading.rest:
                if name[a:b] == told:
                    template, at = template + name[at:a] + HOLE, b
            found[template + name[at:]][told] = candidate
    return dict(found)


def find_robots(channels: Mapping[str, Templates]) -> Robots:
    """What tells the robots in most channels; of equals, the larger set and numbers from 1 or 0."""
    votes: Counter[frozenset[str]] = Counter()
    for templates in channels.values():
        for told in {frozenset(each) for each in templates.values() if len(each) > 1}:
            votes[told] += 1
    if not votes:
        return Robots((), "")
    order = {name: k for k, name in enumerate(n for t in channels.values() for e in t.values() for n in e)}
    best = max(votes, key=lambda told: (votes[told], _placeholder(told) != "{name}", len(told)))
    placeholder = _placeholder(best)
    numbered = all(name.isdigit() for name in best)
    called = sorted(best, key=int) if numbered else sorted(best, key=order.__getitem__)
    return Robots(tuple(called), placeholder)


def _placeholder(told: frozenset[str]) -> str:
    for first, placeholder in ((1, "{robot}"), (0, "{robot0}")):
        if told == {str(k) for k in range(first, first + len(told))}:
            return placeholder
    return "{name}"
