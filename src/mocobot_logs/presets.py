"""What well-known robots mean by the names in their logs: torque, motor current, or an estimate of unknown scale.

Sources:

- Universal Robots. RTDE names are those of the RTDE guide (docs.universal-robots.com). ``effort`` of the ROS drivers is
  ``actual_current``; since PolyScope 5.23 / 10.11, ``use_currents_as_efforts = false`` makes it torques
  (github.com/UniversalRobots/Universal_Robots_ROS2_Driver, issue 794 and pull request 1918).
- Franka. ``tau_J``: "Measured link-side joint torque sensor signals. Unit: [Nm]" (libfranka, franka/robot_state.h).
  ``effort`` of its joint states, and ``measured_joint_state.effort`` of ``FrankaRobotState``, are ``tau_J``
  (franka_ros2).
- Unitree. ``tau_est`` of unitree_go/msg/MotorState and unitree_hg/msg/MotorState: "estimated torque" (unitree_ros2),
  whose scale is stated nowhere.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Meaning:
    """Meaning of a name.

    Attributes:
        quantity: quantity of a map, or None for what is no measurement of a joint.
        unit: unit of a map, or None if the name does not tell.
        said: comment for the map.
        doubtful: whether the user must check it.
    """

    quantity: str | None
    unit: str | None = None
    said: str = ""
    doubtful: bool = False


_NONE = Meaning(None)
_ESTIMATE = Meaning("current", "A", "an estimate of unknown scale, read as a current whose constant is free")
_LINK = Meaning("link_torque", "Nm", "measured behind the gear, gravity included")
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
