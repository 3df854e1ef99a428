"""Places and signals of a team whose recording is exact, with nothing whitened."""

import numpy as np
import pytest

from discrepancy.team.linear.whitening import Whitening
from discrepancy.team.laws.bench import TeamBench
from team_case import exact


@pytest.fixture(scope="module")
def case():
    return exact()


@pytest.fixture(scope="module")
def bench(case):
    channels, moving = case.linear.channels, case.reduction.moving
    eye = np.eye(channels)
    white = Whitening(moving, eye, eye, np.zeros((channels, 0)), np.ones(channels), np.ones((1, channels)))
    return TeamBench([case.linear], [white])
