"""The probability that a cause is there, at its place, rather than a rival, nothing, or something unlisted."""

from collections.abc import Sequence

import numpy as np

from discrepancy import rules


def probability(gaps: Sequence[float], share_left: float, law_share: float) -> float:
    """Posterior probability of one cause of a hypothesis.

    Args:
        gaps: by how much it is likelier than each of its rivals and than nothing [nats].
        share_left: see ``remainder.share_left``.
        law_share: of the cause, see ``Rig.law_share``.

    The law of a listed cause is right to a share that is normal with ``law_share``; something unlisted that looks like
    it leaves the larger shares the likelier, with a density of 2 rho. The odds between the two are those of these.
    """
    among_listed = 1.0 / (1.0 + float(np.sum(np.exp(-np.asarray(gaps, dtype=float).clip(-50.0, 700.0)))))
    listed = np.sqrt(2.0 / np.pi) / law_share * np.exp(-0.5 * (share_left / law_share) ** 2)
    odds = rules.LISTED_ODDS * float(listed) / max(2.0 * share_left, 1e-6)
    return among_listed * odds / (1.0 + odds)
