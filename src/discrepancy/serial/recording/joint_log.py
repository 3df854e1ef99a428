"""The log of a robot's joints that the rig works on; it is read in ``mocobot_logs.joints``."""

from mocobot_logs.joints.joint_log import Command, Drive, JointLog

__all__ = ["Command", "Drive", "JointLog"]
