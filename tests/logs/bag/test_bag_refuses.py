"""Bags that cannot be used, by files, maps, damage or bombs: one sentence each, and bounded memory."""

from __future__ import annotations

import os
import struct
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode

import bags
from bags import EPOCH_NS, Team, assert_holds, raw_mcap, record, rosbags_bag, said, wrist_map
from estimator import inputs
from estimator.errors import InputError
from estimator.inputs import set_max_unpacked
from mocobot_logs.bag.read import open_bag
from mocobot_logs.bag.write import write_bag
from mocobot_logs.formats import is_bag
from mocobot_logs.log import collect
from mocobot_logs.maps import builtin_map, parse_map
from recordings import small_recording

TEAM = Team.draw(rows=20)


def refuses(path, match, log_map=None):
    """An InputError that names the file, in time and in memory."""
    begin = time.perf_counter()
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=match) as caught:
            collect(open_bag(path, log_map))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    message = str(caught.value)
    assert message.startswith(str(path)[:70]) or message.startswith(repr(str(path))[:70])
    assert message.isprintable()
    assert peak < 700e6
    assert time.perf_counter() - begin < 10.0


def test_paths_that_are_no_bags(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "notes.txt").write_text("notes")
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "notes.db3").write_text("notes")
    (tmp_path / "old.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    os.mkfifo(tmp_path / "pipe.mcap")
    refuses(tmp_path / "none", "there is no such file or folder")
    refuses(tmp_path / ("n" * 300), "not a usable file name|no such file")
    refuses(tmp_path / "empty", r"is a folder without a bag \(metadata.yaml and .mcap or .db3 files\)")
    refuses(tmp_path / "notes.txt", "is neither an MCAP nor an SQLite file")
    refuses(tmp_path / "empty.mcap", "empty.mcap: is empty")
    refuses(tmp_path / "notes.db3", "is neither an MCAP nor an SQLite file")
    refuses(tmp_path / "old.bag", "a bag of ROS 1; `rosbags-convert` makes a ROS 2 bag of it")
    refuses(tmp_path / "pipe.mcap", "is not a regular file")
    meant = {"empty": False, "notes.txt": False, "empty.mcap": True, "notes.db3": True, "old.bag": True}
    for name, is_meant in {**meant, "pipe.mcap": False, "none": False, "n" * 300: False}.items():
        assert is_bag(tmp_path / name) == is_meant, name


def metadata_case(tmp_path, change, match):
    path = rosbags_bag(tmp_path / "bag", TEAM.said())
    yaml = path / "metadata.yaml"
    told = yaml.read_text()
    changed = change(told) if callable(change) else change
    assert changed != told
    yaml.write_bytes(changed if isinstance(changed, bytes) else changed.encode())
    refuses(path, match)


LISTED = "  relative_file_paths:\n  - bag.mcap\n"
DEEP = "[" * 20_000
LAUGHS = "a: &a [x,x,x]\n" + "".join(
    f"{b}: &{b} [{','.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefghij", "bcdefghijk", strict=True)
)
MERGES = "a: &a {x: 1}\n" + "".join(
    f"{b}: &{b}\n  <<: [{','.join([f'*{a}'] * 9)}]\n" for a, b in zip("abcdefghij", "bcdefghijk", strict=True)
)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ("", r"has no table 'rosbag2_bagfile_information'"),
        ("[1, 2]", r"has no table 'rosbag2_bagfile_information'"),
        ("rosbag2_bagfile_information: 3", r"has no table 'rosbag2_bagfile_information'"),
        ("a: [", r"metadata.yaml: not readable YAML"),
        (b"\0\xff\xfe" * 100, r"metadata.yaml: not readable YAML"),
        (DEEP, r"holds YAML beyond plain values"),
        (LAUGHS, r"it has anchors"),
        (MERGES, r"holds YAML beyond plain values"),
        ("a: !!python/object/apply:os.system [ls]", r"holds YAML beyond plain values"),
        ("#" * 2_000_000, r"is larger than 1 MiB"),
        (lambda s: s.replace("version: 9", "version: 77"), r"version is 77; bags of versions 1 to 9 are read"),
        (lambda s: s.replace("version: 9", "version: nine"), r"version is 'nine'"),
        (lambda s: s.replace("identifier: mcap", "identifier: rocks"), r"is 'rocks'; it must be one of mcap, sq"),
        (lambda s: s.replace("mode: ''", "mode: cube"), r"compression_mode is 'cube'; it must be one of none, file"),
        (lambda s: s.replace("mode: ''", "mode: FILE"), r"compression_format is ''; it must be one of zstd"),
        (lambda s: s.replace(LISTED, ""), r"relative_file_paths is None; it must list the bag's files"),
        (lambda s: s.replace(LISTED, "  relative_file_paths: []\n"), r"relative_file_paths is \[\]; it must list"),
        (lambda s: s.replace(LISTED, "  relative_file_paths: [3]\n"), r"relative_file_paths is \[3\]; it must list"),
        (lambda s: s.replace(LISTED, LISTED + "  - bag.mcap\n"), r"each must be another file in the folder"),
        (lambda s: s.replace(LISTED, "  relative_file_paths: ['..']\n"), r"each must be another file in the folder"),
        (lambda s: s.replace(LISTED, LISTED + "  - bag_1.mcap\n"), r"bag_1.mcap: there is no such file, though"),
        (lambda s: s.replace(LISTED, LISTED + "  - /etc/passwd\n"), r"bag/passwd: there is no such file, though"),
        (lambda s: s.replace(LISTED, LISTED + "  - metadata.yaml\n"), r"metadata.yaml: is neither an MCAP"),
    ],
    ids=range(23),
)  # fmt: skip
def test_metadata_that_cannot_be_used(tmp_path, change, match):
    metadata_case(tmp_path, change, match)


