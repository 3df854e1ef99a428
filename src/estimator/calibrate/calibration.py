"""A calibration: the robots as they are, what they carried, how well each is known, and how well it foretells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import AT, COUNT, GROUPS, ArmUnit
from estimator.arrays import Array
from estimator.calibrate.prior import Prior
from estimator.estimate.frames import in_encoder_frames
from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.rigid_team.residual import Bases


@dataclass(frozen=True, eq=False)
class CalibratedPayload:
    """One payload, in the frames that ``Calibration.zero_sd_rad`` speaks of.

    Attributes:
        label: its name, or None.
        grasps: grasp frames; their covariance is that of ``covariance``.
        parameters: (m [kg], m p_1c [kg m], J about {1} [kg m^2]: xx, xy, xz, yy, yz, zz), shape (10,).
        covariance: of (d_2, e_2, ...) as in ``GraspEstimate`` and the parameters, shape (6 (N - 1) + 10, .), the common
            spring scale held.
        by_scale: derivative of the same by that scale; its standard deviation is ``Calibration.scale_sd``.
    """

    label: str | None
    grasps: GraspEstimate
    parameters: Array
    covariance: Array
    by_scale: Array


@dataclass(frozen=True, eq=False)
class CalibratedTrial:
    """How well one recording fits; pairs are (loops, balance), chi2 over the numbers compared.

    Attributes:
        name: the recording's.
        kind: "random", "periodic", "static" or "free".
        payload: index into ``Calibration.payloads``, or None.
        duration_s: evaluated length [s].
        count: numbers compared.
        before: with the robots as designed, payload and bases fitted; None for a free trial.
        after: with the calibration.
        held_out: by the calibration from all other recordings, bases fitted; None where it cannot be had.
        bases: where the robots stood in {b1}; None for a free trial.
        shares: its share in what is known of each kind of unknown, by name (``outcome.shares``); empty if not known.
    """

    name: str
    kind: str
    payload: int | None
    duration_s: float
    count: tuple[int, int]
    before: tuple[float, float] | None
    after: tuple[float, float]
    held_out: tuple[float, float] | None
    bases: Bases | None
    shares: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Calibration:
    """The result of ``calibrate``.

    Attributes:
        units: the robots, ``x`` of shape (N, ``COUNT``).
        covariance: of ``units.x`` in a row, the common spring scale held, shape (N ``COUNT``, N ``COUNT``).
        by_scale: derivative of ``units.x`` by that scale, shape (N, ``COUNT``).
        scale_sd: standard deviation of the common spring scale [-]; 0 where a known weight decided it.
        prior: what was assumed of robots beforehand.
        payloads: what they carried.
        trials: the recordings, in the order given, free ones last.
        known_mass: labels of payloads whose weight was known.
        steps: Gauss-Newton steps taken.
        findings: what a reader must know before trusting the numbers, one sentence each.
        open: what these recordings do not decide, and what would, one sentence each.
    """

    units: ArmUnit
    covariance: Array
    by_scale: Array
    scale_sd: float
    prior: Prior
    payloads: tuple[CalibratedPayload, ...]
    trials: tuple[CalibratedTrial, ...]
    known_mass: tuple[str, ...]
    steps: int
    findings: tuple[str, ...]
    open: tuple[str, ...]

    @property
    def design(self) -> OmnidDesign:
        """What all robots have in common."""
        return self.units.design

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.units.x)

    @property
    def zero_sd_rad(self) -> float:
        """Standard deviation of the theta_x zeros that the payloads' frames are off by; 0 in the drawing's frames."""
        return self.prior.encoder_zero_rad if in_encoder_frames(self.units) else 0.0

    @cached_property
    def prior_sd(self) -> Array:
        """Prior standard deviation of every deviation, 0 where held, shape (N, ``COUNT``)."""
        factor = self.prior.factor(self.robots, hold_scale=not self.known_mass)
        return np.sqrt(np.sum(factor**2, axis=1)).reshape(self.robots, COUNT)

    @cached_property
    def sd(self) -> Array:
        """Standard error of every deviation, the uncertainty of a held scale included, shape (N, ``COUNT``)."""
        variance = np.diag(self.covariance).reshape(self.robots, COUNT)
        return np.sqrt(np.maximum(variance + (self.scale_sd * self.by_scale) ** 2, 0.0))

    @property
    def untouched(self) -> tuple[str, ...]:
        """Deviations of which the recordings told hardly anything: their error is above 0.9 of the prior's."""
        out = []
        for robot in range(self.robots):
            for group in GROUPS:
                for k, entry in enumerate(group.entries):
                    at = AT[group.name].start + k
                    prior = self.prior_sd[robot, at]
                    if (
                        prior > 0
                        and np.sqrt(self.covariance[robot * COUNT + at, robot * COUNT + at]) > 0.9 * prior
                    ):
                        out.append(f"omnid{robot + 1}.{group.name}{entry}")
        return tuple(out)
