"""Bags written by other people's libraries, and bags to spoil."""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as RawWriter
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from mocobot_logs.bag.read import open_bag
from mocobot_logs.log import CHANNELS, collect

TYPES = get_typestore(Stores.ROS2_HUMBLE)
JOINT_STATE = "sensor_msgs/msg/JointState"
POINT = "geometry_msgs/msg/PointStamped"
OMNID = ("x", "y", "z", "gimbal_x", "gimbal_y", "gimbal_z")
"""Joints of a real Omnid, in the order in which it publishes them."""
EPOCH_NS = 1_700_000_000_123_456_789


def topic(robot: int) -> str:
    return f"/omnid{robot}/joint/joint_states"


def definition(kind: str) -> str:
    return TYPES.generate_msgdef(kind, ros_version=2)[0]


def header(stamp_ns=EPOCH_NS, frame=""):
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    time = TYPES.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return TYPES.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def joint_state(position, effort, stamp_ns=EPOCH_NS, names=OMNID, velocity=(), frame=""):
    arrays = [np.array(values, float) for values in (position, velocity, effort)]
    return TYPES.types[JOINT_STATE](
        header=header(stamp_ns, frame),
        name=list(names),
        position=arrays[0],
        velocity=arrays[1],
        effort=arrays[2],
    )


def point(xyz, stamp_ns=EPOCH_NS, frame="omnid1/base"):
    xyz = TYPES.types["geometry_msgs/msg/Point"](*map(float, xyz))
    return TYPES.types[POINT](header=header(stamp_ns, frame), point=xyz)


def text(data):
    return TYPES.types["std_msgs/msg/String"](data=data)


def cdr(message, little=True) -> bytes:
    return bytes(TYPES.serialize_cdr(message, message.__msgtype__, little_endian=little))


@dataclass(frozen=True)
class Said:
    """One message: topic, when it was logged, its type and its bytes."""

    topic: str
    log_ns: int
    kind: str
    data: bytes


def said(topic, log_ns, message, little=True) -> Said:
    return Said(topic, log_ns, message.__msgtype__, cdr(message, little))


@dataclass(frozen=True)
class Team:
    """What N Omnids publish: numbers by robot, and the messages with them.

    stamps: (N, Q); position, effort: (N, Q, 6) in the order of OMNID.
    """

    stamps: np.ndarray
    position: np.ndarray
    effort: np.ndarray

    @classmethod
    def draw(cls, robots=3, rows=50, rate_hz=100.0, seed=3):
        rng = np.random.default_rng(seed)
        stamps = EPOCH_NS + np.round(np.arange(rows) * 1e9 / rate_hz).astype(np.int64)
        # Every robot samples when it likes.
        stamps = stamps + rng.integers(0, 1_000_000, (robots, rows))
        return cls(stamps, rng.normal(size=(robots, rows, 6)), rng.normal(size=(robots, rows, 6)))

    def message(self, robot, k, **changes):
        return joint_state(
            self.position[robot, k], self.effort[robot, k], int(self.stamps[robot, k]), **changes
        )

    def log_ns(self, robot, k):
        return int(self.stamps[robot, k]) + 2_000_000 + 1000 * robot

    def said(self, **changes) -> list[Said]:
        every = [
            said(topic(robot + 1), self.log_ns(robot, k), self.message(robot, k, **changes))
            for robot in range(len(self.stamps))
            for k in range(self.stamps.shape[1])
        ]
        return sorted(every, key=lambda s: s.log_ns)

    def places(self):
        """Robot, sample and message, in the order of ``said``."""
        every = [(robot, k) for robot in range(len(self.stamps)) for k in range(self.stamps.shape[1])]
        every.sort(key=lambda place: self.log_ns(*place))
        return [(*place, message) for place, message in zip(every, self.said(), strict=True)]

    def wrist(self, robot):
        """Channels h, theta (z, y, x), force."""
        place = [OMNID.index(name) for name in ("x", "y", "z", "gimbal_z", "gimbal_y", "gimbal_x")]
        return np.hstack([self.position[robot][:, place], self.effort[robot][:, :3]])


