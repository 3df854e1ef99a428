"""Is it what it seems, or something simpler, such as one sensor that was wrong for as long?"""

from discrepancy.inference.hypothesis import Hypothesis
from discrepancy.inference.scan import log_bayes_factor
from discrepancy.least_squares.fit import Fit
from discrepancy.rig import Rig


def imitated(rig: Rig, base: Hypothesis, new: Hypothesis) -> bool:
    """Whether one of a rig's imitators is likelier than what was added last.

    A lasting cause that shows at rare loads only, such as the hardening of one spring, looks like a push at that
    time; but then its torque alone accounts for it, and a push has six numbers for the same. Friction where an axis
    turns round looks like pulses of force that come about as often; but then pulses in step with the motion tell more.

    What neither explains counts as noise. Without both a strong push is noise, too, in which its smaller part, a torque
    at its peak, may tell more than all of it. So they are compared in the noise that is left with what was added.

    Args:
        rig: for imitators.
        base: what is there without it.
        new: the same and what was added.
    """
    candidate, learnt = new.causes[-1], new.problem
    fit = Fit.of(base.problem.with_noise(learnt.power, base.problem.spread), base.free)
    own = log_bayes_factor(*fit.told_by([c * candidate.units for c in rig.columns(candidate)]), 0.0)
    others = (log_bayes_factor(*fit.told_by(columns), 0.0) for columns in rig.imitators(candidate))
    return any(other > own for other in others)
