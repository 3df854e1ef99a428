"""From what a search found to one word."""

from typing import Literal

from discrepancy import rules
from discrepancy.engine.explanation import Explanation

Verdict = Literal["consistent", "explained", "partly_explained", "unexplained"]


def verdict_of(explanation: Explanation) -> Verdict:
    """The verdict by what the causes leave and remove, and by whether they can be believed together."""
    if not explanation.found:
        return "consistent" if explanation.clean else "unexplained"
    if only_add_up(explanation):
        return "unexplained"
    if explanation.clean:
        return "explained"
    return "partly_explained" if explanation.explained >= rules.LEAST_SHARE else "unexplained"


def only_add_up(explanation: Explanation) -> bool:
    """Three causes at one robot, or that look alike, imitate another that the catalogue does not have."""
    robots = {found.candidate.robot for found in explanation.found} - {None}
    families = {found.candidate.family for found in explanation.found}
    # Where no cause has a robot, all are at one place anyway, and only their families tell.
    placed = any(candidate.robot for candidate in explanation.problem.candidates)
    few = rules.MOST_BELIEVED
    return len(explanation.found) > few and ((placed and len(robots) <= 1) or len(families) <= few)
