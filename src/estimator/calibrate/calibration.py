"""Result of a calibration: robots with their deviations, payloads, uncertainties and quality of fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import AT, COUNT, GROUPS, ArmUnit, in_encoder_frames
from estimator.arrays import Array, inertia_matrix
from estimator.calibrate.prior import Prior
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import PrincipalInertia, about_com, principal_inertia
from estimator.estimate.uncertainty import numerical_jacobian, standard_errors
from estimator.recording.model import Recording
from estimator.rigid_team import Bases

GRASPS, INERTIAL = "grasps", "inertial_parameters"
"""Kinds of unknowns in ``CalibratedTrial.shares`` besides ``GROUPS``."""
MASSES = np.r_[AT["proximal_mass_ratio"], AT["rod_mass_ratio"], AT["wrist_mass_ratio"]]


@dataclass(frozen=True, eq=False)
class CalibratedPayload:
    """One payload, in the frames that ``Calibration.zero_sd_rad`` describes.

    Attributes:
        label: its name, or None.
        grasps: grasp frames; their covariance is part of ``covariance``.
        parameters: (m [kg], m p_1c [kg m], J about {1} [kg m^2]: xx, xy, xz, yy, yz, zz), shape (10,).
        covariance: of (d_2, e_2, ...) as in ``GraspEstimate`` and the parameters, shape (6 (N - 1) + 10, .), with the
            common spring scale held.
        by_scale: derivative of the same unknowns by that scale, whose standard deviation is ``Calibration.scale_sd``.
    """

    label: str | None
    grasps: GraspEstimate
    parameters: Array
    covariance: Array
    by_scale: Array


@dataclass(frozen=True, eq=False)
class CalibratedTrial:
    """Quality of fit of one recording; pairs are (loops, balance), each chi2 per number compared.

    Attributes:
        kind: "random", "periodic", "static" or "free".
        payload: index into ``Calibration.payloads``, or None.
        duration_s: evaluated length [s].
        count: number of residuals.
        before: with the robots as designed, payload and bases fitted; None for a free trial.
        after: with the calibration.
        held_out: predicted by the calibration from all other recordings, bases fitted; None if those do not suffice.
        bases: base poses of the robots in {b1}; None for a free trial.
        shares: share in the information on each kind of unknown, by name (``findings.shares``); empty if unknown.
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
    """Result of ``calibrate``.

    Attributes:
        units: the robots, ``x`` of shape (N, ``COUNT``).
        covariance: of flattened ``units.x``, with the common spring scale held, shape (N ``COUNT``, N ``COUNT``).
        by_scale: derivative of ``units.x`` by that scale, shape (N, ``COUNT``).
        scale_sd: standard deviation of the common spring scale [-]; 0 if a known weight determined it.
        prior: prior of the robots.
        payloads: calibrated payloads.
        trials: the recordings, in the order given, free ones last.
        known_mass: labels of payloads with known weight.
        steps: number of Gauss-Newton steps.
        findings: caveats on the numbers, one sentence each.
        open: what these recordings do not determine, and what would, one sentence each.
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
        """Common design of all robots."""
        return self.units.design

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return len(self.units.x)

    @property
    def zero_sd_rad(self) -> float:
        """Standard deviation of the theta_x zeros, which turn the payloads' frames; 0 in the drawing's frames."""
        return self.prior.encoder_zero_rad if in_encoder_frames(self.units) else 0.0

    @cached_property
    def prior_sd(self) -> Array:
        """Prior standard deviation of every deviation, 0 if held, shape (N, ``COUNT``)."""
        factor = self.prior.factor(self.robots, hold_scale=not self.known_mass)
        return np.sqrt(np.sum(factor**2, axis=1)).reshape(self.robots, COUNT)

    @cached_property
    def sd(self) -> Array:
        """Standard error of every deviation, including the uncertainty of a held scale, shape (N, ``COUNT``)."""
        variance = np.diag(self.covariance).reshape(self.robots, COUNT)
        return np.sqrt(np.maximum(variance + (self.scale_sd * self.by_scale) ** 2, 0.0))

    @property
    def untouched(self) -> tuple[str, ...]:
        """Names of deviations with little information: their standard error exceeds 0.9 of the prior's."""
        prior, own = self.prior_sd.ravel(), np.sqrt(np.diag(self.covariance))
        names = deviation_names(self.robots)
        return tuple(names[k] for k in np.flatnonzero((prior > 0) & (own > 0.9 * prior)))