def test_no_metadata(tmp_path):
    path = rosbags_bag(tmp_path / "bag", TEAM.said())
    (path / "metadata.yaml").unlink()
    assert is_bag(path)
    refuses(
        path,
        r"bag: has no metadata.yaml; `ros2 bag reindex` writes it, or name a single file such as .*bag.mcap",
    )
    (path / "metadata.yaml").mkdir()
    refuses(path, r"bag: has no metadata.yaml")


def test_mcap_files_that_are_cut_off(tmp_path):
    content = raw_mcap(tmp_path / "whole.mcap", TEAM.said()).read_bytes()
    path = tmp_path / "a.mcap"
    for length in [
        *range(1, 40, 3),
        len(content) // 2,
        len(content) - 40,
        len(content) - 9,
        len(content) - 1,
    ]:
        path.write_bytes(content[:length])
        refuses(
            path,
            "cut off, the MCAP file has no end; .*`mcap recover` saves" if length >= 8 else "neither an MCAP",
        )


def test_sqlite_files_that_are_cut_off(tmp_path):
    content = (rosbags_bag(tmp_path / "bag", TEAM.said(), "sqlite3") / "bag.db3").read_bytes()
    path = tmp_path / "a.db3"
    for length in [16, 50, 99, 100, 4096, len(content) - 4096, len(content) - 1]:
        path.write_bytes(content[:length])
        refuses(path, rf"cut off, the SQLite file has {length} of \d+ bytes")


