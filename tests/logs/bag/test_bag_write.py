"""Recordings as bags: read back by other people's libraries, and by mocobot bit by bit."""

import dataclasses
import json
import os
import resource
import signal
import sqlite3

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader
from ruamel.yaml import YAML

from estimator.arm.delta import forward_kinematics
from estimator.errors import InputError
from estimator.files import LIST, holds
from estimator.recording.model import Recording
from mocobot_logs.bag.read import METADATA_TOPIC, open_bag
from mocobot_logs.bag.write import write_bag
from mocobot_logs.log import CHANNELS, REF, collect
from mocobot_logs.maps import builtin_map
from mocobot_logs.resample import resample
from omnid_design import DESIGN
from recordings import metadata, small_recording

STORAGES = ["mcap", "sqlite3"]
SUFFIX = {"mcap": ".mcap", "sqlite3": ".db3"}


def joint_channels(recording, robot):
    arrays = [recording.phi, recording.theta, recording.tau]
    arrays += [] if recording.ref is None else [recording.ref]
    return np.hstack([array[:, robot] for array in arrays])


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("ref", [True, False])
@pytest.mark.parametrize("single", [True, False])
def test_joint_level_comes_back_bit_by_bit(tmp_path, storage, ref, single):
    recording = small_recording(ref=ref)
    path = tmp_path / ("lab" + (SUFFIX[storage] if single else ""))
    written = []
    write_bag(recording, path, storage=storage, advance=written.append)
    assert sum(written) == len(recording.time)
    source = open_bag(path)
    log = collect(source)
    assert (log.level, log.robots, log.metadata) == ("joint", 3, recording.metadata)
    assert log.channels == CHANNELS["joint"] + (REF if ref else ())
    for robot, stream in enumerate(log.streams):
        assert stream.values.tobytes() == joint_channels(recording, robot).tobytes()
        np.testing.assert_array_equal(stream.stamp_ns, np.rint(recording.time * 1e9).astype(int))
        np.testing.assert_array_equal(stream.log_ns, stream.stamp_ns)
    for robot, values in enumerate(resample(source).values):
        assert values.tobytes() == joint_channels(recording, robot).tobytes()
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("storage", STORAGES)
def test_wrist_level(tmp_path, storage):
    """Positions by forward kinematics, forces by virtual work: tau . dphi = force . dh."""
    recording = small_recording()
    write_bag(recording, tmp_path / "bag", level="wrist", storage=storage)
    log = collect(open_bag(tmp_path / "bag"))
    assert log.level == "wrist"
    assert log.channels == CHANNELS["wrist"] + REF
    assert log.metadata == dataclasses.replace(recording.metadata, level="wrist")
    step = 1e-6
    for robot, stream in enumerate(log.streams):
        phi = recording.phi[:, robot]
        np.testing.assert_allclose(stream.values[:, :3], forward_kinematics(phi, DESIGN), atol=1e-15)
        np.testing.assert_array_equal(stream.values[:, 3:6], recording.theta[:, robot])
        np.testing.assert_array_equal(stream.values[:, 9:], recording.ref[:, robot])
        for leg in range(3):
            d = step * np.eye(3)[leg]
            dh = (forward_kinematics(phi + d, DESIGN) - forward_kinematics(phi - d, DESIGN)) / (2 * step)
            work = np.sum(stream.values[:, 6:9] * dh, axis=1)
            np.testing.assert_allclose(work, recording.tau[:, robot, leg], atol=1e-7)


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize(("level", "arm"), [("joint", ["phi1", "phi2", "phi3"]), ("wrist", ["x", "y", "z"])])
def test_rosbags_reads_them(tmp_path, storage, level, arm):
    """With nothing but what is in the bag: definitions, hashes of types, quality of service, counts and times."""
    recording = small_recording(rows=40)
    path = tmp_path / "bag"
    write_bag(recording, path, level=level, storage=storage)
    own = {
        name: values
        for robot, stream in enumerate(collect(open_bag(path)).streams)
        for name, values in [(f"/omnid{robot + 1}", stream.values)]
    }
    count = dict.fromkeys(own, 0)
    with AnyReader([path]) as reader:  # checks the hashes of the types
        for connection, log_ns, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            robot = connection.topic[: len("/omnid1")]
            if connection.msgtype == "sensor_msgs/msg/JointState":
                k = count[robot]
                count[robot] += 1
                stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
                assert stamp == log_ns == round(recording.time[k] * 1e9)
                assert message.name == [*arm, "gimbal_z", "gimbal_y", "gimbal_x"]
                assert message.position.tolist() == own[robot][k, :6].tolist()
                assert message.effort.tolist() == [*own[robot][k, 6:9], 0.0, 0.0, 0.0]
                assert len(message.velocity) == 0
            elif connection.topic == METADATA_TOPIC:
                assert json.loads(message.data)["source"] == recording.metadata.source
            else:
                assert connection.topic == f"{robot}/wrist/command"
                assert message.header.frame_id == f"{robot[1:]}/base"
                point = [message.point.x, message.point.y, message.point.z]
                assert point == own[robot][count[robot] - 1, 9:].tolist()
    assert set(count.values()) == {40}
    with Reader(path) as reader:
        assert reader.message_count == 3 * 2 * 40 + 1
        assert (reader.start_time, reader.end_time) == (0, 390_000_001)
        (latched,) = [c for c in reader.connections if c.topic == METADATA_TOPIC]
        assert latched.ext.offered_qos_profiles[0].durability == QosDurability.TRANSIENT_LOCAL


