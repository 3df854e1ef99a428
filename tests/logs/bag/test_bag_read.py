"""Bags that other libraries wrote, read back equal to what was put in and to what the libraries read."""

import io
import sqlite3
import tracemalloc

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

import bags
from bags import NO_SUMMARY, OMNID, UNCHUNKED, Team, raw_mcap, rosbags_bag, said
from estimator.errors import InputError
from mocobot_logs.bag.read import open_bag
from mocobot_logs.formats import is_bag
from mocobot_logs.log import collect

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


def test_chunks_that_rosbags_compresses(tmp_path):
    bags.assert_holds(rosbags_bag(tmp_path / "bag", TEAM.said(), "mcap", "storage"), TEAM)


def test_the_library_reads_the_same(tmp_path):
    path = rosbags_bag(tmp_path / "bag", TEAM.said(frame="wrist frame"), "sqlite3")
    log = collect(open_bag(path, None))
    found = {name: [] for name in map(bags.topic, (1, 2, 3))}
    with AnyReader([path]) as reader:
        for connection, log_ns, data in reader.messages():
            m = reader.deserialize(data, connection.msgtype)
            stamp = m.header.stamp.sec * 10**9 + m.header.stamp.nanosec
            found[connection.topic].append((stamp, log_ns, m.position[m.name.index("gimbal_y")], m.effort[2]))
    for stream, rows in zip(log.streams, found.values(), strict=True):
        ours = zip(stream.stamp_ns, stream.log_ns, stream.values[:, 4], stream.values[:, 8], strict=True)
        assert [tuple(map(float, row)) for row in ours] == [tuple(map(float, row)) for row in rows]


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


def test_loose_messages_longer_than_a_window(tmp_path):
    """Outside of chunks, records cross the ends of the windows in which a file is read."""
    team = Team.draw(robots=1, rows=300)
    big = said("/image", team.log_ns(0, 7), bags.text("p" * 300_000))
    messages = sorted([*team.said(frame="f" * 777), big], key=lambda s: s.log_ns)
    bags.assert_holds(raw_mcap(tmp_path / "a.mcap", messages, **UNCHUNKED), team)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_large_messages_of_other_topics_do_not_matter(tmp_path, storage):
    huge = said("/points", int(TEAM.stamps[0, 0]), bags.text("p" * (17 << 20)))
    bags.assert_holds(rosbags_bag(tmp_path / "bag", [huge, *TEAM.said()], storage), TEAM)
    # The one topic that is read at once, since it says what the recording is.
    metadata = bags.Said("/mocobot/metadata", 1, huge.kind, huge.data)
    path = rosbags_bag(tmp_path / "bag2", [metadata, *TEAM.said()], storage)
    with pytest.raises(
        InputError, match=r"a message of (17\.0|more than 16) MiB.*; joint data are read from"
    ):
        open_bag(path, None)


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


def test_an_index_that_lacks_chunks(tmp_path):
    """What holds the messages counts, not what the index says of it."""
    content = bytearray(raw_mcap(tmp_path / "whole.mcap", TEAM.said()).read_bytes())
    at, hidden = int.from_bytes(content[-28:-20], "little"), 0
    while at < len(content) - 37:
        if content[at] == Opcode.CHUNK_INDEX and hidden < 3:
            content[at] = 0x93  # a private record
            hidden += 1
        at += 9 + int.from_bytes(content[at + 1 : at + 9], "little")
    assert hidden == 3
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    bags.assert_holds(path, TEAM)


def test_topics_that_are_not_of_ros_do_not_matter(tmp_path):
    foreign = bags.Said("/log", int(TEAM.stamps[0, 0]), "foxglove.Log", b"\x0a\x01x")
    definitions = {"foxglove.Log": ("protobuf", "\n\x07lab")}
    path = raw_mcap(tmp_path / "a.mcap", [foreign, *TEAM.said()], definitions=definitions, profile="")
    bags.assert_holds(path, TEAM)


def test_big_endian(tmp_path):
    messages = [said(s.topic, s.log_ns, TEAM.message(r, k), little=False) for r, k, s in TEAM.places()]
    bags.assert_holds(raw_mcap(tmp_path / "a.mcap", messages), TEAM)


def test_layouts_may_change_within_a_topic(tmp_path):
    """Frames of changing length, joints in changing order, velocities or none, both byte orders."""
    rng = np.random.default_rng(4)
    messages = []
    for robot, k, s in TEAM.places():
        order = rng.permutation(6)
        message = bags.joint_state(
            TEAM.position[robot, k, order],
            TEAM.effort[robot, k, order],
            int(TEAM.stamps[robot, k]),
            names=[OMNID[i] for i in order],
            velocity=rng.normal(size=6) if rng.random() < 0.5 else (),
            frame="f" * int(rng.integers(0, 12)),
        )
        messages.append(said(s.topic, s.log_ns, message, little=bool(rng.integers(2))))
    bags.assert_holds(raw_mcap(tmp_path / "a.mcap", messages, chunk_size=1 << 20), TEAM)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_topic_that_is_listed_twice(tmp_path, storage):
    """Recorders list a topic once for each quality of service that its publishers offer."""
    messages = TEAM.said()
    if storage == "mcap":
        path = tmp_path / "a.mcap"
        with path.open("wb") as file:
            writer = McapWriter(file)
            writer.start(profile="ros2")
            schema = writer.register_schema(
                bags.JOINT_STATE, "ros2msg", bags.definition(bags.JOINT_STATE).encode()
            )
            channels = {
                t: [writer.register_channel(t, "cdr", schema) for _ in range(2)]
                for t in map(bags.topic, (1, 2, 3))
            }
            for k, s in enumerate(messages):
                writer.add_message(channels[s.topic][k % 2], s.log_ns, s.data, s.log_ns)
            writer.finish()
    else:
        path = rosbags_bag(tmp_path / "bag", messages, storage) / "bag.db3"
        connection = sqlite3.connect(path)
        connection.execute(
            "INSERT INTO topics SELECT id + 10, name, type, serialization_format, '', type_description_hash FROM topics"
        )
        connection.execute("UPDATE messages SET topic_id = topic_id + 10 WHERE id % 2")
        connection.commit()
        connection.close()
    bags.assert_holds(path, TEAM)


def test_several_publishers_with_a_part_of_the_joints_each(tmp_path):
    """Joints that single messages lack are NaN there."""
    team = Team.draw(robots=1, rows=20)
    messages = []
    for k in range(20):
        half = slice(0, 3) if k % 2 else slice(3, 6)
        message = bags.joint_state(
            team.position[0, k, half], team.effort[0, k, half], int(team.stamps[0, k]), OMNID[half]
        )
        messages.append(said(bags.topic(1), team.log_ns(0, k), message))
    stream = collect(open_bag(raw_mcap(tmp_path / "a.mcap", messages), None)).streams[0]
    want = team.wrist(0)
    want[1::2, 3:6] = np.nan
    want[::2, [0, 1, 2, 6, 7, 8]] = np.nan
    np.testing.assert_array_equal(stream.values, want)


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
