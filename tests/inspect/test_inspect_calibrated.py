"""The wiring of robots as a calibration has them: nothing is left of an exact recording, at either level."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.arm.arms import Arms
from estimator.arm.wrist_level import wrist_of
from estimator.recording.model import Recording
from mocobot_inspect.readiness import readiness
from mocobot_inspect.signals import signals_of
from mocobot_inspect.team_wiring import Misfit, Team
from mocobot_logs.log import Level
from omnid_design import DESIGN
from uncalibrated_team import uncalibrated


def samples(recording: Recording, level: Level) -> np.ndarray:
    """As a log tells them: wrists and forces are worked out by robots' own controllers, which know the design."""
    position, effort = recording.phi, recording.tau
    if level == "wrist":
        position, effort = wrist_of(position, effort, DESIGN)
    return np.concatenate([position, recording.theta, effort], axis=2)


def misfit(recording: Recording, level: Level, arms: Arms) -> Misfit:
    found = signals_of(level, [samples(recording, level)], np.full((3, 9), 1e-9))
    return Team(found, arms).misfit


@pytest.mark.parametrize("level", ["joint", "wrist"])
def test_robots_as_they_are_fit_together(level: Level) -> None:
    carried, units = uncalibrated()
    as_they_are = misfit(carried.recording, level, units)
    as_designed = misfit(carried.recording, level, DESIGN)
    assert max(as_they_are.relative.values()) < 1e-3  # forces lack the gimbals' own moments, some mN m
    assert max(as_they_are.relative[name] for name in ("rotation", "velocity", "tilt")) < 1e-4
    assert max(as_designed.relative.values()) > 5e-3


@pytest.mark.parametrize("level", ["joint", "wrist"])
def test_readiness_of_robots_as_they_are(level: Level) -> None:
    carried, units = uncalibrated()
    part = samples(carried.recording, level)
    known, unknown = (readiness("log", level, [(0.0, part)], arms) for arms in (units, DESIGN))
    assert set(known.reasons.values()) == {None}
    assert known.steps[0].noise < 1e-6 < unknown.steps[0].noise
