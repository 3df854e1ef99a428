"""The text report of an estimate: every value with its standard error, then doubts."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from estimator.estimate.frames import frames_said
from estimator.estimate.inertia import PARAMETERS
from estimator.estimate.principal import ORDER
from estimator.estimate.result import PayloadEstimate
from estimator.leftover.contradiction import beyond_noise
from estimator.statistics import measured

_ZERO_SIGMAS = 2.0
HOW = {"calibrated": "self-calibrated", "fit": "one-fit"}
"""Methods that are called otherwise."""


def format_estimate(estimate: PayloadEstimate) -> str:
    """Readable report, values as ``value +- standard error (percent)``."""
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
    """Components, without percentages: a component may be zero where the vector is not."""
    each = zip("xyz", values, errors, strict=True)
    return [_line(f"{name} {axis}", value, se, unit, percent=False) for axis, value, se in each]


def _line(name: str, value: float, se: float, unit: str, *, percent: bool = True) -> str:
    # A value that is zero within its error has no share.
    share = f" ({100 * se / abs(value):.2g} %)" if percent and abs(value) > _ZERO_SIGMAS * se else ""
    shown, error = measured(value, se) if 0 < se < np.inf else (f"{value:.6f}", f"{se:.6f}")
    return f"    {name + ':':<14}{shown:>14} +- {error} {unit}{share}"


def _none(name: str) -> str:
    return f"    {name + ':':<14}{'not determined':>14}"


def _row(values: Sequence[float] | np.ndarray) -> str:
    return "(" + ", ".join(f"{v:.4g}" for v in values) + ")"
