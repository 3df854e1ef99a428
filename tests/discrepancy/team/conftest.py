"""What several files of this folder start from."""

import pytest

from outside_wrench import motion_of
from team_case import exact


@pytest.fixture(scope="module")
def case():
    """An exact recording of three robots, with its true unknowns."""
    return exact()


@pytest.fixture(scope="module")
def motion(case):
    """Attitude, position and twist of its payload."""
    return motion_of(case)
