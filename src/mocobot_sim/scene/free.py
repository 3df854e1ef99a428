"""Compose a team that holds nothing: Omnids parked side by side, every flange free (PyMJCF)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform

from estimator.errors import InputError
from mocobot_sim.scene.as_built import AsBuilt, deviate, units_of
from mocobot_sim.scene.models import models_dir, omnid_design
from mocobot_sim.scene.omnid import load_omnid, park, stand
from mocobot_sim.scene.pymjcf import mjcf
from mocobot_sim.scene.scene import TIMESTEP_S, TeamScene

SPACING_M = 1.2
"""Distance of neighbours in the row: no two arms can touch."""
MOST_ROBOTS = 100


def build_free_team(
    robots: int,
    as_built: Sequence[AsBuilt] = (),
    theta: ArrayLike | None = None,
    timestep_s: float = TIMESTEP_S,
) -> TeamScene:
    """Park Omnids in a row along x, with nothing on their flanges.

    The gimbals are as in every team: passive, without friction or springs, each of their bodies balanced about the
    wrist. A platform only translates, so neither gravity nor the arm's motion turns them: they stay as they are left,
    and what they weigh is carried by the wrist.

    Args:
        robots: how many.
        as_built: deviations from the design, one per robot; empty for robots as designed.
        theta: gimbal angles (z, y, x) as they are left [rad], shape (N, 3); None for zero.
        timestep_s: integration step [s].

    Raises:
        InputError: a number of robots out of range, or ``as_built`` or ``theta`` does not match it.
    """
    check_robots(robots)
    units = units_of(as_built, robots)
    design = omnid_design()
    angles = np.zeros((robots, 3)) if theta is None else np.array(theta, dtype=float)
    if angles.shape != (robots, 3) or not (np.abs(angles) <= design.gimbal_limit_rad).all():
        raise InputError(
            f"theta is not {robots} x 3 angles of at most {design.gimbal_limit_rad:g} rad; it must be"
        )
    root = mjcf.from_path(str(models_dir() / "team.xml"))
    root.option.timestep = timestep_s
    places = np.zeros((robots, 3))
    places[:, 0] = SPACING_M * np.arange(robots)
    for i, unit in enumerate(units):
        omnid = load_omnid(i + 1)
        deviate(omnid, unit)
        park(omnid)
        stand(root, omnid, places[i], [1.0, 0.0, 0.0, 0.0])
    mounts = RigidTransform.from_translation(places)
    home = np.tile([0.0, 0.0, design.home_height_m], (robots, 1))
    return TeamScene(root, robots, home, angles, mounts, units, mounts, carries=False)


def check_robots(robots: int) -> None:
    """Refuse a number of robots before anything of that size is made.

    Raises:
        InputError: it is out of range.
    """
    if not 1 <= robots <= MOST_ROBOTS:
        raise InputError(f"robots is {robots}; it must be at least 1 and at most {MOST_ROBOTS}")
