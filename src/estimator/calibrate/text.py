"""Text report of a calibration, and one robot's parameters as TOML for other programs."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from estimator.arm.unit import AT, GROUPS, Group, frames_said, in_encoder_frames
from estimator.arrays import Array
from estimator.calibrate.calibration import (
    CalibratedPayload,
    CalibratedTrial,
    Calibration,
    carried,
    grasps_of,
)
from estimator.estimate.uncertainty import standard_errors
from estimator.statistics import measured


class Shown(NamedTuple):
    """Display of a kind of deviation: name, factor and unit."""

    name: str
    scale: float
    unit: str


DEG = 180.0 / np.pi
SHOWN = {
    "phi_zero": Shown("encoder zero phi", DEG, "deg"),
    "theta_zero": Shown("encoder zero theta", DEG, "deg"),
    "radius": Shown("base minus platform radius", 1e3, "mm"),
    "proximal_length": Shown("proximal length", 1e3, "mm"),
    "rod_length": Shown("rod length", 1e3, "mm"),
    "stiffness_ratio": Shown("spring stiffness", 100.0, "%"),
    "tau_zero": Shown("torque zero", 1e3, "mN m"),
    "tilt": Shown("base tilt", DEG, "deg"),
    "proximal_mass_ratio": Shown("proximal mass", 100.0, "%"),
    "rod_mass_ratio": Shown("rod mass", 100.0, "%"),
    "wrist_mass_ratio": Shown("wrist mass", 100.0, "%"),
}
"""Display by group; deviations are as built minus design, zeros are reading minus truth."""


WIDTH = 118
"""Column at which sentences wrap."""
MASSES = ("proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio")


def frames_sentence(calibration: Calibration) -> str:
    """State the frames of the results."""
    if not in_encoder_frames(calibration.units):
        return "frames {i} as in the drawing, from flanges that are parallel"
    return frames_said(calibration.zero_sd_rad)


def format_calibration(calibration: Calibration) -> str:
    """Format a readable report, with values as ``value +- standard error``."""
    count = len(calibration.trials)
    seconds = sum(trial.duration_s for trial in calibration.trials)
    lines = [
        f"[[Calibration]]  {calibration.robots} robots, {count} recording{'s' * (count != 1)}, {seconds:.0f} s, "
        f"{calibration.steps} steps",
        f"    {frames_sentence(calibration)}",
    ]
    for robot in range(calibration.robots):
        lines += [
            f"[[Robot {robot + 1}]]",
            *(_group(calibration, robot, g) for g in shown_groups(calibration)),
        ]
    if alike(calibration):
        at = AT["wrist_mass_ratio"].start
        mass = _value(100.0 * calibration.units.x[0, at], 100.0 * calibration.sd[0, at])
        lines += ["[[All arms together]]", f"    {'mass [%]':<33}{mass}"]
    for payload in calibration.payloads:
        lines += _payload(payload, calibration.scale_sd)
    lines += ["[[Recordings]]  chi2/n of loops and balance; 1 is noise alone"]
    lines += _trials(calibration.trials)
    if calibration.untouched:
        lines += ["[[Hardly touched by these recordings]]", f"    {', '.join(calibration.untouched)}"]
    if calibration.findings:
        lines += ["[[Findings]]", *map(_wrapped, calibration.findings)]
    lines += ["[[What stays open]]", *map(_wrapped, calibration.open or ("Nothing.",))]
    return "\n".join(lines)


def _wrapped(sentences: str) -> str:
    return textwrap.fill(sentences, WIDTH, initial_indent="    ", subsequent_indent="        ")


def shown_groups(calibration: Calibration) -> list[Group]:
    """Return the groups with at least one free deviation; arm masses only if they have no common ratio."""
    hidden = MASSES if alike(calibration) else ()
    return [g for g in GROUPS if calibration.sd[:, AT[g.name]].any() and g.name not in hidden]


def alike(calibration: Calibration) -> bool:
    """Return whether one common ratio scales all arm masses, because the prior allows no other."""
    return calibration.prior.arm_mass_ratio == 0 and bool(calibration.sd[:, AT[MASSES[0]]].any())


def _group(calibration: Calibration, robot: int, group: Group) -> str:
    shown, at = SHOWN[group.name], AT[group.name]
    cells = []
    values, errors = calibration.units.x[robot, at], calibration.sd[robot, at]
    for entry, value, se in zip(group.entries, values, errors, strict=True):
        cell = f"{_value(shown.scale * value, shown.scale * se)}" if se > 0 else "held"
        cells.append(f"{entry + ': ' if entry else ''}{cell}")
    return f"    {f'{shown.name} [{shown.unit}]':<33}" + "   ".join(f"{cell:<22}" for cell in cells).rstrip()


def _value(value: float, se: float) -> str:
    shown, error = measured(value, se)
    return f"{shown} +- {error}"


def _payload(payload: CalibratedPayload, scale_sd: float) -> list[str]:
    label = "" if payload.label is None else f" ({payload.label})"
    lines, found = [f"[[Payload{label}]]"], carried(payload, scale_sd)
    lines.append(f"    {'mass [kg]':<33}{_value(found.mass_kg, found.mass_se_kg)}")
    lines.append(_vector("centre of mass in {1} [mm]", 1e3 * found.p_1c, 1e3 * found.p_1c_se_m))
    moments = found.principal
    lines.append(_vector("principal moments [kg m^2]", moments.moments, moments.moments_se, "123"))
    grasps = grasps_of(payload, scale_sd)
    for j in range(2, grasps.robots + 1):
        pair = grasps.pair(1, j)
        lines.append(_vector(f"R_1{j} [deg]", DEG * pair.axis_angle_rad, DEG * pair.axis_angle_se_rad))
        lines.append(_vector(f"p_1{j} [mm]", 1e3 * pair.p_ij, 1e3 * pair.p_se_m))
    if scale_sd > 0:
        mass_sd = float(standard_errors(payload.covariance)[-10])
        lines.append(
            f"    of the mass's error {scale_sd * abs(float(payload.by_scale[-10])):.2g} kg is that of the springs' "
            f"common scale, which is held; {mass_sd:.2g} kg is noise"
        )
    return lines


def _vector(name: str, values: Array, errors: Array, axes: str = "xyz") -> str:
    cells = (f"{axis}: {_value(v, se)}" for axis, v, se in zip(axes, values, errors, strict=True))
    return f"    {name:<33}" + "   ".join(f"{cell:<22}" for cell in cells).rstrip()


def _trials(trials: Sequence[CalibratedTrial]) -> list[str]:
    names = [Path(trial.name).name for trial in trials]
    width = max([len(name) for name in names], default=0)
    rows = [
        f"    {'':<{width}}  {'':<8}  {'length':>7}  {'as designed':>17}  {'calibrated':>15}  {'left out':>15}"
    ]
    for name, trial in zip(names, trials, strict=True):
        cells = (
            f"{_fit(pair, trial.count):>{size}}"
            for pair, size in zip((trial.before, trial.after, trial.held_out), (17, 15, 15), strict=True)
        )
        rows.append(f"    {name:<{width}}  {trial.kind:<8}  {trial.duration_s:>5.1f} s  {'  '.join(cells)}")
    return rows


def _fit(pair: tuple[float, float] | None, count: tuple[int, int]) -> str:
    if pair is None:
        return "-"
    return " / ".join(
        f"{value:.{2 * (value < 100)}f}" if n else "-" for value, n in zip(pair, count, strict=True)
    )


_HEAD = """\
# Robot {robot} of {robots} as calibrated; SI units in the keys. Lists have one number a leg (1, 2, 3); theta_zero_rad
# is in the order z, y, x; tilt_rad is the rotation vector of the base about x and y. Zeros are reading minus truth, and
# a true torque is (reading - tau_zero_Nm) (1 + stiffness_ratio) where readings take all springs as designed
# ({stiffness:g} N m/rad). radius_m is base radius minus platform radius: kinematics sees no more of the two.
# {frames}
"""


def unit_toml(calibration: Calibration, robot: int) -> str:
    """Format a robot's parameters as TOML.

    Args:
        calibration: calibration that contains the robot.
        robot: number of the robot, from 1.
    """
    unit = calibration.units
    k = robot - 1
    design = calibration.design
    ratio = unit.of("stiffness_ratio")[k]
    values: dict[str, float | Sequence[float]] = {
        "radius_m": unit.radius_m[k],
        "proximal_length_m": unit.proximal_length_m[k],
        "rod_length_m": unit.rod_length_m[k],
        "stiffness_ratio": ratio,
        "sea_stiffness_Nm_per_rad": design.sea_stiffness_Nm_per_rad * (1.0 + ratio),
        "phi_zero_rad": unit.of("phi_zero")[k],
        "theta_zero_rad": unit.of("theta_zero")[k],
        "tau_zero_Nm": unit.of("tau_zero")[k],
        "tilt_rad": unit.of("tilt")[k],
        "proximal_mass_kg": unit.proximal_mass_kg[k],
        "proximal_com_m": design.proximal_com_m,
        "proximal_inertia_kgm2": unit.proximal_inertia_kgm2[k],
        "rod_mass_kg": unit.rod_mass_kg[k],
        "wrist_mass_kg": float(unit.wrist_mass_kg[k, 0]),
        "yoke_inertia_kgm2": design.yoke_inertia_kgm2,
        "ring_inertia_kgm2": design.ring_inertia_kgm2,
        "flange_inertia_kgm2": design.flange_inertia_kgm2,
        "gravity_mps2": design.gravity_mps2,
    }
    frames = (
        "The zero of theta_x is not known and set to 0: frames are those that the encoders define."
        if in_encoder_frames(unit)
        else "The zero of theta_x is known: frames are those of the drawing."
    )
    head = _HEAD.format(
        robot=robot, robots=calibration.robots, stiffness=design.sea_stiffness_Nm_per_rad, frames=frames
    )
    return head + "\n" + "".join(f"{name} = {_toml(value)}\n" for name, value in values.items())


def _toml(value: float | Sequence[float]) -> str:
    numbers = np.asarray(value, dtype=float)
    return repr(float(numbers)) if numbers.ndim == 0 else repr(numbers.tolist())
