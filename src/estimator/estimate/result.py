"""The estimate of a payload: what ``estimate_payload`` returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.estimate.grasp_estimate import GraspEstimate
from estimator.estimate.identifiability import StepReport, WeakDirection
from estimator.estimate.inertia import InertiaEstimate
from estimator.estimate.statics import MassEstimate
from estimator.estimate.uncertainty import norm_se, standard_errors

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RecordingEstimate:
    """What one recording alone says, given the pooled grasps and (staged) the pooled centre of mass.

    Attributes:
        name: the recording's name.
        trial: ``"random"``, ``"periodic"`` or ``"static"``.
        duration_s: evaluated length [s].
        holds: number of static holds found.
        grasps: grasp frames from this recording alone, or None where it does not determine them.
        inertia: inertia from this recording alone, or None.
        force_residual: rms of f - m (a_c + g up) over m g, or None without a mass and a centre of mass.
        moment_residual_m: rms moment about the centre of mass that the inertia leaves, over m g [m]: the
            error of the centre of mass that would explain it; None where it cannot be told.
    """

    name: str
    trial: str
    duration_s: float
    holds: int
    grasps: GraspEstimate | None = None
    inertia: InertiaEstimate | None = None
    force_residual: float | None = None
    moment_residual_m: float | None = None


@dataclass(frozen=True)
class PayloadEstimate:
    """Grasps, mass, centre of mass and inertia of one payload; None marks what the data do not determine.

    Attributes:
        payload: the recordings' payload label, or None.
        robots: number of robots N.
        method: ``"staged"`` (the paper's) or ``"joint"``.
        grasps: grasp frames pooled over the recordings.
        mass: mass with its standard error.
        p_1c: centre of mass in {1} [m], shape (3,).
        p_1c_covariance: its covariance [m^2], shape (3, 3).
        inertia: inertia in {b} and its principal axes, pooled over the recordings with motion.
        steps: excitation of every step.
        recordings: per-recording results, in the order given.
        flags: what a reader should know before trusting the numbers, one sentence each.
    """

    payload: str | None
    robots: int
    method: str
    grasps: GraspEstimate | None
    mass: MassEstimate | None
    p_1c: Array | None
    p_1c_covariance: Array | None
    inertia: InertiaEstimate | None
    steps: tuple[StepReport, ...]
    recordings: tuple[RecordingEstimate, ...]
    flags: tuple[str, ...]

    @property
    def p_1c_se_m(self) -> Array | None:
        """Standard errors of the centre of mass [m], shape (3,), or None."""
        return None if self.p_1c_covariance is None else standard_errors(self.p_1c_covariance)

    @property
    def p_1c_distance_se_m(self) -> float | None:
        """Standard error of |p_1c| [m], or None."""
        if self.p_1c is None or self.p_1c_covariance is None:
            return None
        return norm_se(self.p_1c, self.p_1c_covariance)

    @property
    def undetermined(self) -> tuple[WeakDirection, ...]:
        """Every direction of every step that the data do not determine."""
        return tuple(weak for step in self.steps for weak in step.weak)

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys; see ``estimator.estimate.json`` for the keys."""
        from estimator.estimate.json import to_dict

        return to_dict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> PayloadEstimate:
        """Inverse of ``to_dict``.

        Raises:
            InputError: the mapping is not such an estimate.
        """
        from estimator.estimate.json import from_dict

        return from_dict(values)
