"""A calibration put to use: recordings that know their robots as they are."""

from __future__ import annotations

from dataclasses import replace

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import ArmUnit
from estimator.calibrate.calibration import Calibration
from estimator.errors import InputError
from estimator.recording.model import Recording


def calibrated(recording: Recording, calibration: Calibration, called: str = "the calibration") -> Recording:
    """A recording with the calibration's robots in its metadata; its samples stay as they were read.

    What the metadata said of the robots before gives way.

    Args:
        recording: of the same robots.
        calibration: theirs.
        called: how messages call it, such as its file's name.

    Raises:
        InputError: it is of another number of robots, or of another design.
    """
    metadata = recording.metadata
    units = units_for(calibration, metadata.robots, metadata.design, recording.name, called)
    return replace(recording, metadata=replace(metadata, units=units))


def units_for(
    calibration: Calibration, robots: int, design: OmnidDesign, name: str, called: str = "the calibration"
) -> ArmUnit:
    """The calibration's robots, for a log of so many robots of a design.

    Args:
        calibration: of the same robots.
        robots: N.
        design: theirs.
        name: how messages call the log.
        called: how messages call the calibration.

    Raises:
        InputError: it is of another number of robots, or of another design.
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
