"""Bases that drive: planned motions in the plane, mecanum kinematics, one robot alone, and what a drive logs."""

from mocobot_sim.base.design import WHEELS, BaseDesign, base_design
from mocobot_sim.base.drive import BaseDrive, DriveLog
from mocobot_sim.base.follow import FollowingDrive
from mocobot_sim.base.mecanum import MecanumKinematics
from mocobot_sim.base.motion import Leg, PlanarMotion, carried, compose, plan, relative, yaw_of
from mocobot_sim.base.solo import Snapshots, build_solo, compile_solo, drive_solo

__all__ = [
    "WHEELS",
    "BaseDesign",
    "BaseDrive",
    "DriveLog",
    "FollowingDrive",
    "Leg",
    "MecanumKinematics",
    "PlanarMotion",
    "Snapshots",
    "base_design",
    "build_solo",
    "carried",
    "compile_solo",
    "compose",
    "drive_solo",
    "plan",
    "relative",
    "yaw_of",
]
