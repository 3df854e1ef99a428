"""Is the log wired as it says? Suspected mistakes are undone one by one, and what fits far better is reported.

A misfit (``misfit``) beyond what poorly calibrated robots show is *suspicious*; a mistake is found when undoing it
makes it ``DECISIVE`` times smaller. A smaller misfit may still be a mistake in the log of well calibrated robots: then
undoing has to make it ``OVERWHELMING`` times smaller. Several mistakes are found one after the other, the one that
helps most first; in the end each is put back alone, and dropped if it hardly matters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import Arms, design_of
from mocobot_inspect.signals import Signals
from mocobot_inspect.wiring.misfit import SUSPICIOUS, Misfit, team_misfit
from mocobot_inspect.wiring.mistakes import SUSPICIONS, Mistake, suspects, wrong_zero
from mocobot_inspect.wiring.mistakes.wrong_zero import WrongZero
from mocobot_inspect.wiring.motion import Fault, Grasp, Motions, grasp_motion
from mocobot_inspect.wiring.rigid_body import Body, rigid_body

DECISIVE = 4.0
"""How many times smaller the misfit must become."""
WORTH_TRYING = 0.3
"""Misfit below which there is nothing to be explained."""
OVERWHELMING = 15.0
"""How many times smaller a misfit that is not suspicious must become."""
HELPS = 1.5
"""How many times smaller one of several mistakes must make it."""
ALIKE = 1.3
"""Mistakes whose misfits differ by less than this factor cannot be told apart."""
MOST = 6
_REFINED = 6


@dataclass(frozen=True)
class Found:
    """A mistake that explains the misfit.

    Attributes:
        mistake: what is wrong.
        alternatives: others that explain it as well.
        misfit: with all other mistakes undone and this one not.
        after: total misfit with this one undone, too.
    """

    mistake: Mistake
    alternatives: tuple[Mistake, ...]
    misfit: Misfit
    after: float

    @property
    def before(self) -> float:
        """Total misfit with all other mistakes undone and this one not."""
        return self.misfit.total


@dataclass(frozen=True)
class Wiring:
    """What the search found.

    Attributes:
        as_is: misfit of the log as it is.
        found: mistakes, the one that matters most first; empty when none is found.
        undone: misfit with all of them undone.
        hidden: mistakes that would not show in these data.
        tried: number of mistakes looked for.
    """

    as_is: Misfit
    found: tuple[Found, ...]
    undone: Misfit
    hidden: tuple[Mistake, ...]
    tried: int


Told = tuple[Grasp | None, tuple[Fault, ...]]


class Team:
    """Misfits of one log with mistakes undone; what a mistake does not touch is not computed again."""

    def __init__(self, signals: Signals, arms: Arms, motions: Motions | None = None) -> None:
        """Compute every robot's motion, as far as it is not among those of the same log."""
        self.signals, self._robots = signals, arms
        self._motions = motions or Motions(arms)
        robots = range(signals.robots)
        with np.errstate(all="ignore"):
            self._arms = [self._motions.arm(signals, robot) for robot in robots]
            self._gimbals = [self._motions.gimbal(signals, robot) for robot in robots]
            self._told = [
                grasp_motion(signals, robot, self._arms[robot], self._gimbals[robot], arms)
                for robot in robots
            ]
            self._body = rigid_body([t[0] for t in self._told if t[0] is not None])
        self.misfit = self._judge(self._told, self._body)

    def without(self, mistake: Mistake, enough: float = np.inf) -> Misfit:
        """The misfit with a mistake undone; one beyond ``enough`` need not be exact."""
        signals, told = mistake.undo(self.signals), list(self._told)
        same_arms = signals.position is self.signals.position
        same_gimbals = signals.theta is self.signals.theta
        with np.errstate(all="ignore"):  # wrong channels may divide by zero: an infinite misfit
            for robot in mistake.robots:
                arm = self._arms[robot] if same_arms else self._motions.arm(signals, robot)
                gimbal = self._gimbals[robot] if same_gimbals else self._motions.gimbal(signals, robot)
                told[robot] = grasp_motion(signals, robot, arm, gimbal, self._robots)
        return self._judge(told, self._body if same_arms and same_gimbals else None, enough)

    def undone(self, mistake: Mistake) -> Team:
        """The team with a mistake undone."""
        return Team(mistake.undo(self.signals), self._robots, self._motions)

    def _judge(self, told: Sequence[Told], body: Body | None, enough: float = np.inf) -> Misfit:
        grasps, faults = [t[0] for t in told], [t[1] for t in told]
        most_noise = self._body.noise if self._body is not None else None
        return team_misfit(grasps, faults, self._robots.gravity_mps2, body, enough, most_noise)


