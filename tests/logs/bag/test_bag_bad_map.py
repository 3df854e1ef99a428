"""Bags that do not hold what the map says."""

import numpy as np

import bags
from bag_refusals import TEAM, refuses
from bags import Team, raw_mcap, said, wrist_map
from mocobot_logs.bag.write import write_bag
from mocobot_logs.maps import builtin_map, parse_map
from recordings import small_recording


def test_topics_that_are_missing(tmp_path):
    others = [said("/imu", s.log_ns, TEAM.message(0, 0)) for s in TEAM.said()]
    path = raw_mcap(tmp_path / "a.mcap", others)
    refuses(
        path,
        r"no topic '/omnid1/joint/joint_states' for h_x of robot 1 by map omnid-ros2; the bag's topics are /imu "
        r"\(sensor_msgs/msg/JointState\)$",
    )
    near = [
        bags.Said(s.topic.replace("joint_states", "joint_state"), s.log_ns, s.kind, s.data)
        for s in TEAM.said()
    ]
    refuses(
        raw_mcap(tmp_path / "a.mcap", near),
        r"\(did you mean /omnid1/joint/joint_state\?\); the bag's topics are",
    )
    odd = [bags.Said(f"/\x1b[31m{k}", s.log_ns, s.kind, s.data) for k, s in enumerate(TEAM.said())]
    refuses(
        raw_mcap(tmp_path / "a.mcap", odd), r"the bag's topics are /\\x1b\[31m0 .*, \.\.\. \(60 in all\)$"
    )


def test_robots_that_are_missing(tmp_path):
    messages = [s for s in TEAM.said() if "omnid2" not in s.topic]
    path = raw_mcap(tmp_path / "a.mcap", messages)
    refuses(
        path,
        "there are topics of robots 1 and 3, but none of robot 2; robots are counted from 1 without a gap",
    )
    fewer = parse_map({"robots": 4, **wrist_map()}, "test")
    whole = raw_mcap(tmp_path / "b.mcap", TEAM.said())
    refuses(whole, "no topic '/omnid4/joint/joint_states' for h_x of robot 4 by map test", fewer)


def test_joints_that_are_missing(tmp_path):
    renamed = raw_mcap(
        tmp_path / "a.mcap", TEAM.said(names=["x", "y", "zed", "gimbal_x", "gimbal_y", "gimbal_z"])
    )
    refuses(
        renamed,
        r"joint 'z', wanted for h_z of robot 1, is missing in every message; the joints there are x, y, zed, gimbal_x",
    )
    twice = raw_mcap(tmp_path / "b.mcap", TEAM.said(names=["x", "y", "z", "gimbal_x", "z", "gimbal_z"]))
    refuses(twice, r"joint 'z', wanted for h_z of robot 1, is named more than once in every message")
    legs = raw_mcap(tmp_path / "c.mcap", TEAM.said(names=["hip", "knee", "foot", "l", "m", "r"]))
    refuses(
        legs,
        r"the joints of topic /omnid1/joint/joint_states are hip, knee, foot, l, m, r, neither phi1, .* "
        r"\(mocobot-ros2\) nor x, y, z, .* \(omnid-ros2\); a map says which is which",
    )
    nobody = [said(s.topic, s.log_ns, bags.joint_state([], [], names=[])) for s in TEAM.said()]
    refuses(
        raw_mcap(tmp_path / "d.mcap", nobody), "topic /omnid1/joint/joint_states has no message with a joint"
    )


def test_efforts_that_are_missing(tmp_path):
    messages = [said(s.topic, s.log_ns, bags.joint_state(np.zeros(6), [])) for s in TEAM.said()]
    refuses(
        raw_mcap(tmp_path / "a.mcap", messages),
        r"joint 'x', wanted for force_x of robot 1, has no effort in every message; the joints there are x, y, z, gim",
    )
    refuses(
        raw_mcap(tmp_path / "b.mcap", TEAM.said()),
        r"joint 'x', wanted for h_x of robot 1, has no velocity in every message",
        parse_map(wrist_map("velocity"), "test"),
    )


