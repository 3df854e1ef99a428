"""From what a search found to one word."""

from typing import Literal

from discrepancy import rules
from discrepancy.engine.explanation import Explanation

Verdict = Literal["consistent", "miscalibrated", "explained", "partly_explained", "unexplained"]


def verdict_of(explanation: Explanation) -> Verdict:
    """The verdict by what is there, and by what the causes leave and remove."""
    if explanation.found:
        if explanation.clean:
            return "explained"
        return "partly_explained" if explanation.explained >= rules.LEAST_SHARE else "unexplained"
    if not explanation.clean:
        return "unexplained"
    return "miscalibrated" if explanation.scatter else "consistent"
