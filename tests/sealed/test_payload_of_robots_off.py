"""A payload is estimated better with what the robots are off by: against the payload that was simulated."""

from dataclasses import replace

import pytest

from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.estimates import errors
from hidden import Schedule
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.truth import GroundTruth
from sealed.sets import generate, plan


@pytest.mark.slow
@pytest.mark.parametrize(
    ("background", "share"),
    [("x3", {"com_mm": 0.5, "grasp_position_mm": 0.5}), ("uncalibrated", {"principal_inertia_percent": 0.3})],
)
def test_with_what_the_robots_are_off_by_the_payload_is_nearer_to_what_it_is(background, share):
    """Where a robot is off in its gimbals' last axes its grasp turns with it, and no data tell."""
    request = plan("clean", 61, background)
    recordings, _ = generate(replace(request, schedule=Schedule(randoms=1, vias=12, periodic_s=20.0)))
    values = diagnose_team(recordings, closed_loop=False).to_dict()
    assert values["verdict"] == "miscalibrated"
    truth = GroundTruth.of(build_team(request.payload)).to_dict()
    before, after = (errors(values["gain"]["estimates"][name], truth) for name in ("before", "after"))
    for key, most in share.items():
        assert after[key] < most * before[key]
    assert after["mass_percent"] < 1.0


@pytest.mark.slow
def test_parts_within_their_tolerances_are_what_a_healthy_team_responds_differently_by():
    """By what the other trials tell; the noise is 1."""
    request = plan("clean", 62, "x1")
    recordings, _ = generate(replace(request, schedule=Schedule(randoms=2, vias=12, periodic_s=20.0)))
    values = diagnose_team(recordings).to_dict()
    assert values["verdict"] == "consistent"
    told = {name: one["chi2_per_n"] for name, one in values["gain"]["held_out"].items()}
    assert told["before"] > 20.0
    assert told["as_found"] < 0.2 * told["before"]
