"""Robots as an estimate took them, for recordings that do not say themselves."""

from dataclasses import replace

import numpy as np

from estimator.arm.arms import Arms
from estimator.arm.unit import ArmUnit
from estimator.arrays import Array
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_view.facts.placement import Bases


def as_estimated(recording: Recording, estimate: PayloadEstimate | None) -> Recording:
    """A recording whose robots are those of its estimate, where it says nothing of them itself and they fit."""
    metadata, units = recording.metadata, None if estimate is None else estimate.units
    if units is None or metadata.units is not None:
        return recording
    if units.design != metadata.design or len(units.x) != metadata.robots:
        return recording
    return replace(recording, metadata=replace(metadata, units=units))


def tilted(bases: Bases, arms: Arms) -> Bases:
    """Bases as they stand: level ones, turned by what a calibration says of each."""
    if not isinstance(arms, ArmUnit) or not np.any(arms.of("tilt")):
        return bases
    R: Array = bases.R_Wb @ arms.R_ba
    return Bases(R, bases.p_Wb)
