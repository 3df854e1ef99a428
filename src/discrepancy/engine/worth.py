"""Does a candidate take away enough to be worth naming?"""

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.engine.leaders import Leader
from discrepancy.least_squares.fit import Fit
from discrepancy.rig import Rig


def worth_naming(rig: Rig, fit: Fit, leader: Leader) -> bool:
    """Whether a candidate takes away enough of what is left, if much is left.

    Of a further cause only the channels count that it mostly acts on: what a loose grasp leaves in the poses says
    nothing against a torque's zero.
    """
    first = not fit.free
    if first and leader.candidate.transient is None:
        return True
    excess = max(fit.misfit - rules.CLEAN_CHI2_PER_N * fit.problem.samples, 0.0)
    if not first:
        excess = min(excess, _excess(fit, _channels_of(rig, fit, leader)))
    return fit.misfit - leader.misfit >= rules.NEXT_SHARE * excess


def is_another(fit: Fit, leader: Leader) -> bool:
    """Whether a candidate is told apart from each cause that is named already.

    Friction about one of two parallel axes is divided among both at will: the second makes the first unknown.
    """
    both = Fit.of(leader.problem, [*fit.free, leader.evidence.index])
    alone = Fit.of(leader.problem, fit.free)
    most = rules.LOOK_ALIKE_GROWTH**2
    return all(np.all(np.diag(both.part(i)[1]) < most * np.diag(alone.part(i)[1])) for i in fit.free)


def _channels_of(rig: Rig, fit: Fit, leader: Leader) -> NDArray[np.bool_]:
    """Channels of the kind that a candidate mostly acts on, shape (C,)."""
    index = leader.evidence.index
    values = Fit.of(leader.problem, [*fit.free, index]).part(index)[0]
    span = leader.problem.spans[index]
    traces = [rows[..., span] @ values for rows in leader.problem.rows]
    energy = np.sum([np.sum(x**2, axis=0) for x in traces], axis=0)
    kinds = np.array([channel.kind for channel in rig.channels])
    return np.asarray(kinds == max(sorted(set(kinds)), key=lambda kind: float(np.sum(energy[kinds == kind]))))


def _excess(fit: Fit, channels: NDArray[np.bool_]) -> float:
    """What a fit leaves in some channels above clean data."""
    left = [fit.remaining(t)[:, channels] for t in range(len(fit.problem.rows))]
    return max(sum(float(np.sum(x**2)) - rules.CLEAN_CHI2_PER_N * x.size for x in left), 0.0)
