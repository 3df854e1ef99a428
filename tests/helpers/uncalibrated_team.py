"""An exact recording of three robots that are not as designed, and what they are really like."""

from dataclasses import replace
from functools import cache

import numpy as np

from estimator.arm.unit import AT, COUNT, GROUPS, ArmUnit
from estimator.recording.model import Recording
from omnid_design import DESIGN
from recorded_team import Carried, Sines, carry

SPREAD = {
    "phi_zero": 0.017, "theta_zero": 0.017, "radius": 1.4e-3, "proximal_length": 1e-3, "rod_length": 1e-3,
    "stiffness_ratio": 0.02, "tau_zero": 0.02, "tilt": 3e-3, "proximal_mass_ratio": 0.05, "rod_mass_ratio": 0.05,
    "wrist_mass_ratio": 0.05,
}  # fmt: skip


DEFAULT = ("tilt", "proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio")
"""What a calibration takes as designed unless it is told otherwise."""


def true_units(seed: int = 8, without: tuple[str, ...] = ()) -> ArmUnit:
    """Robots off in all groups but some; not in theta_x zeros, which nothing decides, nor in the springs' mean."""
    sd = np.concatenate([np.full(len(group.entries), SPREAD[group.name]) for group in GROUPS])
    x = sd * np.random.default_rng(seed).standard_normal((3, COUNT))
    x[:, AT["theta_zero"].start + 2] = 0.0
    x[:, AT["stiffness_ratio"]] -= x[:, AT["stiffness_ratio"]].mean()
    for name in without:
        x[:, AT[name]] = 0.0
    return ArmUnit(DESIGN, x)


@cache
def uncalibrated(
    duration_s: float = 24.0, seed: int = 4, without: tuple[str, ...] = ()
) -> tuple[Carried, ArmUnit]:
    """The recording, which says nothing of what the robots are like, and their truth."""
    rng = np.random.default_rng(seed)
    path = Sines.draw(rng, [0.06, 0.06, 0.06, 0.03, 0.03, 0.025], 3, 0.1, 0.5)
    squeeze = Sines.draw(rng, [2.0, 2.0, 2.0], 2, 0.1, 0.5)
    units = true_units(without=without)
    return carry(path, squeeze, duration_s, units=units), units


def knowing(recording: Recording, units: ArmUnit | None) -> Recording:
    """The recording with robots in its metadata."""
    return replace(recording, metadata=replace(recording.metadata, units=units))
