"""What a part of a team believes to carry is not told as the payload's."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from estimator.estimate.consistency import Trial
from estimator.estimate.payload import estimate_from_trials, estimate_payload
from estimator.estimate.result import format_estimate
from recorded_team import MASS, Sines, carry
from rigid_body_data import make_body, moving


@cache
def whole():
    """Three exact robots that squeeze the payload while they turn it."""
    rng = np.random.default_rng(11)
    path = Sines.draw(rng, np.r_[np.full(3, 0.06), np.full(3, 0.02)], 3, 0.2, 0.8)
    return carry(path, Sines.draw(rng, np.full(3, 8.0), 3, 0.2, 0.8), 14.0).recording


def part(robots, control=None):
    recording = whole()
    channels = {name: getattr(recording, name)[:, robots] for name in ("phi", "theta", "tau")}
    metadata = replace(recording.metadata, robots=len(robots), control=control)
    return replace(recording, **channels, metadata=metadata)


def nothing_told(estimate):
    return estimate.mass is estimate.p_1c is estimate.inertia is None


@pytest.mark.parametrize("robot", [0, 1, 2])
def test_one_of_three_robots_tells_no_mass(robot):
    estimate = estimate_payload([part([robot])])
    assert nothing_told(estimate)
    assert estimate.recordings[0].inertia is None
    assert estimate.flags[0].startswith(
        "Mass, centre of mass and inertia are withheld: the forces of this robot"
    )
    assert estimate.flags[0] in format_estimate(estimate)
    assert format_estimate(estimate).startswith("[[Payload]]  1 robot, ")
    assert "robots apart" not in format_estimate(estimate)
    assert estimate_payload([part([robot])], withhold=False).mass is not None


def test_two_of_three_robots_tell_no_mass():
    estimate = estimate_payload([part([0, 2])])
    assert estimate.mass is None
    assert "withheld" in estimate.flags[0]
    assert "is a robot missing" in estimate.flags[0]


def test_metadata_of_a_larger_team_are_believed():
    forces = [[0.0, 0.0, 30.0]] * 4
    estimate = estimate_payload([part([0, 1, 2], {"feed_forward_N": forces})])
    assert nothing_told(estimate)
    assert "a team of 4 robots and the samples of 3 robots" in estimate.flags[0]
    told = estimate_payload([part([0, 1, 2], {"feed_forward_N": forces[:3]})])
    assert told.mass.mass == pytest.approx(MASS, rel=1e-3)
    assert not any("withheld" in flag for flag in told.flags)


def test_a_lone_robot_that_carries_all_keeps_its_numbers():
    body = make_body(1)
    trial = Trial(
        "alone", "random", None, moving(body, 40, twist_noise=3e-4, linear_noise=1e-4, wrench_noise=0.05)
    )
    estimate = estimate_from_trials([trial])
    assert abs(estimate.mass.mass - body.mass) < 5 * estimate.mass.se
