"""A verdict on a robot of joints: what is found, and how well torques are foretold with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from discrepancy.evidence.findings import Finding, Verdict
from discrepancy.joints.model import SerialModel
from discrepancy.joints.servo.motor import Motor
from discrepancy.joints.signals import Signals
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Foretold:
    """How well the torques of one trial are foretold by the others.

    Attributes:
        trial: its name.
        before, after: root mean squares of measured minus foretold torque without and with the findings, as the other
            trials have them, shape (J,) [N m or N].
        noise: of the rows, shape (J,).
        torque: root mean square of the measured torque, shape (J,).
        chi2_before, chi2_after: squares over the noise's variance, per row.
    """

    trial: str
    before: Array
    after: Array
    noise: Array
    torque: Array
    chi2_before: float
    chi2_after: float


@dataclass(frozen=True, eq=False, kw_only=True)
class JointVerdict(Verdict):
    """What logs say of a model of a robot of joints.

    Attributes:
        model: the robot as described.
        parts: the trials: smoothed logs, or parts of one.
        motors: drives that tell no torque, and what they give by what they were given.
        foretold: one a trial, each by the others; by all of them where there is one trial only (``validated``).
        by_the_others: for the number of a trial, the findings with values fitted to the other trials, without events.
    """

    model: SerialModel
    parts: Sequence[Signals]
    motors: tuple[Motor, ...]
    foretold: tuple[Foretold, ...]
    by_the_others: Callable[[int], tuple[Finding, ...]]
