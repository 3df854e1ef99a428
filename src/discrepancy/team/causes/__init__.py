"""The catalogue of a team's causes by topic, and their default tolerances."""

from __future__ import annotations

from pathlib import Path

from discrepancy.cause_names import read_tolerances as with_file
from discrepancy.team.causes.base import Cause
from discrepancy.team.causes.cable import PayloadTether, Tether
from discrepancy.team.causes.friction import GimbalFriction, JointFriction, SeaHysteresis
from discrepancy.team.causes.payload import Drag, PayloadMass, Push
from discrepancy.team.causes.readings import (
    BaseTilt,
    ClockDelay,
    EncoderPlay,
    LinkLength,
    PhiZero,
    SeaBias,
    SeaHardening,
    SeaScale,
    SensorLag,
    ThetaZero,
    TorqueLag,
    TorqueSkew,
)
from discrepancy.team.causes.slosh import Slosh
from discrepancy.team.causes.yielding import BaseCompliance, BaseCreep, GraspFlex, GraspPlay

CATALOGUE = (
    PhiZero, ThetaZero, LinkLength, BaseTilt, BaseCreep, BaseCompliance, SeaScale, SeaBias, SeaHardening,
    SeaHysteresis, JointFriction, GimbalFriction, TorqueSkew, TorqueLag, SensorLag, ClockDelay, GraspFlex,
    GraspPlay, Tether, PayloadTether, Push, Drag, Slosh, PayloadMass, EncoderPlay,
)  # fmt: skip
CAUSES: dict[str, Cause] = {cause.name: cause() for cause in CATALOGUE}
"""Every cause by its name."""


def default_tolerances() -> dict[str, dict[str, float]]:
    """Default standard deviations by cause and parameter."""
    return {
        name: dict(zip(cause.parameters, cause.tolerances, strict=True))
        for name, cause in CAUSES.items()
        if cause.tolerances
    }


def read_tolerances(path: Path | None) -> dict[str, dict[str, float]]:
    """The default tolerances, with changes from a TOML file; see ``discrepancy.cause_names``.

    Raises:
        InputError: the file cannot be read, or names something unknown, or a value is not a number of at least 0.
    """
    return with_file(path, default_tolerances())
