"""Is it what it seems, or something simpler, such as one sensor that was wrong for as long?"""

from discrepancy.candidate import Candidate
from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.scan import log_bayes_factor
from discrepancy.rig import Rig


def imitated(rig: Rig, base: Hypothesis, candidate: Candidate) -> bool:
    """Whether one of a rig's imitators is likelier than the candidate.

    A lasting cause that shows at rare loads only, such as the hardening of one spring, looks like a push at that
    time; but then its torque alone accounts for it, and a push has six numbers for the same. Friction where an axis
    turns round looks like pulses of force that come about as often; but then pulses in step with the motion tell more.
    """
    fit = base.fit
    own = log_bayes_factor(*fit.told_by([c * candidate.units for c in rig.columns(candidate)]), 0.0)
    others = (log_bayes_factor(*fit.told_by(columns), 0.0) for columns in rig.imitators(candidate))
    return any(other > own for other in others)
