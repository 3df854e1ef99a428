"""Result of ``estimate_payload``: the estimate of a payload, its JSON and its text report.

``PayloadEstimate.to_dict`` makes strict JSON: plain types, no NaN, units in the keys; null is undetermined.

format, version            "mocobot-estimate", 1
payload, robots, method    label or null; N; "fit" (one fit of loops and balance), "staged", "joint" or "calibrated"
                           (from the robots' calibration)
grasps                     null, or
    pairs                  list over i < j of {i, j, R_axis_angle_deg [3], R_se_deg [3], p_m [3], p_se_m [3],
                           distance_m, distance_se_m, angular_residual_radps, linear_residual_mps}
    covariance             of the frames {2}..{N}, 6(N-1) square, order and units of GraspEstimate
    angular_residual_radps, linear_residual_mps   N x N rms residuals of all pairs
    angular_motion_radps, linear_motion_mps       N rms motions
mass                       null or {m_kg, m_se_kg, residual_N}
com                        null or {p_1c_m [3], p_1c_se_m [3], distance_m, distance_se_m, covariance_m2}
inertia                    null, or
    I_b_kgm2               3 x 3 about the CoM, axes of {1}
    I_b_se_kgm2            3 x 3 standard errors
    covariance_kg2m4       6 x 6 in the order xx, xy, xz, yy, yz, zz
    principal_kgm2, principal_se_kgm2             3, ascending
    R_1c_axis_angle_deg, R_1c_se_deg              3 or null if two moments are too similar
    R_1c_covariance_rad2   3 x 3 or null
    projected              true if a negative eigenvalue was set to zero
    residual_Nm, moment_Nm rms of the moment residual and of the explained moment
steps                      list of {step, parameters, unit, singular_values, noise, rank, condition,
                           weak: [{direction, vector, reason}]}; condition null if infinite
undetermined               list of {step, direction, vector, reason}: all weak directions again
recordings                 list of {name, trial, duration_s, holds, grasps, inertia, force_residual,
                           moment_residual_m, leftovers: list of {name, unit, left, noise}: rms residual of the best
                           rigid payload ("flange_position", "flange_rotation", "force", "moment"), and rms noise}
contradicts                true if some leftovers exceed noise, so that standard errors are too small; null if unknown
flags                      list of sentences
open                       only if there are any: sentences on what the robots' calibration does not determine
frames                     only if the encoders define the frames {i}, which the zeros of theta_x turn about x relative
                           to the drawing: {defined_by: "encoders", theta_x_zero_sd_deg}; standard errors exclude this
why_not_fit                only if one fit was requested and impossible: a sentence on the reason
calibrated                 only if robots were not taken as designed: {design, units}, as in a recording's metadata

``mocobot estimate`` adds ``provenance``: versions, options and hashes of the recordings (``mocobot.results``).
Readers ignore it and any other key.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, TypeVar

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import ArmUnit, frames_said, units_from_list, units_to_list
from estimator.arrays import ORDER, Array
from estimator.errors import InputError
from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.inertia import PARAMETERS, InertiaEstimate
from estimator.estimate.leftover import Leftover, beyond_noise
from estimator.estimate.statics import MassEstimate
from estimator.estimate.uncertainty import StepReport, WeakDirection, norm_se, standard_errors
from estimator.statistics import measured

Given = TypeVar("Given")

FORMAT, VERSION = "mocobot-estimate", 1


@dataclass(frozen=True)
class RecordingEstimate:
    """Estimates from one recording, given the pooled grasps and (staged) the pooled centre of mass.

    Attributes:
        trial: ``"random"``, ``"periodic"`` or ``"static"``.
        duration_s: evaluated length [s].
        holds: number of static holds.
        grasps, inertia: from this recording alone, or None if it does not determine them.
        force_residual: rms of f - m (a_c + g up) over m g, or None without a mass and a centre of mass.
        moment_residual_m: rms residual moment about the centre of mass over m g [m]: the error of the centre of mass
            that would explain it; None if unknown.
        leftovers: residuals of the best rigid payload, with noise; empty without grasps.
    """

    name: str
    trial: str
    duration_s: float
    holds: int
    grasps: GraspEstimate | None = None
    inertia: InertiaEstimate | None = None
    force_residual: float | None = None
    moment_residual_m: float | None = None
    leftovers: tuple[Leftover, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain types, with the field names as keys."""
        return {
            **vars(self),
            "grasps": self.grasps and self.grasps.to_dict(),
            "inertia": self.inertia and self.inertia.to_dict(),
            "leftovers": [one.to_dict() for one in self.leftovers],
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any], robots: int) -> RecordingEstimate:
        """Inverse of ``to_dict`` for N robots."""
        parts = {
            "grasps": _if_given(values["grasps"], lambda grasps: GraspEstimate.from_dict(grasps, robots)),
            "inertia": _if_given(values["inertia"], InertiaEstimate.from_dict),
            # Files of earlier versions lack this key.
            "leftovers": tuple(Leftover(**one) for one in values.get("leftovers", ())),
        }
        return cls(**(values | parts))


