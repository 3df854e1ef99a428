"""Mobile bases: planned planar motions, mecanum kinematics, simulation of a single robot, and logs of a drive."""

from mocobot_sim.base.design import WHEELS, BaseDesign, MecanumKinematics, base_design
from mocobot_sim.base.drive import (
    BaseDrive,
    DriveLog,
    FollowingDrive,
    Snapshots,
    build_solo,
    compile_solo,
    drive_solo,
)
from mocobot_sim.trial.trajectories import Leg, PlanarMotion, carried, compose, plan, relative, yaw_of

__all__ = [
    "WHEELS", "BaseDesign", "BaseDrive", "DriveLog", "FollowingDrive", "Leg", "MecanumKinematics",
    "PlanarMotion", "Snapshots", "base_design", "build_solo", "carried", "compile_solo", "compose",
    "drive_solo", "plan", "relative", "yaw_of",
]  # fmt: skip
