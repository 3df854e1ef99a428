"""What well-known robots mean by the names in their logs: torque, motor current, or an estimate of unknown scale.

Sources:

- Universal Robots. RTDE names are those of the RTDE guide (docs.universal-robots.com). ``effort`` of the ROS drivers is
  ``actual_current``; since PolyScope 5.23 / 10.11, ``use_currents_as_efforts = false`` makes it torques
  (github.com/UniversalRobots/Universal_Robots_ROS2_Driver, issue 794 and pull request 1918).
- Franka. ``tau_J``: "Measured link-side joint torque sensor signals. Unit: [Nm]" (libfranka, franka/robot_state.h).
  ``effort`` of its joint states, and ``measured_joint_state.effort`` of ``FrankaRobotState``, are ``tau_J``
  (franka_ros2).
- Dynamixel X series. Counts and units are those of the control tables (emanual.robotis.com/docs/en/dxl/x): 4,096
  counts a turn, 2,048 in the middle, 0.113 % of duty (885 is full), 0.229 rpm, 0.1 V; current in 2.69 mA, or 1 mA of
  XL330 and XC330.
- Trajectory controllers of ros2_control. ``JointTrajectoryControllerState`` (github.com/ros-controls/control_msgs):
  ``reference`` and ``feedback``, before ``desired`` and ``actual``.
- Unitree. ``motor_cmd`` has q, dq, tau, kp and kd of the law kp (q - position) + kd (dq - velocity) + tau. ``tau_est``
  of unitree_go/msg/MotorState and unitree_hg/msg/MotorState: "estimated torque" (unitree_ros2), whose scale is stated
  nowhere.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Meaning:
    quantity: str | None  # quantity of a map, or None for what is no measurement of a joint
    unit: str | None = None  # unit of a map, or None if the name does not tell
    said: str = ""  # comment for the map
    doubtful: bool = False  # whether the user must check it
    more: str = ""  # further keys of the map
    whole: bool = False  # whether it holds for whole numbers alone


_NONE = Meaning(None)
_ESTIMATE = Meaning("current", "A", "an estimate of unknown scale, read as a current whose constant is free")
_LINK = Meaning("link_torque", "Nm", "measured behind the gear, gravity included")
_TURN = "counts_per_turn = 4096, offset = -2048"
_COLUMNS: tuple[tuple[str, Meaning], ...] = (
    ("actual_current_as_torque", Meaning("torque", "Nm", "UR: torques by the controller's constants")),
    ("actual_current", Meaning("current", "A", "UR: motor currents")),
    ("actual_qd", Meaning("dq", "rad/s")),
    ("actual_q", Meaning("q", "rad")),
    ("target_q", Meaning("command", "rad")),
    ("target_(qd|qdd|current|moment)|joint_control_output|joint_(temperatures|mode)|actual_joint_voltage", _NONE),
    ("tau_j", _LINK),
    (r"dtau_j|tau_j_d|tau_ext(_\w+)?|dq_d|ddq_d|joint_(contact|collision)", _NONE),
    ("q_d", Meaning("command", "rad")),
    ("motor_state_q", Meaning("q", "rad")),
    ("motor_state_dq", Meaning("dq", "rad/s")),
    ("tau_est", _ESTIMATE),
    ("motor_cmd_q", Meaning("command", "rad")),
    ("motor_cmd_dq", Meaning("command_velocity", "rad/s")),
    ("motor_cmd_tau", Meaning("feedforward", "Nm")),
    ("motor_cmd_kp|position_p_gain", Meaning("position_gain")),
    ("motor_cmd_kd", Meaning("velocity_gain")),
    (r"position_[di]_gain|velocity_[pi]_gain|feedforward_\w+_gain|present_temperature", _NONE),
    ("present_position", Meaning("q", "counts", "Dynamixel: 2048 is the middle", more=_TURN, whole=True)),
    ("goal_position", Meaning("command", "counts", "Dynamixel: 2048 is the middle", more=_TURN, whole=True)),
    ("present_pwm", Meaning("duty", "counts", "Dynamixel: 885 is full", more="full_scale = 885", whole=True)),
    ("present_velocity", Meaning("dq", "0.229 rpm", "Dynamixel", whole=True)),
    ("present_current", Meaning("current", "2.69 mA", 'of XL330 and XC330 it is "mA"', doubtful=True, whole=True)),
    ("present_input_voltage", Meaning("supply", "0.1 V", "Dynamixel", whole=True)),
    (r"\w*(tcp|tool|wrench|external)(_\w+)?|(\w+_)?(ddq|qdd|temp|temperature)", _NONE),
)  # fmt: skip
"""Meanings by pattern of a name in lower case, without placeholders; the last words of a name count."""
_CURRENTS = "UR: motor currents; torque in Nm if the driver has use_currents_as_efforts = false"
_EFFORTS: tuple[tuple[str, Meaning], ...] = (
    (r"(^|_)(shoulder_pan|wrist_3)_joint$", Meaning("current", "A", _CURRENTS, doubtful=True)),
    (r"(^|_)(panda|fr3|fer)(_\w+)?_joint[1-7]$", _LINK),
)
"""Meanings of the field ``effort`` by pattern of a joint's name."""
_LOW_STATE = {
    "q": ("motor_state[{index}].q", Meaning("q", "rad")),
    "dq": ("motor_state[{index}].dq", Meaning("dq", "rad/s")),
    "current": ("motor_state[{index}].tau_est", _ESTIMATE),
}
TYPES: Mapping[str, Mapping[str, tuple[str, Meaning]]] = {
    "unitree_go/msg/LowState": _LOW_STATE,
    "unitree_hg/msg/LowState": _LOW_STATE,
    "franka_msgs/msg/FrankaState": {
        "q": ("q[{index}]", Meaning("q", "rad")),
        "dq": ("dq[{index}]", Meaning("dq", "rad/s")),
        "link_torque": ("tau_J[{index}]", _LINK),
    },
    "franka_msgs/msg/FrankaRobotState": {
        "q": ("measured_joint_state.position[{index}]", Meaning("q", "rad")),
        "dq": ("measured_joint_state.velocity[{index}]", Meaning("dq", "rad/s")),
        "link_torque": ("measured_joint_state.effort[{index}]", _LINK),
    },
}
"""Fields of message types that are no joint states, by quantity."""
_LOW_CMD = {
    "command": ("motor_cmd[{index}].q", Meaning("command", "rad")),
    "command_velocity": ("motor_cmd[{index}].dq", Meaning("command_velocity", "rad/s")),
    "feedforward": ("motor_cmd[{index}].tau", Meaning("feedforward", "Nm")),
    "position_gain": ("motor_cmd[{index}].kp", Meaning(None)),
    "velocity_gain": ("motor_cmd[{index}].kd", Meaning(None)),
}
ORDERS: Mapping[str, Mapping[str, tuple[str, Meaning]]] = {
    "unitree_go/msg/LowCmd": _LOW_CMD,
    "unitree_hg/msg/LowCmd": _LOW_CMD,
}
"""The same of message types that tell the robot what to do."""
TRAJECTORY = "control_msgs/msg/JointTrajectoryControllerState"
TRAJECTORY_FIELDS = {
    "q": ("rad", "positions", ("feedback", "actual")),
    "dq": ("rad/s", "velocities", ("feedback", "actual")),
    "command": ("rad", "positions", ("reference", "desired")),
}
"""Unit, array, and new and old name of the field of that message by quantity."""
COMMANDING = (*ORDERS, TRAJECTORY)


def arm_joints(message: str) -> int:
    """Return the number of joints that a message type of ``TYPES`` is of, 0 if it does not tell."""
    return 7 if message in TYPES and message.startswith("franka_") else 0


def column_meaning(name: str) -> Meaning | None:
    """Return the meaning of a column's name with placeholders, None if no well-known robot has such a name."""
    words = re.sub(r"[^a-z0-9]+", "_", re.sub(r"\{\w+\}", "_", name).lower()).strip("_")
    return next((told for pattern, told in _COLUMNS if re.search(rf"(?:^|_)(?:{pattern})$", words)), None)


def effort_meaning(joints: Sequence[str]) -> Meaning:
    """Return what ``effort`` is in the joint states of a robot whose joints have these names."""
    for pattern, told in _EFFORTS:
        if any(re.search(pattern, joint) for joint in joints):
            return told
    return Meaning("torque", "Nm")