def check_wiring(
    signals: Signals,
    arms: Arms,
    advance: Callable[[int], object] = lambda _: None,
    *,
    look_for_hidden: bool = True,
) -> Wiring:
    """Look for mistakes.

    Args:
        signals: the team's channels.
        arms: the robots as they are, or as designed.
        advance: takes the number of mistakes tried since the last call.
        look_for_hidden: whether to find out which mistakes would not show.
    """
    design = design_of(arms)
    first = team = Team(signals, arms)
    chain: list[tuple[Mistake, tuple[Mistake, ...]]] = []
    while team.misfit.total > WORTH_TRYING and team.misfit.tells and len(chain) < MOST:
        best, alike, after = _best(team, design, advance)
        suspicious = team.misfit.total > SUSPICIOUS
        if after > team.misfit.total / (HELPS if suspicious else OVERWHELMING):
            break
        chain.append((best, alike))
        team = team.undone(best)
    if not shows(first.misfit.total, team.misfit.total):
        chain, team = [], first
    found, team = _needed(first, team, chain)
    hidden, tried = _hidden(team, design, advance) if look_for_hidden else ((), 0)
    return Wiring(first.misfit, found, team.misfit, hidden, tried)


def shows(wrong: float, right: float) -> bool:
    """Whether a mistake is found that makes a misfit out of another."""
    return wrong > max(SUSPICIOUS, DECISIVE * right) or wrong > max(WORTH_TRYING, OVERWHELMING * right)


def _best(
    team: Team, design: OmnidDesign, advance: Callable[[int], object]
) -> tuple[Mistake, tuple[Mistake, ...], float]:
    """The mistake that explains most, and those that explain as much."""
    tried: list[tuple[float, int, Mistake]] = []
    least = np.inf
    for suspicion in SUSPICIONS:
        # Single encoders with a wrong zero are many, and looked at only if nothing else will do.
        if suspicion is wrong_zero and least <= max(WORTH_TRYING, team.misfit.total / OVERWHELMING):
            break
        for mistake in suspicion.suspects(team.signals, design):
            enough = ALIKE * least + 1e-9
            total = team.without(mistake, enough).total
            least = min(least, total)
            tried.append((total, len(tried), mistake))
            advance(1)
    tried.sort(key=lambda entry: entry[:2])
    top = []
    for total, rank, mistake in tried[:_REFINED]:
        refined = mistake.refined(lambda m: team.without(m).total)
        top.append((total if refined is mistake else team.without(refined).total, rank, refined))
    limit = ALIKE * min(entry[0] for entry in top) + 1e-9
    # Among those that cannot be told apart, the earliest suspicion comes first.
    alike = sorted((entry for entry in (*top, *tried[_REFINED:]) if entry[0] <= limit), key=lambda e: e[1])
    first, *others = _distinct([entry[2] for entry in alike])
    return first, tuple(others), alike[0][0]


def _alike(others: Team, best: Mistake, alike: tuple[Mistake, ...]) -> tuple[Mistake, ...]:
    """Those that still explain as much once all other mistakes are undone."""
    limit = ALIKE * others.without(best).total + 1e-9
    return tuple(mistake for mistake in alike if others.without(mistake).total <= limit)


def _distinct(mistakes: Sequence[Mistake]) -> list[Mistake]:
    """Each encoder's zero once, however many offsets were tried."""
    seen: set[object] = set()
    kept = []
    for mistake in mistakes:
        key = (mistake.robots, mistake.channels) if isinstance(mistake, WrongZero) else mistake
        if key not in seen:
            seen.add(key)
            kept.append(mistake)
    return kept


def _needed(
    first: Team, team: Team, chain: list[tuple[Mistake, tuple[Mistake, ...]]]
) -> tuple[tuple[Found, ...], Team]:
    """Each mistake of the chain with what it is worth, without those that hardly matter once all others are undone."""
    found = []
    for k in reversed(range(len(chain))):
        others = first
        for mistake, _ in (*chain[:k], *chain[k + 1 :]):
            others = others.undone(mistake)
        # Where something else is wrong, too, only what is beyond doubt is accused.
        worth = OVERWHELMING if team.misfit.suspicious else HELPS
        if others.misfit.total <= worth * team.misfit.total:
            chain, team = [*chain[:k], *chain[k + 1 :]], others
        else:
            found.append(Found(chain[k][0], _alike(others, *chain[k]), others.misfit, team.misfit.total))
    return tuple(reversed(found)), team


def _hidden(
    team: Team, design: OmnidDesign, advance: Callable[[int], object]
) -> tuple[tuple[Mistake, ...], int]:
    """Mistakes that would not have been found, had they been made."""
    hidden, tried = [], 0
    enough = max(SUSPICIOUS, DECISIVE * team.misfit.total)
    for mistake in suspects(team.signals, design):
        if not isinstance(mistake, WrongZero):
            tried += 1
            if not shows(team.without(mistake, enough).total, team.misfit.total):
                hidden.append(mistake)
            advance(1)
    return tuple(hidden), tried
