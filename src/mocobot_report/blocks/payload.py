"""Numbers of an estimated payload as entries of tables, with standard errors; a dash for what is not known."""

import numpy as np

from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks.numbers import NONE
from mocobot_report.blocks.tables import Num, component, measurement


def mass(e: PayloadEstimate) -> Num:
    """The mass [kg]."""
    return measurement(e.mass.mass, e.mass.se) if e.mass else Num(NONE)


def place(e: PayloadEstimate, k: int) -> Num:
    """One coordinate of the centre of mass in {1} [mm]."""
    return component(e.p_1c, e.p_1c_se_m, k, 1e3)


def moment(e: PayloadEstimate, k: int) -> Num:
    """One principal moment of inertia [kg m²]."""
    return (
        component(e.inertia.principal.moments, e.inertia.principal.moments_se, k) if e.inertia else Num(NONE)
    )


def distance(e: PayloadEstimate, i: int, j: int) -> Num:
    """Distance of two grasps [mm]; robots counted from 1."""
    if e.grasps is None or max(i, j) > e.robots:
        return Num(NONE)
    pair = e.grasps.pair(i, j)
    return measurement(1e3 * float(np.linalg.norm(pair.p_ij)), 1e3 * pair.distance_se_m)
