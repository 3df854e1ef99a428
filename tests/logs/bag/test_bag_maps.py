"""Bags by maps: clocks, units, joints on shared topics, channels from several topics, types of one's own."""

import sqlite3
import struct

import numpy as np
import pytest

import bags
from bags import EPOCH_NS, OMNID, Team, raw_mcap, rosbags_bag, said, wrist_map
from estimator.errors import InputError
from mocobot_logs.bag.read import open_bag
from mocobot_logs.log import CHANNELS, REF, collect
from mocobot_logs.maps import builtin_map, parse_map

TEAM = Team.draw()


def test_the_recorders_clock(tmp_path):
    log_map = parse_map({**wrist_map(), "time": {"clock": "log"}}, "test")
    # Without stamps, as of a driver that never set them.
    messages = [said(s.topic, s.log_ns, _unstamped(TEAM, r, k)) for r, k, s in TEAM.places()]
    path = raw_mcap(tmp_path / "a.mcap", messages)
    log = collect(open_bag(path, log_map))
    for robot, stream in enumerate(log.streams):
        np.testing.assert_array_equal(stream.stamp_ns, [TEAM.log_ns(robot, k) for k in range(50)])
    with pytest.raises(InputError, match="the header stamp is zero in every message; with clock = 'log'"):
        collect(open_bag(path, None))


def _unstamped(team, robot, k):
    return bags.joint_state(team.position[robot, k], team.effort[robot, k], 0)


def test_units_signs_and_overrides(tmp_path):
    changed = {
        **wrist_map()["channels"],
        "h_z": {"joint": "z", "field": "position", "unit": "mm", "offset": 250.0},
    }
    override = {"2": {"channels": {"theta_y": {"sign": -1, "unit": "deg"}}}}
    log_map = parse_map({**wrist_map(), "channels": changed, "robot": override}, "test")
    log = collect(open_bag(raw_mcap(tmp_path / "a.mcap", TEAM.said()), log_map))
    np.testing.assert_allclose(log.streams[0].values[:, 2], (TEAM.position[0, :, 2] + 250) / 1000, rtol=1e-15)
    np.testing.assert_allclose(log.streams[1].values[:, 4], -np.radians(TEAM.position[1, :, 4]), rtol=1e-15)
    np.testing.assert_array_equal(log.streams[0].values[:, 4], TEAM.position[0, :, 4])


def test_all_robots_on_one_topic(tmp_path):
    """Robots that share a topic are counted by the names of their joints."""
    channels = {
        key: {**table, "joint": f"omnid{{robot}}_{table['joint']}"}
        for key, table in wrist_map()["channels"].items()
    }
    log_map = parse_map({**wrist_map(), "defaults": {"topic": "/joint_states"}, "channels": channels}, "test")
    names = [f"omnid{robot}_{name}" for robot in (1, 2, 3) for name in OMNID]
    messages = [
        said(
            "/joint_states",
            int(TEAM.stamps[0, k]),
            bags.joint_state(
                TEAM.position[:, k].ravel(), TEAM.effort[:, k].ravel(), int(TEAM.stamps[0, k]), names
            ),
        )
        for k in range(50)
    ]
    log = collect(open_bag(raw_mcap(tmp_path / "a.mcap", messages), log_map))
    assert log.robots == 3
    for robot, stream in enumerate(log.streams):
        np.testing.assert_array_equal(stream.values, TEAM.wrist(robot))


def test_robots_with_some_channels_on_a_shared_topic(tmp_path):
    """A topic of all robots counts nobody."""
    log_map = wrist_map()
    log_map["channels"] |= {
        f"h_{a}": {"topic": "/team", "field": f"data[{k}]", "unit": "m"} for k, a in enumerate("xyz")
    }
    del log_map["channels"]["h_x"]["topic"], log_map["channels"]["h_x"]["field"]
    log_map["channels"]["h_x"] |= {"joint": "x", "field": "position"}
    layout = bags.TYPES.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    array = bags.TYPES.types["std_msgs/msg/Float64MultiArray"](layout=layout, data=np.zeros(3))
    path = raw_mcap(tmp_path / "a.mcap", [said("/team", 1, array), *TEAM.said()])
    with pytest.raises(
        InputError, match="h_y of robot 1 and h_y of robot 2 are the same number of topic /team"
    ):
        open_bag(path, parse_map(log_map, "test"))


@pytest.mark.parametrize("chunk_size", [1, 4096, 1 << 20])
def test_channels_from_several_topics(tmp_path, chunk_size):
    """Other messages by dotted path; messages of one robot with one stamp are one sample."""
    rng = np.random.default_rng(5)
    team = Team.draw(robots=2)
    command = rng.normal(size=(2, 50, 3))
    messages = team.said()
    for robot in range(2):
        for k in range(50):
            if k == 20:
                continue  # a command that was not sent
            log_ns = team.log_ns(robot, k) + int(rng.integers(-4_000_000, 4_000_000))
            message = bags.point(command[robot, k], int(team.stamps[robot, k]))
            messages.append(said(f"/omnid{robot + 1}/wrist/command", log_ns, message))
    messages.sort(key=lambda s: s.log_ns)
    log = collect(open_bag(raw_mcap(tmp_path / "a.mcap", messages, chunk_size=chunk_size), None))
    assert log.channels == CHANNELS["wrist"] + REF
    sent = np.arange(50) != 20
    for robot, stream in enumerate(log.streams):
        np.testing.assert_array_equal(stream.stamp_ns, team.stamps[robot])
        np.testing.assert_array_equal(stream.values[:, :9], team.wrist(robot))
        np.testing.assert_array_equal(stream.values[sent, 9:], command[robot][sent])
        assert np.isfinite(stream.values).all()  # interpolated