def rosbags_bag(
    path: Path, messages: list[Said], storage="mcap", compression="none", version=9, empty=(), msgdefs=None
) -> Path:
    """A bag as the library rosbags writes it; ``empty``: (topic, type) without messages."""
    writer = Writer(path, version=version, storage_plugin=StoragePlugin[storage.upper()])
    writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for name, kind in [*((s.topic, s.kind) for s in messages), *empty]:
            if name not in connections:
                told = {"msgdef": msgdefs[kind], "rihs01": "RIHS01_0"} if msgdefs else {"typestore": TYPES}
                connections[name] = writer.add_connection(name, kind, **told)
        for s in messages:
            writer.write(connections[s.topic], s.log_ns, s.data)
    return path


def raw_mcap(
    path: Path, messages: list[Said], encoding="cdr", definitions=None, profile="ros2", **options
) -> Path:
    """An MCAP file as the library mcap writes it, with its options; ``definitions``: by type, (encoding, text)."""
    options = {"compression": CompressionType.NONE, "chunk_size": 4096} | options
    with path.open("wb") as file:
        writer = RawWriter(file, **options)
        writer.start(profile=profile)
        schemas, channels = {}, {}
        for s in messages:
            if s.kind not in schemas:
                how, told = (definitions or {}).get(s.kind) or ("ros2msg", definition(s.kind))
                schemas[s.kind] = writer.register_schema(s.kind, how, told.encode())
            if s.topic not in channels:
                channels[s.topic] = writer.register_channel(s.topic, encoding, schemas[s.kind])
            writer.add_message(channels[s.topic], s.log_ns, s.data, s.log_ns)
        writer.finish()
    return path


def mcap_ros2_bag(path: Path, messages: list[tuple[str, int, str, dict]]) -> Path:
    """A file as the library mcap-ros2-support writes it, from (topic, log time, type, fields as plain values)."""
    with path.open("wb") as file:
        writer = Ros2Writer(file, chunk_size=4096)
        schemas = {}
        for name, log_ns, kind, fields in messages:
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, definition(kind))
            writer.write_message(name, schemas[kind], fields, log_ns)
        writer.finish()
    return path


def record(opcode: int, content: bytes, claim: int | None = None) -> bytes:
    """One MCAP record; ``claim``: the length it says it has."""
    return struct.pack("<BQ", opcode, len(content) if claim is None else claim) + content


def wrist_map(field="position", **more):
    """The map of an Omnid, to change."""
    topic = "/omnid{robot}/joint/joint_states"
    channels = {
        **{f"h_{a}": {"joint": a, "field": field, "unit": "m"} for a in "xyz"},
        **{f"theta_{a}": {"joint": f"gimbal_{a}", "field": "position", "unit": "rad"} for a in "xyz"},
        **{f"force_{a}": {"joint": a, "field": "effort", "unit": "N"} for a in "xyz"},
    }
    return {"version": 1, "level": "wrist", "defaults": {"topic": topic}, "channels": channels, **more}


UNCHUNKED = {"use_chunking": False}
NO_SUMMARY = {
    "use_chunking": False, "index_types": IndexType.NONE, "repeat_channels": False, "repeat_schemas": False,
    "use_statistics": False, "use_summary_offsets": False,
}  # fmt: skip


def assert_holds(path, team, log_map=None):
    source = open_bag(path, log_map)
    log = collect(source)
    assert (log.level, log.robots, log.channels) == ("wrist", len(team.stamps), CHANNELS["wrist"])
    for robot, stream in enumerate(log.streams):
        np.testing.assert_array_equal(stream.stamp_ns, team.stamps[robot])
        np.testing.assert_array_equal(stream.values, team.wrist(robot))
        logged = [team.log_ns(robot, k) for k in range(len(stream.stamp_ns))]
        np.testing.assert_array_equal(stream.log_ns, logged)
    told = []
    list(source.chunks(told.append))
    assert sum(told) == source.size
    assert min(told) >= 0