@pytest.mark.parametrize("storage", STORAGES)
def test_metadata_of_the_bag(tmp_path, storage):
    """What `ros2 bag info` prints, in the version that ROS 2 Humble reads too."""
    write_bag(small_recording(rows=40), tmp_path / "lab", storage=storage)
    told = YAML(typ="safe").load((tmp_path / "lab" / "metadata.yaml").read_text())[
        "rosbag2_bagfile_information"
    ]
    assert told["version"] == 8
    assert told["relative_file_paths"] == [f"lab{SUFFIX[storage]}"]
    assert told["duration"]["nanoseconds"] == 390_000_000
    every = {t["topic_metadata"]["name"]: t for t in told["topics_with_message_count"]}
    assert len(every) == 7
    assert every["/omnid3/wrist/command"]["topic_metadata"]["type"] == "geometry_msgs/msg/PointStamped"
    assert all(isinstance(t["topic_metadata"]["offered_qos_profiles"], str) for t in every.values())
    assert {t["topic_metadata"]["serialization_format"] for t in every.values()} == {"cdr"}


def test_a_map_may_be_named(tmp_path):
    recording = small_recording(rows=40)
    write_bag(recording, tmp_path / "bag")
    log = collect(open_bag(tmp_path / "bag", builtin_map("mocobot-ros2")))
    assert log.streams[2].values[:, :3].tolist() == recording.phi[:, 2].tolist()
    with pytest.raises(
        InputError, match=r"joint 'x', wanted for h_x of robot 1, is missing in every message; the joints"
    ):
        collect(open_bag(tmp_path / "bag", builtin_map("omnid-ros2")))


def test_no_samples(tmp_path):
    nothing = np.empty((0, 1, 3))
    write_bag(Recording(np.empty(0), nothing, nothing, nothing, None, metadata(1)), tmp_path / "bag")
    with pytest.raises(InputError, match=r"topic /omnid1/joint/joint_states has no message"):
        collect(open_bag(tmp_path / "bag"))


def refused(tmp_path, match, path, recording=None, **options):
    before = {entry: entry.read_bytes() for entry in tmp_path.rglob("*") if entry.is_file()}
    with pytest.raises(InputError, match=match):
        write_bag(recording or small_recording(rows=20), path, **options)
    assert {entry: entry.read_bytes() for entry in tmp_path.rglob("*") if entry.is_file()} == before
    assert not [entry for entry in tmp_path.rglob(".*") if entry.name != LIST]


def test_targets_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "thesis").write_text("mine")
    (tmp_path / "folder.mcap").mkdir()
    refused(tmp_path, "file: is a file; name a new folder for the bag, or a .mcap file", tmp_path / "file")
    refused(tmp_path, "is a folder that holds something; name a new folder", tmp_path / "folder")
    refused(tmp_path, "folder.mcap: is a folder; name the file to write", tmp_path / "folder.mcap")
    refused(tmp_path, "file is a file", tmp_path / "file" / "bag")
    refused(tmp_path, "a .db3 file does not hold mcap; name a .mcap file", tmp_path / "a.db3")
    refused(tmp_path, "a .mcap file does not hold sqlite3", tmp_path / "a.mcap", storage="sqlite3")
    refused(tmp_path, "storage is 'bag'; it must be one of mcap, sqlite3", tmp_path / "a", storage="bag")
    refused(tmp_path, "level is 'hand'; it must be one of joint, wrist", tmp_path / "a", level="hand")
    refused(tmp_path, "cannot be written", tmp_path / ("n" * 300))
    refused(tmp_path, "cannot be written", tmp_path / "a\0b")