def test_a_recording_that_was_not_closed(tmp_path):
    """A crashed recorder leaves what it wrote last beside the file."""
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), "sqlite3") / "bag.db3"
    for suffix in ("-wal", "-journal"):
        side = path.with_name(path.name + suffix)
        side.write_bytes(b"pages")
        refuses(
            path,
            rf"its recording was not closed, bag.db3{suffix} holds a part of it; `sqlite3 bag.db3 'PRAGMA",
        )
        side.write_bytes(b"")
        assert collect(open_bag(path)).robots == 3
        side.unlink()
    assert [entry.name for entry in path.parent.iterdir() if entry.suffix != ".yaml"] == ["bag.db3"]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_bombs_in_compressed_files_and_messages(tmp_path, storage):
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), storage, "file")
    (packed,) = (entry for entry in path.iterdir() if entry.suffix == ".zstd")
    content = zstandard.ZstdDecompressor().decompressobj().decompress(packed.read_bytes())
    packed.write_bytes(zstandard.compress(bytes(1 << 28)))
    refuses(packed, "what it unpacks to is neither an MCAP nor an SQLite file")
    packed.write_bytes(zstandard.compress(content + bytes((1 << 28) + 1)))
    refuses(packed, "unpacks to at least 0.25.* GiB; the limit is 0.25 GiB, which --max-unpacked GIB changes")
    packed.write_bytes(zstandard.compress(content)[:-1000])
    refuses(packed, "cut off|unpacks to nothing|damaged")
    packed.write_bytes(zstandard.compress(b""))
    refuses(packed, "unpacks to nothing, or is cut off")
    packed.write_bytes(zstandard.compress(content)[:40] + bytes(100))
    refuses(packed, "damaged|unpacks to nothing")
    bomb = zstandard.compress(bytes(1 << 25))
    messages = [bags.Said(s.topic, s.log_ns, s.kind, bomb) for s in TEAM.said()]
    path = rosbags_bag(tmp_path / "more", messages, storage)
    yaml = path / "metadata.yaml"
    told = yaml.read_text()
    yaml.write_text(
        told.replace("compression_mode: ''", "compression_mode: MESSAGE").replace(
            "format: ''", "format: zstd"
        )
    )
    assert yaml.read_text().count("zstd") == 1
    refuses(path, "damaged, a compressed message unpacks to more than 16 MiB")
    path = rosbags_bag(tmp_path / "most", TEAM.said(), storage)
    (path / "metadata.yaml").write_text(yaml.read_text().replace("more", "most"))
    refuses(path, "damaged, a compressed message does not unpack")


def test_temporary_copies_go(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))
    (tmp_path / "tmp").mkdir()
    path = rosbags_bag(tmp_path / "bag", TEAM.said(), "sqlite3", "file")
    source = open_bag(path)
    assert len(list((tmp_path / "tmp").iterdir())) == 1
    collect(source)
    del source
    assert not list((tmp_path / "tmp").iterdir())
    (tmp_path / "tmp").rmdir()
    refuses(path, "cannot be unpacked, there is no temporary folder")


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


MAGIC = b"\x89MCAP0\r\n"


def mcap_of(*records, end=True):
    tail = record(Opcode.DATA_END, bytes(4)) + record(Opcode.FOOTER, bytes(20)) if end else b""
    head = record(Opcode.HEADER, struct.pack("<I4sI", 4, b"ros2", 0))
    return MAGIC + head + b"".join(records) + tail + MAGIC


def text(value: bytes):
    return struct.pack("<I", len(value)) + value


SCHEMA = record(
    Opcode.SCHEMA,
    struct.pack("<H", 1)
    + text(bags.JOINT_STATE.encode())
    + text(b"ros2msg")
    + text(bags.definition(bags.JOINT_STATE).encode()),
)


def channel(number=1, schema=1, topic=b"/omnid1/joint/joint_states", encoding=b"cdr"):
    return record(
        Opcode.CHANNEL, struct.pack("<HH", number, schema) + text(topic) + text(encoding) + text(b"")
    )


def message(data=None, number=1, log=EPOCH_NS, claim=None):
    data = bags.cdr(TEAM.message(0, 0)) if data is None else data
    content = struct.pack("<HIQQ", number, 0, log, log) + data
    return record(Opcode.MESSAGE, content, claim)


