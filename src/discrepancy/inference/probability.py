"""The probability that a cause is there, at its place, rather than a rival, nothing, or something unlisted."""

from collections.abc import Sequence

import numpy as np
from scipy.special import erf

from discrepancy import rules
from discrepancy.law_doubt import LawDoubt
from estimator.arrays import Array


def probability(gaps: Sequence[float], share_left: float, doubt: LawDoubt, worth: float = np.inf) -> float:
    """Posterior probability of one cause of a hypothesis.

    Args:
        gaps: by how much it is likelier than each of its rivals [nats].
        share_left: see ``remainder.share_left``.
        doubt: about its law.
        worth: by how much it is likelier than nothing in its place [nats].
    """
    apart = np.append(parted(gaps, doubt, worth), worth)
    among_listed = 1.0 / (1.0 + float(np.sum(np.exp(-np.clip(apart, -50.0, 700.0)))))
    odds = _listed_odds(share_left, doubt, worth)
    return among_listed * odds / (1.0 + odds)


def parted(gaps: Sequence[float], doubt: LawDoubt, worth: float) -> Array:
    """Gaps to rivals [nats] if the laws of both are off by a share of their trace, at worst along what parts them.

    Beside noise of variance 1, a trace whose squares sum up to 2 worth then has one of 2 worth share^2 there; log odds
    of two normal distributions that are so far apart go with the inverse of their variance.
    """
    more = 2.0 * max(worth, 0.0) * doubt.towards_rivals**2 if doubt.towards_rivals else 0.0
    return np.asarray(gaps, dtype=float) / (1.0 + more)


def told_nats(gaps: Sequence[float], share_left: float, doubt: LawDoubt, worth: float) -> float:
    """Gap to rivals from which they can be told from a cause [nats]; arguments as of ``probability``.

    Of a cause that is less likely than not because its rivals' laws may be as far off as they are apart, so many of the
    nearest cannot be told from it as make one of them likelier than not.
    """
    told = rules.AMBIGUOUS_NATS
    for gap in sorted(gap for gap in gaps if gap >= told):
        far = [other for other in gaps if other >= told]
        if probability(far, share_left, doubt, worth) >= rules.LEAST_PROBABILITY:
            break
        if parted([gap], doubt, worth)[0] >= rules.AMBIGUOUS_NATS:
            break
        told = float(np.nextafter(gap, np.inf))
    return told


def _listed_odds(share_left: float, doubt: LawDoubt, worth: float) -> float:
    """Odds that a cause is what it is called rather than something unlisted that looks like it.

    A listed cause leaves a share that is normal with that of its doubt; something unlisted leaves the larger ones the
    likelier, with a density of 2 rho. A share rho leaves rho^2 of what the cause is worth, and a little of that is not
    seen: the odds are those of all shares that may look like the one that is.
    """
    unseen = (
        float(np.sqrt(min(1.0, doubt.unseen_nats / max(worth, doubt.unseen_nats))))
        if doubt.unseen_nats
        else 0.0
    )
    low, high = max(share_left - unseen, 0.0), min(share_left + unseen, 1.0)
    if high - low < 1e-6:
        listed = np.sqrt(2.0 / np.pi) / doubt.share * np.exp(-0.5 * (share_left / doubt.share) ** 2)
        return rules.LISTED_ODDS * float(listed) / max(2.0 * share_left, 1e-6)
    listed = float(erf(high / doubt.share / np.sqrt(2.0)) - erf(low / doubt.share / np.sqrt(2.0)))
    return rules.LISTED_ODDS * listed / (high**2 - low**2)
