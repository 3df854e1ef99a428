"""Trials that several tests look at, each run once."""

import numpy as np
import pytest

from mocobot_sim.scene import TeamScene, build_team
from mocobot_sim.trajectories import random_vias
from mocobot_sim.trial import TrialLog, run_trial
from payload_mjcf import TEAMS


@pytest.fixture(scope="session")
def teams(tmp_path_factory) -> dict[int, TeamScene]:
    """Teams of 1, 2 and 5 robots as designed."""
    folder = tmp_path_factory.mktemp("teams")
    return {robots: build_team(payload.write(folder)) for robots, payload in TEAMS.items()}


@pytest.fixture(scope="session")
def team_a() -> TeamScene:
    return build_team("a")


@pytest.fixture(scope="session")
def random_a(team_a) -> TrialLog:
    """Ten random vias with payload (a)."""
    return run_trial(team_a, random_vias(team_a.wrist_home_b, np.random.default_rng(3), vias=10))
