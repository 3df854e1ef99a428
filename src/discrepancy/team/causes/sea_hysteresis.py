"""Dry friction inside a spring."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from discrepancy import rules
from discrepancy.causes.base import Shape
from discrepancy.causes.play import played
from discrepancy.team.causes.sliding import Friction
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array
from estimator.filtering import low_pass

GIVES = "presliding_Nm"


class SeaHysteresis(Friction):
    """Friction parallel to the spring: the link gets more than the deflection tells while the torque grows.

    It holds while the torque changes more slowly than ``slow_Nm_per_s``; or it gives way in proportion before it slips,
    as a spring in series with a slider does (Prandtl): in full once the torque has changed by twice ``presliding_Nm``.
    """

    title = "friction inside the spring of {driven joint}"
    parameters = ("friction_Nm",)
    tolerances = (2e-3,)
    clipped = ()
    shapes = ({"slow_Nm_per_s": 0.2}, {"slow_Nm_per_s": 0.6}, *({GIVES: x} for x in rules.PRESLIDINGS_NM))
    determined: ClassVar = {GIVES: 0.1}
    positive = ("friction_Nm",)
    moves = "tau"
    sign = -1.0
    knots_s = rules.SPRING_REST_KNOTS_S
    separate = (
        "Motion with load reversals at rest separates friction in the spring from friction in the joint."
    )

    def sentence(self, n):
        gives = f", and gives way over {n(GIVES, 'N m')} before it slips" if n.values.get(GIVES) else ""
        return f"the spring rubs inside, with {n('friction_Nm', 'N m')}{gives}"

    def finer(self, shape):
        least, most = rules.PRESLIDING_RANGE_NM
        near = (shape[GIVES] * share for share in rules.PRESLIDING_FINER) if GIVES in shape else ()
        return [{GIVES: x} for x in near if least <= x <= most]

    def physical(self, values, context):
        return {"friction_Nm": float(values[0]), GIVES: context.shape.get(GIVES, 0.0)}

    def unknowns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> list[Array]:
        """While it holds, any torque; where it gives way, how far it had before the recording began."""
        if GIVES not in shape:
            return super().unknowns(trial, robot, joint, shape)
        slipped = np.abs(self._sliding(trial.signals, robot, joint, shape)[0]) >= 1.0 - 1e-9
        before = self.trace(trial, robot, joint, (np.cumsum(slipped) == 0).astype(float))
        return [before] if before.any() else []

    def _sliding(self, signals: Signals, robot: int, joint: int, shape: Shape) -> Sequence[Array]:
        if GIVES not in shape:
            return super()._sliding(signals, robot, joint, shape)
        x = low_pass(signals.tau[:, robot, joint], signals.rate_hz, rules.TEAM_SMOOTH_HZ)
        return (self.sign * (x - played(x, shape[GIVES])) / shape[GIVES],)
