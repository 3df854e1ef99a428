"""Dry friction while it slides, and when it does not."""

from collections.abc import Sequence
from typing import ClassVar, Literal

import numpy as np

from discrepancy import rules
from discrepancy.causes.base import Shape
from discrepancy.causes.free_while import free_while
from discrepancy.team.causes.base import Cause, one_joint, one_robot, stack
from discrepancy.team.linear.signals import Signals
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array
from estimator.filtering import differentiate, low_pass


class Friction(Cause):
    """Friction of what a joint's signal tells the motion of: Coulomb and, unless a cause has one parameter, viscous.

    At rest, below the rate that is its shape, it may have any value up to its limit.

    Attributes:
        moves: the signal.
        sign: of the torque's reading while that grows.
        knots_s: between knots of what is open while it holds.
    """

    family = "dissipation"
    parameters = ("coulomb_Nm", "viscous_Nms_per_rad")
    tolerances = (2e-3, 2e-3)
    clipped = ("coulomb_Nm", "viscous_Nms_per_rad")
    shapes = ({"slow_rad_per_s": 1e-3}, {"slow_rad_per_s": 4e-3})
    positive = ("coulomb_Nm",)
    form_share, form_size = rules.FRICTION_FORM_SHARE, rules.FRICTION_FORM_NM
    moves: ClassVar[Literal["phi", "theta", "tau"]] = "phi"
    sign: ClassVar[float] = 1.0
    knots_s: ClassVar[float] = rules.REST_KNOTS_S

    def sentence(self, n):
        return (
            f"the {self.at} rubs with {n('coulomb_Nm', 'N m')} (Coulomb, while it moves) and "
            f"{n('viscous_Nms_per_rad', 'N m s/rad')} (viscous)"
        )

    def trace(self, trial: TrialLinear, robot: int, joint: int, torque: Array) -> Array:
        """What a torque of friction, shape (Q,), adds to the residual, shape (n, C)."""
        return trial.of_signals(robot, tau=one_joint(torque, joint))

    def columns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> Array:
        states = self._sliding(trial.signals, robot, joint, shape)
        return stack([self.trace(trial, robot, joint, state) for state in states])

    def undo(
        self, signals: Signals, trial: TrialLinear, robot: int, joint: int, values: Array, shape: Shape
    ) -> Signals | None:
        torque = np.zeros(len(signals.time))
        for value, state in zip(values, self._sliding(signals, robot, joint, shape), strict=True):
            torque += value * state
        return signals.minus(tau=one_robot(one_joint(torque, joint), trial.robots, robot))

    def unknowns(self, trial: TrialLinear, robot: int, joint: int, shape: Shape) -> list[Array]:
        """What it does while it holds: any torque that it takes, as it changes with the load."""
        rate_hz = trial.signals.rate_hz
        still = np.abs(self._sliding(trial.signals, robot, joint, shape)[0]) < 1.0
        rests = free_while(still, rate_hz, self.knots_s, min(self.knots_s, rules.TEAM_SHORTEST_REST_S))
        return [self.trace(trial, robot, joint, rest) for rest in rests]

    def _sliding(self, signals: Signals, robot: int, joint: int, shape: Shape) -> Sequence[Array]:
        """Direction of motion in [-1, 1], which fades to zero at rest, and rate; as many as there are parameters."""
        (slow,) = shape.values()
        x, rate_hz = getattr(signals, self.moves)[:, robot, joint], signals.rate_hz
        rate = self.sign * differentiate(low_pass(x, rate_hz, rules.TEAM_SMOOTH_HZ), rate_hz)
        return (np.clip(rate / slow, -1.0, 1.0), rate)[: len(self.parameters)]