@dataclass(frozen=True)
class PayloadEstimate:
    """Grasps, mass, centre of mass and inertia of one payload; None marks undetermined values.

    Attributes:
        method: ``"fit"`` (one fit of loops and balance), ``"staged"`` (the paper's), ``"joint"``, or ``"calibrated"``
            (from the robots' calibration).
        grasps: grasp frames pooled over the recordings.
        p_1c, p_1c_covariance: centre of mass in {1} [m], shape (3,), and its covariance [m^2], shape (3, 3).
        inertia: in {b}, with its principal axes, pooled over the recordings with motion.
        steps: excitation of every step.
        flags: caveats on the numbers, one sentence each.
        units: the robots with their deviations, or None for robots as designed.
        open: what the robots' calibration does not determine, one sentence each; standard errors include only the
            springs' common scale.
        why_not_fit: reason why one fit was impossible, if it was requested; else empty.
        zero_sd_rad: standard deviation of the theta_x zeros [rad], if all numbers are in the encoders' frames. These
            zeros turn the encoders' frames {i} about x relative to the drawing's. 0 in the drawing's frames.
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
    units: ArmUnit | None = None
    open: tuple[str, ...] = ()
    why_not_fit: str = ""
    zero_sd_rad: float = 0.0

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
    def contradicts(self) -> bool | None:
        """Whether the robots contradict each other beyond noise, so standard errors are too small; None if unknown."""
        found = [one for recording in self.recordings for one in recording.leftovers]
        return bool(beyond_noise(found)) if found else None

    @property
    def undetermined(self) -> tuple[WeakDirection, ...]:
        """All directions of all steps that the data do not determine."""
        return tuple(weak for step in self.steps for weak in step.weak)

    def to_dict(self) -> dict[str, Any]:
        """Convert the estimate to the format documented in this module."""
        com, mass = None, self.mass
        if self.p_1c is not None and self.p_1c_covariance is not None:
            com = {
                "p_1c_m": self.p_1c.tolist(),
                "p_1c_se_m": standard_errors(self.p_1c_covariance).tolist(),
                "distance_m": float(np.linalg.norm(self.p_1c)),
                "distance_se_m": self.p_1c_distance_se_m,
                "covariance_m2": self.p_1c_covariance.tolist(),
            }
        more: dict[str, Any] = {}
        if (units := self.units) is not None:
            more["calibrated"] = {"design": units.design.to_dict(), "units": units_to_list(units)}
        if self.open:
            more["open"] = list(self.open)
        if self.zero_sd_rad:
            degrees = float(np.rad2deg(self.zero_sd_rad))
            more["frames"] = {"defined_by": "encoders", "theta_x_zero_sd_deg": degrees}
        if self.why_not_fit:
            more["why_not_fit"] = self.why_not_fit
        return {
            "format": FORMAT,
            "version": VERSION,
            "payload": self.payload,
            "robots": self.robots,
            "method": self.method,
            "grasps": self.grasps and self.grasps.to_dict(),
            "mass": mass and {"m_kg": mass.mass, "m_se_kg": mass.se, "residual_N": mass.residual_rms},
            "com": com,
            "inertia": self.inertia and self.inertia.to_dict(),
            "steps": [step.to_dict() for step in self.steps],
            "undetermined": [{"step": weak.step, **weak.to_dict()} for weak in self.undetermined],
            "recordings": [recording.to_dict() for recording in self.recordings],
            "contradicts": self.contradicts,
            "flags": list(self.flags),
        } | more

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> PayloadEstimate:
        """Inverse of ``to_dict``.

        Raises:
            InputError: the mapping is not an estimate, or has another version.
        """
        if not isinstance(values, dict) or values.get("format") != FORMAT or values.get("version") != VERSION:
            raise InputError(f"not an estimate: it must have format {FORMAT!r} and version {VERSION}")
        try:
            robots, mass, com = values["robots"], values["mass"], values["com"]
            return cls(
                payload=values["payload"],
                robots=robots,
                method=values["method"],
                grasps=_if_given(values["grasps"], lambda grasps: GraspEstimate.from_dict(grasps, robots)),
                mass=_if_given(mass, lambda m: MassEstimate(m["m_kg"], m["m_se_kg"], m["residual_N"])),
                p_1c=_if_given(com, lambda com: np.array(com["p_1c_m"])),
                p_1c_covariance=_if_given(com, lambda com: np.array(com["covariance_m2"])),
                inertia=_if_given(values["inertia"], InertiaEstimate.from_dict),
                steps=tuple(StepReport.from_dict(step) for step in values["steps"]),
                recordings=tuple(RecordingEstimate.from_dict(r, robots) for r in values["recordings"]),
                flags=tuple(values["flags"]),
                units=_if_given(values.get("calibrated"), _units),
                open=tuple(values.get("open", ())),
                why_not_fit=str(values.get("why_not_fit", "")),
                zero_sd_rad=_if_given(values.get("frames"), lambda f: np.deg2rad(f["theta_x_zero_sd_deg"]))
                or 0.0,
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"not a complete estimate ({type(error).__name__}: {error})") from error


def _units(values: dict[str, Any]) -> ArmUnit:
    design = OmnidDesign.from_dict(values["design"], "calibrated: design")
    return units_from_list(values["units"], design, "calibrated: units")


def _if_given(value: Any, make: Callable[[Any], Given]) -> Given | None:
    return None if value is None else make(value)


_ZERO_SIGMAS = 2.0
HOW = {"calibrated": "self-calibrated", "fit": "one-fit"}
"""Display names of methods."""


def format_estimate(estimate: PayloadEstimate) -> str:
    """Format a readable report, with values as ``value +- standard error (percent)``."""
    label = "" if estimate.payload is None else f" ({estimate.payload})"
    lines = [
        f"[[Payload{label}]]  {estimate.robots} {'calibrated ' * (estimate.units is not None)}"
        f"robot{'s' * (estimate.robots > 1)}, "
        f"{HOW.get(estimate.method, estimate.method)} estimate, "
        f"{len(estimate.recordings)} recording{'s' * (len(estimate.recordings) > 1)}"
    ]
    lines += [f"    {estimate.why_not_fit}"] if estimate.why_not_fit else []
    lines += [f"    {frames_said(estimate.zero_sd_rad)}"] if estimate.zero_sd_rad else []
    lines += _grasps(estimate)
    lines += ["[[Mass and centre of mass in {1}]]"]
    mass = estimate.mass
    lines.append(_line("m", mass.mass, mass.se, "kg") if mass else _none("m"))
    if estimate.p_1c is not None and estimate.p_1c_se_m is not None:
        lines += _vector("p_1c", estimate.p_1c, estimate.p_1c_se_m, "m")
        lines.append(
            _line("|p_1c|", float(np.linalg.norm(estimate.p_1c)), estimate.p_1c_distance_se_m or 0.0, "m")
        )
    else:
        lines.append(_none("p_1c"))
    lines += _inertia(estimate)
    lines += ["[[Recordings]]"]
    for r in estimate.recordings:
        text = f"    {r.name}: {r.trial}, {r.duration_s:.1f} s, {r.holds} holds"
        if r.inertia is not None:
            text += ", principal moments " + _row(r.inertia.principal.moments) + " kg m^2"
        if r.force_residual is not None:
            text += f", force left over {100 * r.force_residual:.2g} % of the weight"
        if wrong := beyond_noise(r.leftovers):
            apart = "robots apart" if estimate.robots > 1 else "forces and moments off by"
            text += f", {apart} {max(one.ratio for one in wrong):.2g} times the noise"
        lines.append(text)
    lines += ["[[Excitation]]"]
    for step in estimate.steps:
        lines.append(
            f"    {step.step}: rank {step.rank} of {len(step.singular_values)}, "
            f"condition {step.condition:.3g}, weakest signal {step.singular_values[-1]:.2g} {step.unit}, "
            f"noise {step.noise:.2g}"
        )
    if estimate.undetermined:
        lines += ["[[Not determined]]"] + [f"    {weak}" for weak in estimate.undetermined]
    if estimate.flags:
        lines += ["[[Flags]]"] + [f"    {flag}" for flag in estimate.flags]
    if estimate.open:
        lines += ["[[Left open by the calibration]]"] + [f"    {sentence}" for sentence in estimate.open]
    return "\n".join(lines)


def _grasps(estimate: PayloadEstimate) -> list[str]:
    lines = ["[[Grasps]]"]
    if estimate.robots == 1:
        return [*lines, "    one robot: {s} = {1}"]
    for i, j in combinations(range(1, estimate.robots + 1), 2):
        if estimate.grasps is None:
            lines.append(_none(f"T_{i}{j}"))
            continue
        pair = estimate.grasps.pair(i, j)
        angles, angles_se = np.rad2deg(pair.axis_angle_rad), np.rad2deg(pair.axis_angle_se_rad)
        lines += _vector(f"R_{i}{j}", angles, angles_se, "deg")
        lines += _vector(f"p_{i}{j}", pair.p_ij, pair.p_se_m, "m")
        lines.append(_line(f"|p_{i}{j}|", float(np.linalg.norm(pair.p_ij)), pair.distance_se_m, "m"))
    return lines


def _inertia(estimate: PayloadEstimate) -> list[str]:
    lines, inertia = ["[[Inertia about the centre of mass]]"], estimate.inertia
    if inertia is None:
        return [*lines, _none("I")]
    se = np.sqrt(np.diag(inertia.covariance))
    for k, (name, (a, b)) in enumerate(zip(PARAMETERS, ORDER, strict=True)):
        lines.append(_line(f"{name} in {{b}}", inertia.inertia[a, b], se[k], "kg m^2", percent=a == b))
    principal = inertia.principal
    for k, (value, error) in enumerate(zip(principal.moments, principal.moments_se, strict=True)):
        lines.append(_line(f"principal {k + 1}", value, error, "kg m^2"))
    if principal.axis_angle_rad is None or principal.axis_angle_se_rad is None:
        return [*lines, _none("R_1c")]
    angles, errors = np.rad2deg(principal.axis_angle_rad), np.rad2deg(principal.axis_angle_se_rad)
    return [*lines, *_vector("R_1c", angles, errors, "deg")]


def _vector(name: str, values: np.ndarray, errors: np.ndarray, unit: str) -> list[str]:
    """Format components without percentages: a component may be zero although the vector is not."""
    each = zip("xyz", values, errors, strict=True)
    return [_line(f"{name} {axis}", value, se, unit, percent=False) for axis, value, se in each]


def _line(name: str, value: float, se: float, unit: str, *, percent: bool = True) -> str:
    # No percentage for values that are zero within their error.
    share = f" ({100 * se / abs(value):.2g} %)" if percent and abs(value) > _ZERO_SIGMAS * se else ""
    shown, error = measured(value, se) if 0 < se < np.inf else (f"{value:.6f}", f"{se:.6f}")
    return f"    {name + ':':<14}{shown:>14} +- {error} {unit}{share}"


def _none(name: str) -> str:
    return f"    {name + ':':<14}{'not determined':>14}"


def _row(values: Sequence[float] | np.ndarray) -> str:
    return "(" + ", ".join(f"{v:.4g}" for v in values) + ")"
