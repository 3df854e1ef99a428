"""Write recordings as ROS 2 bags: rosbag2 folders or single files, MCAP or SQLite, readable by ROS 2 tools.

Topics per robot i, from 1:

- ``/omnid{i}/joint/joint_states`` (sensor_msgs/msg/JointState). At joint level: joints phi1, phi2, phi3 (position
  [rad], effort = spring torque [N m]). At wrist level: x, y, z (position of the wrist in {b} [m], effort = force of the
  springs on it [N]). Both: gimbal_z, gimbal_y, gimbal_x (position [rad], effort 0: they are passive); no velocities.
- ``/omnid{i}/wrist/command`` (geometry_msgs/msg/PointStamped): commanded wrist position in {b} [m], if recorded.

``/mocobot/metadata`` (std_msgs/msg/String, latched) holds the recording's metadata as JSON, once. Header stamps and
log times are the recording's times. The maps ``mocobot-ros2`` and ``omnid-ros2`` read such bags.
"""

import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast, get_args

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from numpy.typing import NDArray
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinitionFormat,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, WriterError
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.rosbag2.enums import CompressionMode
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from estimator.arm.delta import wrist_of
from estimator.errors import InputError
from estimator.files import check_place, holds, scratch_folder, whole_file, whole_folder
from estimator.recording.model import Recording
from mocobot_logs.bag.cdr import JOINT_STATE, STRING, Walk, message_type, record_of
from mocobot_logs.bag.read import METADATA_TOPIC
from mocobot_logs.bag.storage import Topic
from mocobot_logs.log import Array, Level, Stamps


class ChecksummedMcap:
    """MCAP storage for ``rosbags.rosbag2.Writer`` with checksums, which the library's own storage lacks."""

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        """Create ``<folder>/<folder's name>.mcap``; ``compression`` of the bag is ignored."""
        del compression
        self.path = path / f"{path.name}.mcap"
        self._file = self.path.open("xb")
        self._writer = McapWriter(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="mocobot")
        self._schemas: dict[str, int] = {}
        self._channels: dict[int, int] = {}

    def add_msgtype(self, connection: Connection) -> None:
        definition = connection.msgdef
        encoding = "ros2msg" if definition.format == MessageDefinitionFormat.MSG else "ros2idl"
        self._schemas[connection.msgtype] = self._writer.register_schema(
            connection.msgtype, encoding, definition.data.encode()
        )

    def add_connection(self, connection: Connection, offered_qos_profiles: str) -> None:
        self._channels[connection.id] = self._writer.register_channel(
            connection.topic,
            cast(ConnectionExtRosbag2, connection.ext).serialization_format,
            self._schemas[connection.msgtype],
            {"offered_qos_profiles": offered_qos_profiles},
        )

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Write a message; ``timestamp`` [ns] is both its log time and its publish time."""
        self._writer.add_message(self._channels[connection.id], timestamp, bytes(data), timestamp)

    def close(self, version: int, metadata: str) -> None:
        """Write the bag's metadata and the index."""
        del version
        self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata})
        self._writer.finish()
        self._file.close()

    def abort(self) -> None:
        self._file.close()


Storage = Literal["mcap", "sqlite3"]

SUFFIXES: dict[Storage, str] = {"mcap": ".mcap", "sqlite3": ".db3"}
"""Suffixes of single files; any other path is a folder."""
POINT = "geometry_msgs/msg/PointStamped"
_ARM: dict[Level, tuple[str, ...]] = {"joint": ("phi1", "phi2", "phi3"), "wrist": ("x", "y", "z")}
_GIMBAL = ("gimbal_z", "gimbal_y", "gimbal_x")
_SEC, _NANOSEC = "header.stamp.sec", "header.stamp.nanosec"
_LAST_S = 2**31 - 1  # seconds of a stamp are an int32
_AT_ONCE = 4096
_VERSION = 8  # of metadata.yaml: the newest with quality of service as text, as ROS 2 Humble needs it
_LATCHED = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    *(QosTime(0, 0), QosTime(0, 0)),
    QosLiveliness.AUTOMATIC,
    QosTime(0, 0),
    avoid_ros_namespace_conventions=False,
)


