"""Bags of every writer and layout, by built-in maps and by ones of a laboratory's own."""

from __future__ import annotations

import io
import sqlite3
import struct
import tracemalloc

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory

import bags
from bags import (
    EPOCH_NS,
    NO_SUMMARY,
    OMNID,
    UNCHUNKED,
    Team,
    joint_state,
    raw_mcap,
    rosbags_bag,
    said,
    wrist_map,
)
from estimator.errors import InputError
from joint_logs import JOINTS, motion, read, torques
from mocobot_logs.bag.read import open_bag
from mocobot_logs.formats import is_bag
from mocobot_logs.log import CHANNELS, REF, collect
from mocobot_logs.maps import builtin_map, parse_map

TEAM = Team.draw()


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("compression", ["none", "file", "message"])
@pytest.mark.parametrize("version", [8, 9])
def test_bags_of_rosbags(tmp_path, storage, compression, version):
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), storage, compression, version)
    assert is_bag(path)
    bags.assert_holds(path, TEAM)
    if compression != "message":  # nothing but metadata.yaml tells that messages are compressed
        (single,) = (entry for entry in path.iterdir() if entry.suffix != ".yaml")
        assert is_bag(single)
        bags.assert_holds(single, TEAM)


def test_files_of_mcap_ros2_support(tmp_path):
    messages = []
    for robot in range(3):
        for k in range(50):
            sec, nanosec = divmod(int(TEAM.stamps[robot, k]), 10**9)
            fields = {
                "header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "base"},
                "name": list(OMNID),
                "position": TEAM.position[robot, k].tolist(),
                "velocity": [],
                "effort": TEAM.effort[robot, k].tolist(),
            }
            messages.append((bags.topic(robot + 1), TEAM.log_ns(robot, k), bags.JOINT_STATE, fields))
    path = bags.mcap_ros2_bag(tmp_path / "lab.mcap", messages)
    bags.assert_holds(path, TEAM)
    log = collect(open_bag(path, None))
    reader = make_reader(io.BytesIO(path.read_bytes()), decoder_factories=[DecoderFactory()])
    theirs = [m.decoded_message.position[0] for m in reader.iter_decoded_messages(topics=[bags.topic(2)])]
    assert log.streams[1].values[:, 0].tolist() == theirs


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"compression": CompressionType.ZSTD},
        {"compression": CompressionType.LZ4},
        {"enable_crcs": False},
        {"repeat_channels": False, "repeat_schemas": False},
        {"use_statistics": False},
        UNCHUNKED,
        NO_SUMMARY,
        {"chunk_size": 1},  # a chunk per message
    ],
)
def test_every_kind_of_mcap_file(tmp_path, options):
    bags.assert_holds(raw_mcap(tmp_path / "a.mcap", TEAM.said(), **options), TEAM)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_bag_of_several_files(tmp_path, storage):
    """As rosbag2 splits long recordings; the oldest versions put the folder's name before each file's."""
    messages = TEAM.said()
    path = rosbags_bag(tmp_path / "bag", messages[:80], storage)
    more = rosbags_bag(tmp_path / "more", messages[80:], storage)
    suffix = {"mcap": ".mcap", "sqlite3": ".db3"}[storage]
    (more / f"more{suffix}").rename(path / f"bag_1{suffix}")
    yaml = path / "metadata.yaml"
    told = yaml.read_text()
    yaml.write_text(told.replace(f"  - bag{suffix}\n", f"  - bag/bag{suffix}\n  - bag/bag_1{suffix}\n"))
    assert yaml.read_text() != told
    bags.assert_holds(path, TEAM)


def test_big_endian(tmp_path):
    messages = [said(s.topic, s.log_ns, TEAM.message(r, k), little=False) for r, k, s in TEAM.places()]
    bags.assert_holds(raw_mcap(tmp_path / "a.mcap", messages), TEAM)


def test_several_publishers_with_a_part_of_the_joints_each(tmp_path):
    """They come onto the stamps of the first; a cubic through what moves evenly is exact."""
    drawn = Team.draw(robots=1, rows=200)
    seconds = (drawn.stamps - EPOCH_NS) * 1e-9
    position = seconds[..., None] * drawn.position[:, :1]
    team = Team(drawn.stamps, position, seconds[..., None] * drawn.effort[:, :1])
    messages = []
    for k in range(200):
        half = slice(0, 3) if k % 2 else slice(3, 6)
        message = bags.joint_state(
            team.position[0, k, half], team.effort[0, k, half], int(team.stamps[0, k]), OMNID[half]
        )
        messages.append(said(bags.topic(1), team.log_ns(0, k), message))
    stream = collect(open_bag(raw_mcap(tmp_path / "a.mcap", messages), None)).streams[0]
    rows = np.flatnonzero(np.isin(team.stamps[0], stream.stamp_ns))
    assert set(np.diff(rows)) == {2}
    assert len(rows) >= 98
    np.testing.assert_allclose(stream.values, team.wrist(0)[rows], rtol=1e-9, atol=1e-9)
    own = stream.values[:, 3:6] if rows[0] % 2 == 0 else stream.values[:, [0, 1, 2, 6, 7, 8]]
    want = team.wrist(0)[rows][:, 3:6] if rows[0] % 2 == 0 else team.wrist(0)[rows][:, [0, 1, 2, 6, 7, 8]]
    np.testing.assert_array_equal(own, want)


