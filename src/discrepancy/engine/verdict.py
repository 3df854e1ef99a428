"""From what a search found to one word."""

from typing import Literal

from discrepancy.engine.explanation import Explanation

Verdict = Literal["consistent", "miscalibrated", "explained", "partly_explained", "unexplained"]


def verdict_of(explanation: Explanation) -> Verdict:
    """The verdict by what is there, and by what it leaves."""
    if explanation.found:
        return "explained" if explanation.clean else "partly_explained"
    if not explanation.clean:
        return "unexplained"
    return "miscalibrated" if explanation.scatter else "consistent"
