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
def test_with_what_the_robots_are_off_by_the_payload_is_nearer_to_what_it_is():
    """Where a robot is off in its gimbals' last axes its grasp turns with it, and no data tell."""
    request = plan("clean", 61, "uncalibrated")
    recordings, _ = generate(replace(request, schedule=Schedule(randoms=1, vias=12, periodic_s=20.0)))
    values = diagnose_team(recordings, closed_loop=False).to_dict()
    assert values["verdict"] == "miscalibrated"
    truth = GroundTruth.of(build_team(request.payload)).to_dict()
    before, after = (errors(values["gain"]["estimates"][name], truth) for name in ("before", "after"))
    assert after["principal_inertia_percent"] < 0.3 * before["principal_inertia_percent"]
    assert after["mass_percent"] < 1.0
