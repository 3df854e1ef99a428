"""The probability that a cause is there, at its place, rather than a rival, nothing, or something unlisted."""

from collections.abc import Sequence

import numpy as np

from discrepancy import rules


def probability(gaps: Sequence[float], share_left: float) -> float:
    """Posterior probability of one cause of a hypothesis.

    Args:
        gaps: by how much it is likelier than each of its rivals and than nothing [nats].
        share_left: see ``remainder.share_left``.

    The law of a listed cause is right to a share that is normal with ``LAW_SHARE``; something unlisted that looks like
    it may leave any share. The odds between the two are those of their densities.
    """
    among_listed = 1.0 / (1.0 + float(np.sum(np.exp(-np.asarray(gaps, dtype=float).clip(-50.0, 700.0)))))
    width = rules.LAW_SHARE
    listed = np.sqrt(2.0 / np.pi) / width * np.exp(-0.5 * (share_left / width) ** 2)
    odds = rules.LISTED_ODDS * float(listed)
    return among_listed * odds / (1.0 + odds)
