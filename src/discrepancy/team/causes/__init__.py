"""The catalogue of a team's causes, by subject."""

from discrepancy.team.causes.base import Cause
from discrepancy.team.causes.cable import PayloadTether, Tether
from discrepancy.team.causes.friction import GimbalFriction, JointFriction, SeaHysteresis
from discrepancy.team.causes.payload import Drag, PayloadMass, Push
from discrepancy.team.causes.readings import (
    BaseTilt,
    ClockDelay,
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
    GraspPlay, Tether, PayloadTether, Push, Drag, Slosh, PayloadMass,
)  # fmt: skip
CAUSES: dict[str, Cause] = {cause.name: cause() for cause in CATALOGUE}
"""Every cause by its name."""
