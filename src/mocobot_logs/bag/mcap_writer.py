"""MCAP files for the bag writer of ``rosbags``: chunks compressed (zstd) and with checksums."""

from pathlib import Path
from typing import cast

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2.enums import CompressionMode


class ChecksummedMcap:
    """The storage that ``rosbags.rosbag2.Writer`` calls; its own writes no checksums, so that damage goes unseen."""

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        """Create ``<folder>/<folder's name>.mcap``; ``compression`` is that of the bag around it."""
        del compression
        self.path = path / f"{path.name}.mcap"
        self._file = self.path.open("xb")
        self._writer = McapWriter(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="mocobot")
        self._schemas: dict[str, int] = {}
        self._channels: dict[int, int] = {}

    def add_msgtype(self, connection: Connection) -> None:
        """Write the definition of a message type."""
        definition = connection.msgdef
        encoding = "ros2msg" if definition.format == MessageDefinitionFormat.MSG else "ros2idl"
        self._schemas[connection.msgtype] = self._writer.register_schema(
            connection.msgtype, encoding, definition.data.encode()
        )

    def add_connection(self, connection: Connection, offered_qos_profiles: str) -> None:
        """Write a topic."""
        self._channels[connection.id] = self._writer.register_channel(
            connection.topic,
            cast(ConnectionExtRosbag2, connection.ext).serialization_format,
            self._schemas[connection.msgtype],
            {"offered_qos_profiles": offered_qos_profiles},
        )

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Write a message, logged when it was stamped [ns]."""
        self._writer.add_message(self._channels[connection.id], timestamp, bytes(data), timestamp)

    def close(self, version: int, metadata: str) -> None:
        """Write the bag's metadata and the index."""
        del version
        self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata})
        self._writer.finish()
        self._file.close()

    def abort(self) -> None:
        """Close without an index."""
        self._file.close()
