"""Commanded motions of the wrists, sampled at ``RATE_HZ``."""

from mocobot_sim.trial.trajectories import (
    RATE_HZ,
    Trajectory,
    free_motion,
    random_vias,
    sphere_motion,
    static_orientations,
)

__all__ = ["RATE_HZ", "Trajectory", "free_motion", "random_vias", "sphere_motion", "static_orientations"]
