"""Commanded motions of the wrists, sampled at ``RATE_HZ``."""

from __future__ import annotations

from mocobot_sim.trial.trajectories import (
    RATE_HZ,
    Trajectory,
    random_vias,
    sphere_motion,
    static_orientations,
)

__all__ = ["RATE_HZ", "Trajectory", "random_vias", "sphere_motion", "static_orientations"]