class _Writer(BagWriter):
    STORAGE_PLUGINS = {StoragePlugin.SQLITE3: Sqlite3Writer, StoragePlugin.MCAP: ChecksummedMcap}  # noqa: RUF012


def write_bag(
    recording: Recording,
    path: Path | str,
    *,
    level: Level = "joint",
    storage: Storage = "mcap",
    advance: Callable[[int], object] = lambda _: None,
    replace_bag: bool = False,
) -> None:
    """Write a recording as a ROS 2 bag; at joint level samples are bit-exact, times exact to the nanosecond.

    Args:
        recording: a recording with times in [0, 2^31) s.
        path: a single file if it ends in .mcap or .db3 (an existing one is replaced once the new one is complete),
            else a new folder with ``metadata.yaml``.
        level: "joint" (phi, theta, tau) or "wrist" (h, theta, force).
        storage: "mcap" or "sqlite3".
        advance: called with the number of samples written since the last call.
        replace_bag: whether to replace a bag's folder that this program wrote, once the new one is complete.
    """
    path = Path(path)
    for value, allowed, what in ((level, get_args(Level), "level"), (storage, get_args(Storage), "storage")):
        if value not in allowed:
            raise InputError(f"{path}: {what} is {value!r:.40}; it must be one of {', '.join(allowed)}")
    single = _check_target(path, storage, replace_bag)
    stamps = _stamps(recording)
    name = path.stem if single else path.name
    plugin = StoragePlugin[storage.upper()]
    try:
        with (
            whole_file(path) if single else whole_folder(path, "bag") as target,
            scratch_folder(path.parent) as scratch,
        ):
            folder = scratch / name  # a bag's files are named after its folder
            with _Writer(folder, version=_VERSION, storage_plugin=plugin) as bag:
                _write(recording, stamps, level, bag, advance)
            for file in folder.iterdir():
                if not single:
                    file.replace(target / file.name)
                elif file.suffix == SUFFIXES[storage]:
                    file.replace(target)
    except InputError:
        raise
    except (OSError, ValueError, sqlite3.Error, WriterError) as error:
        detail = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be written ({detail})") from error


def _check_target(path: Path, storage: Storage, replace_bag: bool) -> bool:
    """Check the target; return whether it is a single file."""
    suffix = path.suffix.lower()
    single = suffix in SUFFIXES.values()
    try:
        if single and suffix != SUFFIXES[storage]:
            raise InputError(
                f"{path}: a {suffix} file does not hold {storage}; name a {SUFFIXES[storage]} file"
            )
        if single and path.is_dir():
            raise InputError(f"{path}: is a folder; name the file to write")
        if (
            not single
            and path.exists()
            and not (path.is_dir() and (not any(path.iterdir()) or (replace_bag and holds("bag")(path))))
        ):
            what = "is a folder that holds something" if path.is_dir() else "is a file"
            raise InputError(f"{path}: {what}; name a new folder for the bag, or a {SUFFIXES[storage]} file")
        check_place(path)
    except (OSError, ValueError) as error:  # a name too long for the system, or with a NUL in it
        if isinstance(error, InputError):
            raise
        raise InputError(f"{str(path)!r:.80}: cannot be written ({error})") from error
    return single


def _stamps(recording: Recording) -> Stamps:
    """Return times as integer nanoseconds; whole seconds are converted separately to keep precision."""
    time = recording.time
    if not (np.isfinite(time).all() and (not len(time) or 0 <= time.min() <= time.max() < _LAST_S)):
        raise InputError(
            f"{recording.name}: time runs from {time.min():.10g} to {time.max():.10g} s; stamps of a bag hold 0 to "
            f"{_LAST_S} s"
        )
    seconds = np.floor(time)
    return seconds.astype(np.int64) * 1_000_000_000 + np.rint((time - seconds) * 1e9).astype(np.int64)