def chunk(content, compression=b"", size=None, crc=0, stored=None):
    held = stored if stored is not None else content
    head = struct.pack("<QQQI", 0, 0, len(content) if size is None else size, crc)
    return record(Opcode.CHUNK, head + text(compression) + struct.pack("<Q", len(held)) + held)


GOOD = SCHEMA + channel() + message()


def test_files_made_by_hand_are_read(tmp_path):
    """So that the ones below are refused for what is wrong with them."""
    path = tmp_path / "a.mcap"
    private = record(0x93, b"whatever")
    for records in ((GOOD,), (chunk(GOOD),), (private, chunk(private + GOOD + private), private)):
        path.write_bytes(mcap_of(*records))
        assert collect(open_bag(path)).streams[0].values.tolist() == TEAM.wrist(0)[:1].tolist()


def test_a_bomb_in_a_chunk(tmp_path):
    """A gigabyte of zeros in 100 kB, told and not told; and a chunk that is as large as one may be."""
    zeros = zstandard.ZstdCompressor().compress(bytes(1 << 28))
    stream = zstandard.ZstdCompressor(write_content_size=False).compressobj()
    untold = b"".join(stream.compress(bytes(1 << 24)) for _ in range(64)) + stream.flush()
    path = tmp_path / "a.mcap"
    path.write_bytes(mcap_of(chunk(GOOD, b"zstd", size=1 << 30, stored=untold)))
    refuses(path, "claims 1073741824 bytes; chunks of at most 256 MiB are read")
    path.write_bytes(mcap_of(chunk(GOOD, b"zstd", size=1000, stored=untold)))
    refuses(path, "claims 1000 bytes unpacked, but holds more")
    path.write_bytes(mcap_of(chunk(GOOD, b"zstd", size=1 << 28, stored=zeros)))
    refuses(path, "a record of kind 0 and 0 bytes, which cannot be")


UNPACKED_TEAM = Team.draw(rows=60)
MEGABYTE = "x" * 1_000_000


@pytest.fixture
def _little_is_free(monkeypatch: pytest.MonkeyPatch):
    """What is free is lowered, so that tests need no gigabytes."""
    monkeypatch.setattr(inputs, "FREE_BYTES", 50 << 20)
    yield
    set_max_unpacked(None)


@pytest.mark.usefixtures("_little_is_free")
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_messages_that_are_compressed_one_by_one(tmp_path: Path, storage: str) -> None:
    """180 MB in some 100 kB."""
    path = rosbags_bag(tmp_path / "bag", UNPACKED_TEAM.said(frame=MEGABYTE), storage, "message")
    refuses(
        path, r"unpacks to at least 0\.0\d+ GiB; the limit is 0\.04883 GiB, which --max-unpacked GIB changes"
    )
    set_max_unpacked(0.25)
    tracemalloc.start()
    assert_holds(path, UNPACKED_TEAM)
    assert tracemalloc.get_traced_memory()[1] < 40e6  # all of them at once: 180 MB
    tracemalloc.stop()


@pytest.mark.usefixtures("_little_is_free")
def test_several_files_have_one_limit(tmp_path: Path) -> None:
    """Each would pass alone."""
    said = UNPACKED_TEAM.said(frame=MEGABYTE)
    path = rosbags_bag(tmp_path / "bag", said[:40], "mcap", "file")
    other = rosbags_bag(tmp_path / "other", said[40:80], "mcap", "file")
    assert_read = "unpacks to at least 0.0"
    (first,) = path.glob("*.zstd")
    (second,) = other.glob("*.zstd")
    second.rename(path / "second.mcap.zstd")
    yaml = path / "metadata.yaml"
    yaml.write_text(
        yaml.read_text().replace(f"- {first.name}\n  ros", f"- {first.name}\n  - second.mcap.zstd\n  ros")
    )
    assert "second" in yaml.read_text()
    refuses(path, assert_read)