def test_memory_of_a_long_bag_stays_bounded(tmp_path):
    """A bag of 60 MB in chunks of 1 MiB needs a few blocks of memory, not the bag."""
    team = Team.draw(robots=1, rows=400)
    messages = team.said(frame="f" * 1000)
    many = [bags.Said(s.topic, s.log_ns + n, s.kind, s.data) for n in range(120) for s in messages]
    path = raw_mcap(tmp_path / "a.mcap", many, chunk_size=1 << 20)
    assert path.stat().st_size > 50e6
    del many
    source = open_bag(path, None)
    tracemalloc.start()
    count = sum(len(samples.stamp_ns) for _, samples in source.chunks(lambda _: None))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count == 48_000
    assert peak < 8e6


MAPS_TEAM = Team.draw()


def test_the_recorders_clock(tmp_path):
    log_map = parse_map({**wrist_map(), "time": {"clock": "log"}}, "test")
    # Without stamps, as of a driver that never set them.
    messages = [said(s.topic, s.log_ns, _unstamped(MAPS_TEAM, r, k)) for r, k, s in MAPS_TEAM.places()]
    path = raw_mcap(tmp_path / "a.mcap", messages)
    log = collect(open_bag(path, log_map))
    for robot, stream in enumerate(log.streams):
        np.testing.assert_array_equal(stream.stamp_ns, [MAPS_TEAM.log_ns(robot, k) for k in range(50)])
    without = collect(open_bag(path, None))
    for ours, theirs in zip(log.streams, without.streams, strict=True):
        np.testing.assert_array_equal(ours.stamp_ns, theirs.stamp_ns)
    assert log.notes == ()
    assert without.notes[0] == (
        f"The header stamps of topic {bags.topic(1)} are zero, so the recorder's time is taken."
    )


def _unstamped(team, robot, k):
    return bags.joint_state(team.position[robot, k], team.effort[robot, k], 0)


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
            int(MAPS_TEAM.stamps[0, k]),
            bags.joint_state(
                MAPS_TEAM.position[:, k].ravel(),
                MAPS_TEAM.effort[:, k].ravel(),
                int(MAPS_TEAM.stamps[0, k]),
                names,
            ),
        )
        for k in range(50)
    ]
    log = collect(open_bag(raw_mcap(tmp_path / "a.mcap", messages), log_map))
    assert log.robots == 3
    for robot, stream in enumerate(log.streams):
        np.testing.assert_array_equal(stream.values, MAPS_TEAM.wrist(robot))


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
        bags.assert_holds(rosbags_bag(tmp_path / storage, MAPS_TEAM.said(), storage, empty=empty), MAPS_TEAM)


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
    path = rosbags_bag(tmp_path / "bag", MAPS_TEAM.said(), "sqlite3")
    with sqlite3.connect(path / "bag.db3") as connection:
        connection.execute("DROP TABLE message_definitions")
        connection.execute("DROP TABLE schema")
    connection.close()
    bags.assert_holds(path, MAPS_TEAM)
    with sqlite3.connect(path / "bag.db3") as connection:
        connection.execute("UPDATE topics SET type = 'lab_msgs/msg/JointState'")
    connection.close()
    with pytest.raises(
        InputError, match=r"holds lab_msgs/msg/JointState, a type that the bag does not define"
    ):
        open_bag(path, builtin_map("omnid-ros2"))


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


TIME = np.arange(1500) / 500.0


def test_joint_states_of_a_bag(tmp_path) -> None:
    """As a controller publishes them: names in another order in every message, another robot's joints between."""
    q, dq = motion(TIME)
    rng = np.random.default_rng(4)
    messages = []
    for k, time in enumerate(TIME):
        order = rng.permutation(4)
        names = np.array([*JOINTS, "gripper"])[order]
        stamp = 1_700_000_000_000_000_000 + round(time * 1e9)
        at = [np.append(values[k], 9.0)[order] for values in (q, dq, torques(TIME))]
        messages.append(
            said("/joint_states", stamp + 77, joint_state(at[0], at[2], stamp, names, velocity=at[1]))
        )
    text = """
joints = ["hip", "knee", "lift"]
[defaults]
topic = "/joint_states"
joint = "{joint}"
[channels]
q = { field = "position", unit = "rad" }
dq = { field = "velocity", unit = "rad/s" }
torque = { field = "effort", unit = "Nm" }
[joint.lift.channels]
q.unit = "m"
dq.unit = "m/s"
torque.unit = "N"
"""
    (log,) = read(rosbags_bag(tmp_path / "bag", messages), text)
    assert log.rate_hz == 500.0
    np.testing.assert_array_equal(log.q, q)
    np.testing.assert_array_equal(log.dq, dq)
    np.testing.assert_array_equal(log.torque, torques(TIME))