def killed_after(samples, recording, path, **options):
    """Write a bag in a process that kills itself once so many samples are written."""
    child = os.fork()
    if child == 0:
        done = []

        def advance(count):
            done.append(count)
            if sum(done) >= samples:
                os.kill(os.getpid(), signal.SIGKILL)

        write_bag(recording, path, advance=advance, **options)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("single", [True, False])
def test_a_killed_run_leaves_nothing_at_its_place(tmp_path, storage, single):
    recording = small_recording(rows=200)
    path = tmp_path / ("lab" + (SUFFIX[storage] if single else ""))
    for samples in (1, 200):
        assert killed_after(samples, recording, path, storage=storage) == -signal.SIGKILL
        left = [entry.name for entry in tmp_path.iterdir()]
        assert left
        assert all(name.startswith(".") and name.endswith(".tmp") for name in left), left
    write_bag(recording, path, storage=storage)
    assert collect(open_bag(path)).robots == 3


def test_an_earlier_bag_is_replaced_only_if_asked_and_only_once_the_new_one_is_complete(tmp_path):
    path, old, new = tmp_path / "lab", small_recording(rows=20), small_recording(rows=60)
    write_bag(old, path)
    refused(tmp_path, "is a folder that holds something; name a new folder", path)
    before = {entry.name: entry.read_bytes() for entry in path.iterdir()}
    assert killed_after(1, new, path, replace_bag=True) == -signal.SIGKILL
    assert {entry.name: entry.read_bytes() for entry in path.iterdir()} == before
    write_bag(new, path, storage="sqlite3", replace_bag=True)
    assert sorted(entry.name for entry in path.iterdir()) == [LIST, "lab.db3", "metadata.yaml"]
    assert [len(stream.stamp_ns) for stream in collect(open_bag(path)).streams] == [60] * 3


def test_other_peoples_bags_are_not_replaced(tmp_path):
    ours, theirs, more = (tmp_path / name for name in ("ours", "theirs", "more"))
    for path in (ours, theirs, more):
        write_bag(small_recording(rows=20), path)
    (theirs / LIST).unlink()
    (more / "thesis").write_text("mine")
    assert holds("bag")(ours)
    refused(tmp_path, "is a folder that holds something", theirs, replace_bag=True)
    refused(tmp_path, "thesis: was not written by mocobot, or changed since", more, replace_bag=True)


def test_recordings_that_do_not_fit(tmp_path):
    late = dataclasses.replace(small_recording(rows=20), time=np.arange(20) - 0.5)
    refused(
        tmp_path, r"recording: time runs from -0.5 to 18.5 s; stamps of a bag hold 0 to", tmp_path / "a", late
    )
    odd = dataclasses.replace(late, time=np.full(20, np.nan))
    refused(tmp_path, r"recording: time runs from nan to nan s", tmp_path / "a", odd)
    stretched = dataclasses.replace(late, time=np.arange(20.0), phi=np.full((20, 3, 3), 3.0))
    refused(
        tmp_path,
        r"^recording: robot 1: a leg is folded .* at phi = ",
        tmp_path / "a",
        stretched,
        level="wrist",
    )


@pytest.mark.parametrize("storage", STORAGES)
def test_a_full_disk(tmp_path, storage, monkeypatch):
    """The system allows no file beyond 100 kB; CPython 3.11 would cut a larger file of bytecode without a word."""
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    path = tmp_path / f"lab{SUFFIX[storage]}"
    path.write_text("an older one")
    recording = small_recording(rows=5000)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    old = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
        refused(tmp_path, r"lab\.\w+: cannot be written \(", path, recording, storage=storage)
        refused(tmp_path, r"folder: cannot be written \(", tmp_path / "folder", recording, storage=storage)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, old)


def test_sqlite_files_have_the_index_that_players_need(tmp_path):
    write_bag(small_recording(rows=20), tmp_path / "lab.db3", storage="sqlite3")
    connection = sqlite3.connect(tmp_path / "lab.db3")
    try:
        names = {row[0] for row in connection.execute("SELECT name FROM sqlite_master")}
        assert {"topics", "messages", "message_definitions", "schema", "timestamp_idx"} <= names
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    finally:
        connection.close()