def test_what_is_missing_in_a_long_bag_is_told_early(tmp_path):
    team = Team.draw(robots=1, rows=12_000)
    messages = team.said(names=["x", "y", "zed", "gimbal_x", "gimbal_y", "gimbal_z"])
    path = raw_mcap(tmp_path / "a.mcap", messages, chunk_size=1 << 16)
    refuses(path, r"'z', wanted for h_z of robot 1, is missing in all of the first 10\d\d\d messages")


def test_messages_of_another_type(tmp_path):
    points = [said(s.topic, s.log_ns, bags.point([1, 2, 3])) for s in TEAM.said()]
    path = raw_mcap(tmp_path / "a.mcap", points)
    refuses(
        path,
        r"topic /omnid1/joint/joint_states holds geometry_msgs/msg/PointStamped; a map's key joint goes with "
        r"sensor_msgs/msg/JointState, and a dotted path as field with other messages",
    )
    by_path = wrist_map()
    for k, table in enumerate(by_path["channels"].values()):
        del table["joint"]
        table["field"] = f"point.w{k}"
    refuses(
        path,
        r"point has no field 'w0'; the fields of geometry_msgs/msg/Point are x, y, z",
        parse_map(by_path, "test"),
    )


def test_types_that_nobody_defines(tmp_path):
    messages = [bags.Said(s.topic, s.log_ns, "lab/msg/State", s.data) for s in TEAM.said()]
    path = raw_mcap(tmp_path / "a.mcap", messages, definitions={"lab/msg/State": ("", "")})
    refuses(path, r"holds lab/msg/State, a type that the bag does not define", builtin_map("omnid-ros2"))
    path = raw_mcap(tmp_path / "b.mcap", messages, definitions={"lab/msg/State": ("protobuf", "\n\x07lab")})
    refuses(
        path, r"its type is defined by 'protobuf'; ros2msg and ros2idl are read", builtin_map("omnid-ros2")
    )
    path = raw_mcap(tmp_path / "c.mcap", TEAM.said(), encoding="json")
    refuses(path, r"is encoded as 'json'; only cdr, as ROS 2 writes it, is read")
    told = {bags.JOINT_STATE: ("ros2msg", "string[] name\nfloat32[] position\nfloat64[] effort\n")}
    path = raw_mcap(tmp_path / "d.mcap", TEAM.said(), definitions=told)
    refuses(path, r"the bag defines sensor_msgs/msg/JointState without float64\[\] position")


def test_broken_messages_are_counted_by_topic(tmp_path):
    messages = TEAM.said()
    number = [k for k, s in enumerate(messages) if s.topic == bags.topic(2)][5]
    broken = messages[number]
    messages[number] = bags.Said(broken.topic, broken.log_ns, broken.kind, broken.data[:-8])
    path = raw_mcap(tmp_path / "a.mcap", messages)
    refuses(
        path,
        r"topic /omnid2/joint/joint_states: message 5 is not a readable .*: it has \d+ bytes, 8 less than its",
    )


def test_metadata_of_the_recording(tmp_path):
    path = raw_mcap(tmp_path / "a.mcap", [said("/mocobot/metadata", 1, bags.text("{}")), *TEAM.said()])
    refuses(path, "/mocobot/metadata: missing key|/mocobot/metadata: .*format")
    write_bag(small_recording(rows=20), tmp_path / "b.mcap")
    two = parse_map({"robots": 2, **wrist_map()}, "test")
    refuses(tmp_path / "b.mcap", "/mocobot/metadata: robots is 3, but the bag has topics of 2", two)
    broken = bags.Said("/mocobot/metadata", 1, "std_msgs/msg/String", b"\0\1\0\0\xff\xff\xff\xff")
    path = raw_mcap(tmp_path / "c.mcap", [broken, *TEAM.said()])
    refuses(path, "/mocobot/metadata: its message is not a readable std_msgs/msg/String")