def _write(
    recording: Recording, stamps: Stamps, level: Level, bag: _Writer, advance: Callable[[int], object]
) -> None:
    types = get_typestore(Stores.LATEST)
    metadata = replace(recording.metadata, level=level).to_json()
    latched = bag.add_connection(METADATA_TOPIC, STRING, typestore=types, offered_qos_profiles=[_LATCHED])
    streams: list[_Stream] = []
    for robot in range(1, recording.metadata.robots + 1):
        topic = f"/omnid{robot}/joint/joint_states"
        streams.append(_joint_states(bag.add_connection(topic, JOINT_STATE, typestore=types), level, types))
        if recording.ref is not None:
            topic, frame = f"/omnid{robot}/wrist/command", f"omnid{robot}/base"
            streams.append(_commands(bag.add_connection(topic, POINT, typestore=types), frame, types))
    text = types.types[STRING](data=metadata)
    bag.write(
        latched, int(stamps[0]) if len(stamps) else 0, types.serialize_cdr(text, STRING, little_endian=True)
    )
    for begin in range(0, len(stamps), _AT_ONCE):
        part = slice(begin, begin + _AT_ONCE)
        contents = [
            s.messages(stamps[part], *v)
            for s, v in zip(streams, _values(recording, part, level), strict=True)
        ]
        for k, stamp in enumerate(stamps[part].tolist()):
            for stream, content in zip(streams, contents, strict=True):
                bag.write(stream.connection, stamp, content[k])
        advance(len(stamps[part]))


def _values(recording: Recording, part: slice, level: Level) -> Iterator[tuple[Array, ...]]:
    """Yield the content of each stream's messages: position and effort of the joints, or the point."""
    for robot in range(recording.metadata.robots):
        position, effort = recording.phi[part, robot], recording.tau[part, robot]
        if level == "wrist":
            try:
                position, effort = wrist_of(position, effort, recording.metadata.design)
            except InputError as error:
                raise InputError(f"{recording.name}: robot {robot + 1}: {error}") from error
        theta = recording.theta[part, robot]
        yield np.hstack([position, theta]), np.hstack([effort, np.zeros_like(theta)])
        if recording.ref is not None:
            yield (recording.ref[part, robot],)


@dataclass(frozen=True, eq=False)
class _Stream:
    """Messages of one topic that differ only in stamps and numbers."""

    connection: Connection  # the topic
    template: bytes  # one message
    record: np.dtype  # positions of its stamp and numbers

    def messages(self, stamps: Stamps, *values: Array) -> list[bytes]:
        """Return one message per stamp, with numbers (q, n) for each array of the record after the stamp."""
        rows: NDArray[np.uint8] = np.tile(np.frombuffer(self.template, np.uint8), (len(stamps), 1))
        table = rows.view(self.record)[:, 0]
        table[_SEC], table[_NANOSEC] = np.divmod(stamps, 1_000_000_000)
        for name, value in zip((self.record.names or ())[2:], values, strict=True):
            table[name] = value
        return [row.tobytes() for row in rows]


def _joint_states(connection: Connection, level: Level, types: Typestore) -> _Stream:
    names, zeros = (*_ARM[level], *_GIMBAL), np.zeros(6)
    message = types.types[JOINT_STATE](
        header=_header(types, ""), name=list(names), position=zeros, velocity=zeros[:0], effort=zeros
    )
    return _stream(connection, message, {"position": 6, "effort": 6}, types)


def _commands(connection: Connection, frame: str, types: Typestore) -> _Stream:
    point = types.types["geometry_msgs/msg/Point"](x=0.0, y=0.0, z=0.0)
    message = types.types[POINT](header=_header(types, frame), point=point)
    return _stream(connection, message, {"point.x": 3}, types)  # y and z follow x


def _header(types: Typestore, frame: str) -> Any:
    time = types.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    return types.types["std_msgs/msg/Header"](stamp=time, frame_id=frame)


def _stream(connection: Connection, message: object, arrays: dict[str, int], types: Typestore) -> _Stream:
    template = bytes(types.serialize_cdr(message, connection.msgtype, little_endian=True))
    kind = message_type(Topic(connection.topic, connection.msgtype, "cdr"), "bag")
    kinds = {_SEC: "<i4", _NANOSEC: "<u4"} | {path: ("<f8", (count,)) for path, count in arrays.items()}
    leaves = Walk(template, kind, set(kinds), names=False).leaves
    places = {path: (form, leaves[path].offset) for path, form in kinds.items()}
    return _Stream(connection, template, record_of(places, len(template)))