def test_commands_that_nobody_sent_are_left_out(tmp_path):
    """A recorder lists every topic it listened to."""
    for storage in ("mcap", "sqlite3"):
        empty = [(f"/omnid{robot}/wrist/command", bags.POINT) for robot in (1, 2, 3)]
        bags.assert_holds(rosbags_bag(tmp_path / storage, TEAM.said(), storage, empty=empty), TEAM)


def test_arrays_by_index(tmp_path):
    """As microcontrollers publish them: plain arrays without a header."""
    rng = np.random.default_rng(6)
    data = rng.integers(-100_000, 100_000, (30, 9))
    log_map = {
        "version": 1,
        "level": "joint",
        "time": {"clock": "log"},
        "defaults": {"topic": "/omnid{robot}/raw"},
        "channels": {
            name: {"field": f"data[{k}]", "unit": "mNm" if k > 5 else "rad"}
            for k, name in enumerate(CHANNELS["joint"])
        },
    }
    layout = bags.TYPES.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    kind = bags.TYPES.types["std_msgs/msg/Int32MultiArray"]
    messages = [
        said("/omnid1/raw", EPOCH_NS + k, kind(layout=layout, data=data[k].astype(np.int32)))
        for k in range(30)
    ]
    path = raw_mcap(tmp_path / "a.mcap", messages)
    stream = collect(open_bag(path, parse_map(log_map, "test"))).streams[0]
    np.testing.assert_array_equal(stream.values[:, :6], data[:, :6])
    np.testing.assert_array_equal(stream.values[:, 6:], data[:, 6:] * 1e-3)
    log_map["time"] = {"clock": "header"}
    with pytest.raises(InputError, match="Int32MultiArray has no header and so no stamp of its own"):
        open_bag(path, parse_map(log_map, "test"))


def test_types_without_definitions(tmp_path):
    """Bags of old recorders do not define their types; those of ROS 2 are known, the others are not."""
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), "sqlite3")
    with sqlite3.connect(path / "bag.db3") as connection:
        connection.execute("DROP TABLE message_definitions")
        connection.execute("DROP TABLE schema")
    connection.close()
    bags.assert_holds(path, TEAM)
    with sqlite3.connect(path / "bag.db3") as connection:
        connection.execute("UPDATE topics SET type = 'lab_msgs/msg/JointState'")
    connection.close()
    with pytest.raises(
        InputError, match=r"holds lab_msgs/msg/JointState, a type that the bag does not define"
    ):
        open_bag(path, builtin_map("omnid-ros2"))


def test_names_of_types_without_msg(tmp_path):
    """Some writers leave it out."""
    messages = [bags.Said(s.topic, s.log_ns, "sensor_msgs/JointState", s.data) for s in TEAM.said()]
    told = {"sensor_msgs/JointState": ("ros2msg", bags.definition(bags.JOINT_STATE))}
    bags.assert_holds(raw_mcap(tmp_path / "a.mcap", messages, definitions=told), TEAM)


def test_types_of_ones_own(tmp_path):
    """A type of a lab, defined in the bag only."""
    told = (
        "lab/Arm[2] arms\nbool up\nfloat32 gain\n" + "=" * 80 + "\nMSG: lab/Arm\nstring name\nfloat64[3] q\n"
    )
    log_map = {
        "version": 1,
        "level": "joint",
        "time": {"clock": "log"},
        "defaults": {"topic": "/team", "unit": "rad"},
        "channels": {
            **{f"phi{k}": {"field": f"arms[{{robot0}}].q[{k - 1}]"} for k in (1, 2, 3)},
            **{
                f"theta_{a}": {"field": f, "unit": "rad"}
                for a, f in zip("zyx", ("gain", "up", "gain2"), strict=True)
            },
            **{f"tau{k}": {"field": f"arms[{{robot0}}].q[{k - 1}]", "unit": "Nm"} for k in (1, 2, 3)},
        },
    }
    told = told.replace("float32 gain\n", "float32 gain\nuint8 gain2\n")
    # name: 4 + 2 bytes, q at 8 and, after the second name at 32, at 40; up at 64, gain at 68, gain2 at 72
    body = struct.pack("<I2sxx3dI2sxx3d?xxxfB", 2, b"a\0", 1, 2, 3, 2, b"b\0", 4, 5, 6, True, 0.5, 7)
    message = bags.Said("/team", 1, "lab/msg/Team", b"\0\1\0\0" + body)
    path = raw_mcap(tmp_path / "a.mcap", [message], definitions={"lab/msg/Team": ("ros2msg", told)})
    with pytest.raises(
        InputError, match="map test: missing key 'robots'; robots that have neither topics nor joints"
    ):
        open_bag(path, parse_map(log_map, "test"))
    log_map["robots"] = 1
    with pytest.raises(InputError, match="are the same number of topic /team"):
        open_bag(path, parse_map(log_map, "test"))
    for k in (1, 2, 3):
        log_map["channels"][f"tau{k}"]["field"] = f"arms[1].q[{k - 1}]"
        log_map["channels"][f"phi{k}"]["field"] = f"arms[0].q[{k - 1}]"
    (stream,) = collect(open_bag(path, parse_map(log_map, "test"))).streams
    assert stream.values.tolist() == [[1, 2, 3, 0.5, 1, 7, 4, 5, 6]]
