"""Odds that can be asked for; without numpy, for the command line looks at them first."""

from discrepancy import rules
from estimator.errors import InputError


def check_odds(odds: float) -> float:
    """Odds of any cause being there before the data are seen.

    Raises:
        InputError: they are none.
    """
    if not 0.0 < odds <= rules.MOST_ODDS:
        raise InputError(f"odds is {odds:g}; it must be greater than 0 and at most {rules.MOST_ODDS:g}")
    return odds