def deviation_names(robots: int) -> list[str]:
    """Return a name for every entry of ``ArmUnit.x``, robot by robot: ``omnid1.phi_zero1`` and so on."""
    entries = [f"{group.name}{entry}" for group in GROUPS for entry in group.entries]
    return [f"omnid{robot}.{entry}" for robot in range(1, robots + 1) for entry in entries]


@dataclass(frozen=True, eq=False)
class Carried:
    """Mass of a payload, centre of mass in {1}, inertia about it in the axes of {1}, and principal moments.

    Attributes:
        covariance: of the mass, p_1c and xx, xy, xz, yy, yz, zz of the inertia, including that of a held spring scale,
            shape (10, 10).
        by_scale: derivative of the same quantities by the common spring scale, shape (10,).
    """

    mass_kg: float
    p_1c: Array
    inertia: Array
    covariance: Array
    by_scale: Array
    principal: PrincipalInertia

    @property
    def mass_se_kg(self) -> float:
        """Standard error of the mass [kg]."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def p_1c_se_m(self) -> Array:
        """Standard errors of the centre of mass [m], shape (3,)."""
        return standard_errors(self.covariance[1:4, 1:4])

    @property
    def inertia_se(self) -> Array:
        """Standard errors of the inertia [kg m^2], shape (3, 3)."""
        return inertia_matrix(standard_errors(self.covariance[4:, 4:]))


def grasps_of(payload: CalibratedPayload, scale_sd: float) -> GraspEstimate:
    """Return a payload's grasps with the uncertainty of a held spring scale added to their covariance."""
    by_scale = payload.by_scale[:-10]
    covariance = payload.covariance[:-10, :-10] + scale_sd**2 * np.outer(by_scale, by_scale)
    return replace(payload.grasps, covariance=covariance)


def carried(payload: CalibratedPayload, scale_sd: float) -> Carried:
    """Convert a payload's parameters to its centre of mass; ``scale_sd`` is that of ``Calibration``."""
    at = payload.parameters
    values = about_com(at)
    step = np.maximum(np.abs(at), 1e-3)  # the parameters have different units
    J = numerical_jacobian(lambda x: about_com(at + step * x), np.zeros(10)) / step
    by_scale = J @ payload.by_scale[-10:]
    covariance = J @ payload.covariance[-10:, -10:] @ J.T + scale_sd**2 * np.outer(by_scale, by_scale)
    inertia = inertia_matrix(values[4:])
    principal = principal_inertia(inertia, covariance[4:, 4:])
    return Carried(float(values[0]), values[1:4], inertia, covariance, by_scale, principal)


def calibrated(recording: Recording, calibration: Calibration, called: str = "the calibration") -> Recording:
    """Put the calibration's robots into the metadata of a recording; its samples stay unchanged.

    Robots already in the metadata are replaced. ``called`` is the name of the calibration in messages.

    Raises:
        InputError: the recording has another number of robots or another design.
    """
    metadata = recording.metadata
    units = units_for(calibration, metadata.robots, metadata.design, recording.name, called)
    return replace(recording, metadata=replace(metadata, units=units))


def units_for(
    calibration: Calibration, robots: int, design: OmnidDesign, name: str, called: str = "the calibration"
) -> ArmUnit:
    """Return the calibration's robots, after a check of number and design; messages use ``name`` and ``called``.

    Raises:
        InputError: the log has another number of robots or another design.
    """
    if calibration.robots != robots:
        raise InputError(
            f"{called} is of {_count(calibration.robots)} and {name} of {_count(robots)}; a calibration is for the "
            "robots it was made with, in their order"
        )
    if calibration.design != design:
        raise InputError(
            f"{called} and {name} differ in design; a calibration is for the robots it was made with"
        )
    return calibration.units


def _count(robots: int) -> str:
    return "1 robot" if robots == 1 else f"{robots} robots"
