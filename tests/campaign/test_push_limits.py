"""Limits of pushes, where sensors are so good that only the tolerance of a push matters."""

import numpy as np
import pytest

from discrepancy.team.linear.adjust import SignalNoise
from discrepancy.team.linear.start import Sensed
from discrepancy.team.rig import TeamRig
from discrepancy.team.tolerances import default_tolerances
from mocobot.campaign.limits import GAIN, push_limits
from team_case import exact


def sharp(x):
    """Rows as sensors with a hundred thousandth of the unit would tell them."""
    return 1e5 * x


def test_no_push_within_its_tolerance_is_told():
    case, tolerances = exact(), default_tolerances()
    sensed = Sensed(None, (sharp,), (SignalNoise((np.zeros((3, 21, 18)),) * 2),))
    rig = TeamRig((case.carried.recording,), sensed, (case.linear,), tolerances, frozenset())
    (limit,) = push_limits(rig, tolerances["push"])
    assert limit["trial"] == 1
    for name, size in limit["parameters"].items():
        assert size == pytest.approx(np.sqrt(GAIN) * tolerances["push"][name], rel=1e-3)
