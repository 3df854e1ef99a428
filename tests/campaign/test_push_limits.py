"""Limits of pushes are those of the table that other campaigns hide by."""

import pytest

from discrepancy.team.diagnosis import diagnose_team
from discrepancy.team.tolerances import default_tolerances
from hidden import LIMITS, HiddenSet, Schedule, generate
from mocobot.campaign.limits import FORCE, push_limits


@pytest.mark.slow
def test_a_push_is_noticed_from_the_size_that_the_table_has():
    schedule = Schedule(randoms=1, vias=8, periodic_s=10.0, hold_s=None)
    recordings, _ = generate(HiddenSet("clean", 6, payload="b", schedule=schedule, timestep_s=1e-3))
    found = diagnose_team(recordings, closed_loop=False, laws="never")
    limits = push_limits(found.outcome, default_tolerances()["push"])
    assert [limit["trial"] for limit in limits] == [1, 2]
    for limit in limits:
        for name in FORCE:
            assert limit["parameters"][name] == pytest.approx(LIMITS["push"][name], rel=0.5)
