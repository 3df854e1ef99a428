"""One robot's numbers as they are, for other programs: design and deviations together, one number a leg."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.calibrate.calibration import Calibration
from estimator.estimate.frames import in_encoder_frames

_HEAD = """\
# Robot {robot} of {robots} as calibrated; SI units in the keys. Lists have one number a leg (1, 2, 3); theta_zero_rad
# is in the order z, y, x; tilt_rad is the rotation vector of the base about x and y. Zeros are reading minus truth, and
# a true torque is (reading - tau_zero_Nm) (1 + stiffness_ratio) where readings take all springs as designed
# ({stiffness:g} N m/rad). radius_m is base radius minus platform radius: kinematics sees no more of the two.
# {frames}
"""


def unit_toml(calibration: Calibration, robot: int) -> str:
    """A robot's numbers as TOML.

    Args:
        calibration: with it.
        robot: counted from 1.
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
