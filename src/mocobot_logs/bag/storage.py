"""Read the messages of MCAP files (https://mcap.dev/spec) and SQLite files of a bag, including damaged ones.

An MCAP file is read once from front to back, chunk by chunk. Its index is not used, since that of a damaged file may be
wrong. ``rosbags`` relies on the index and unpacks a chunk before it knows the unpacked size. This reader is also about
six times as fast per message. The ``mcap`` library parses all records except the headers of chunks and messages.

An SQLite file (.db3) has the tables ``topics``, ``messages`` and, in newer files, definitions. Messages come in the
order of insertion. The file is opened as immutable, so nothing is written beside it. SQLite's limits and a check for
ascending rows stop malicious databases (views, cyclic pages). ``rosbags`` sets no such limits, and refuses a whole bag
if it does not know the definition or quality of service of one topic.
"""

import contextlib
import os
import sqlite3
import struct
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.inputs import Unpacked
from mocobot_logs.formats import MCAP, SQLITE, detail_of, readable, shown
from mocobot_logs.log import Stamps

BLOCK_BYTES = 4 << 20  # approximate size of a block of messages [bytes], unless a chunk of the file is larger
MESSAGE_BYTES = 16 << 20  # largest message that is read [bytes]; one robot's joint states take some hundred
CHUNK_BYTES = 256 << 20
"""Largest chunk that is unpacked in memory [bytes]; recorders write chunks of about 1 MiB."""
SHOWN = 20  # largest number of topics or joints that a message lists
_STEP = 1 << 20


@dataclass(frozen=True)
class Topic:
    name: str  # such as ``/omnid1/joint/joint_states``
    type: str  # such as ``sensor_msgs/msg/JointState``
    encoding: str  # serialisation of the messages; only ``cdr`` is read
    definition_format: str = ""  # ``ros2msg``, ``ros2idl``, or "" if the bag does not define the type
    definition: str = ""  # text of the definition
    count: int | None = None  # number of messages, None if unknown


@dataclass(frozen=True, eq=False)
class Messages:
    """Serialised messages of one topic inside a block of memory, in the order of the bag."""

    block: bytes  # the memory
    start: NDArray[np.int64]  # first byte of each message, shape (q,)
    size: NDArray[np.int64]  # size of each message [bytes], shape (q,)
    log_ns: Stamps  # time of recording [ns], shape (q,)

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, index: int) -> bytes:
        start = int(self.start[index])
        return self.block[start : start + int(self.size[index])]


def joined(payloads: Sequence[bytes], log_ns: Stamps, where: str) -> Messages:
    """Join separate messages in one block of memory."""
    size = np.fromiter(map(len, payloads), np.int64, len(payloads))
    check_sizes(size, where)
    return Messages(b"".join(payloads), np.cumsum(size) - size, size, log_ns)


def check_sizes(size: NDArray[np.int64], where: str) -> None:
    """Refuse messages larger than ``MESSAGE_BYTES``."""
    if len(size) and (largest := int(size.max())) > MESSAGE_BYTES:
        raise InputError(
            f"{where}: a message of {largest / 2**20:.1f} MiB; joint data are read from messages of at most "
            f"{MESSAGE_BYTES >> 20} MiB"
        )


def merged(topics: Iterable[Topic], where: str) -> dict[str, Topic]:
    """Merge topics by name; a bag may list one per quality of service and per file."""
    found: dict[str, Topic] = {}
    for topic in topics:
        known = found.setdefault(topic.name, topic)
        if known is topic:
            continue
        for one, other in ((known.type, topic.type), (known.encoding, topic.encoding)):
            if one != other:
                raise InputError(
                    f"{where}: topic {topic.name!r:.80} holds both {one!r:.80} and {other!r:.80}"
                )
        count = None if known.count is None or topic.count is None else known.count + topic.count
        found[topic.name] = replace(known if known.definition_format else topic, count=count)
    return found


def listed(topics: Mapping[str, Topic]) -> str:
    """Return the topics of a bag and their types, for messages."""
    if not topics:
        return "the bag has no topics"
    first = list(topics.values())[:SHOWN]
    names = ", ".join(f"{printable(topic.name)} ({printable(topic.type)})" for topic in first)
    more = f", ... ({len(topics)} in all)" if len(topics) > SHOWN else ""
    return f"the bag's topics are {names}{more}"


def listed_names(names: Sequence[str]) -> str:
    return ", ".join(map(printable, names[:SHOWN])) + (", ..." if len(names) > SHOWN else "") or "none"


def printable(text: str) -> str:
    return shown(text, 80)


class UnpackError(ValueError):
    """Packed data are damaged or too large; the text says what is wrong, not where."""


def unpack(data: bytes, compression: str, size: int) -> bytes:
    """Unpack a chunk that claims ``size`` bytes, compressed by "", "zstd" or "lz4" as in MCAP. Raises UnpackError."""
    if size > CHUNK_BYTES:
        raise UnpackError(f"claims {size} bytes; chunks of at most {CHUNK_BYTES >> 20} MiB are read")
    try:
        if compression == "":
            unpacked = data
        elif compression == "zstd":
            unpacked = _zstd(data, size)
        elif compression == "lz4":
            stream = lz4.frame.LZ4FrameDecompressor()
            unpacked = stream.decompress(data, max_length=size + 1)
            if not stream.eof and len(unpacked) <= size:
                raise UnpackError("is cut off")
        else:
            raise UnpackError(f"is compressed by {compression!r:.40}; it must be zstd, lz4 or not compressed")
    except (zstandard.ZstdError, RuntimeError) as error:  # lz4 raises RuntimeError
        raise UnpackError(f"does not unpack ({detail_of(error)})") from error
    if len(unpacked) != size:
        more = "more" if len(unpacked) > size else f"{len(unpacked)}"
        raise UnpackError(f"claims {size} bytes unpacked, but holds {more}")
    return unpacked


def unpack_message(data: bytes) -> bytes:
    """Unpack one individually compressed message (zstd) of at most ``MESSAGE_BYTES``. Raises UnpackError."""
    try:
        size = zstandard.frame_content_size(data)
        unpacked = _zstd(data, MESSAGE_BYTES if size < 0 else min(size, MESSAGE_BYTES))
    except zstandard.ZstdError as error:
        raise UnpackError(f"does not unpack ({detail_of(error)})") from error
    if max(size, len(unpacked)) > MESSAGE_BYTES:
        raise UnpackError(f"unpacks to more than {MESSAGE_BYTES >> 20} MiB")
    return unpacked


def unpack_file(source: Path, target: Path, heads: tuple[bytes, ...], unpacked: Unpacked) -> None:
    """Unpack a file of a bag that was compressed as a whole (zstd), if it then begins with one of ``heads``."""
    done = 0
    try:
        with (
            source.open("rb") as packed,
            target.open("wb") as out,
            zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as stream,
        ):
            while block := stream.read(_STEP):
                if not done and not block.startswith(heads):
                    raise InputError(f"{source}: what it unpacks to is neither an MCAP nor an SQLite file")
                done += len(block)
                unpacked.add(len(block))
                out.write(block)
    except zstandard.ZstdError as error:
        raise InputError(f"{source}: damaged, does not unpack ({detail_of(error)})") from error
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{source}: cannot be unpacked into {target.parent} ({reason})") from error
    if not done:
        raise InputError(f"{source}: unpacks to nothing, or is cut off")


def _zstd(data: bytes, size: int) -> bytes:
    """Unpack at most ``size`` + 1 bytes."""
    unpacker = zstandard.ZstdDecompressor()
    if zstandard.frame_content_size(data) == size:  # three times as fast as a stream
        return unpacker.decompress(data, max_output_size=size) if size else b""
    with unpacker.stream_reader(data, read_across_frames=True) as stream:
        return stream.read(size + 1)


DEFINITION_BYTES = 256 << 10  # longest definition of a message type that is read [bytes]
_HEAD = struct.Struct("<BQ")  # opcode, length
_MESSAGE_HEAD = struct.Struct("<BQH")  # opcode, length, channel
_MESSAGE = np.dtype(
    {
        "names": ["op", "length", "channel", "sequence", "log", "publish"],
        "formats": ["u1", "<u8", "<u2", "<u4", "<u8", "<u8"],
    }
)
_CHUNK = struct.Struct("<QQQII")  # start, end, unpacked size, checksum, length of the compression's name
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary, summary offsets, checksum
_TAIL = _FOOTER.size + len(MCAP)
_LOOSE = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
_NOT_INSIDE = (0, Opcode.CHUNK, Opcode.DATA_END, Opcode.FOOTER)
_WINDOW = 4 << 10
_INT64 = np.iinfo(np.int64).max

_Starts = dict[int, list[int]]


class McapBag:
    def __init__(self, path: Path, name: str, unpacked: Unpacked) -> None:
        """Find the topics in the summary or, without one, in the whole file; ``unpacked`` counts bytes of chunks."""
        self._path, self.name, self._unpacked = path, name, unpacked
        self._channels: dict[int, Topic] = {}
        self._schemas: dict[int, Schema] = {}
        self._counts: dict[int, int] | None = None
        with self._open() as file:
            self.size, summary = self._check_ends(file)
            if summary:
                self._read_summary(file, summary)
        if not self._channels:
            counts = self._counts = {}
            for _, found in self._scan(None, lambda _: None, BLOCK_BYTES):
                for channel, starts in found.items():
                    counts[channel] = counts.get(channel, 0) + len(starts)
        counted = self._counts
        self.topics = merged(
            (
                replace(topic, count=None if counted is None else counted.get(channel, 0))
                for channel, topic in self._channels.items()
            ),
            name,
        )

    def blocks(
        self, topics: Collection[str], advance: Callable[[int], object], block_bytes: int = BLOCK_BYTES
    ) -> Iterator[dict[str, Messages]]:
        for block, found in self._scan(topics, advance, block_bytes):
            by_topic: dict[str, list[int]] = {}
            for channel, starts in found.items():
                by_topic.setdefault(self._channels[channel].name, []).extend(starts)
            if by_topic:
                yield {topic: self._messages(block, starts, topic) for topic, starts in by_topic.items()}

    def has_messages(self, topic: str) -> bool:
        """Return whether a topic has messages, or may have some if the file has no counts."""
        return topic in self.topics and self.topics[topic].count != 0

    def _scan(
        self, topics: Collection[str] | None, advance: Callable[[int], object], most: int
    ) -> Iterator[tuple[bytes, _Starts]]:
        """Yield chunks and windows from front to back, with the positions of messages of some topics (None: all) in
        each."""
        at, told = len(MCAP), 0
        end, window = self.size - len(MCAP), _WINDOW
        with self._open() as file:
            while True:
                if end - at < _HEAD.size:
                    raise self._damaged(at, "the data have no end")
                opcode, length = _HEAD.unpack(self._read(file, _HEAD.size, at))
                after = at + _HEAD.size + length
                if after > end:
                    left = end - at - _HEAD.size
                    raise self._damaged(at, f"a record claims {length} bytes, of which {left} are there")
                if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                    break
                if opcode == Opcode.CHUNK:
                    block = self._chunk(file, length, at)
                    found, stop = self._walk(block, at, topics)
                    if stop < len(block):
                        raise self._stuck(block, stop, at)
                    yield block, found
                elif opcode in _LOOSE:
                    if length > CHUNK_BYTES:
                        raise self._damaged(at, f"a record of {length} bytes")
                    block = self._read(file, max(after - at, min(window, end - at)), at)
                    found, stop = self._walk(block, at, topics)
                    if not stop:
                        raise self._stuck(block, 0, at)
                    yield block, found
                    after = at + stop
                    # Small windows where chunks and loose records alternate bound the bytes that are read twice.
                    is_stopped = stop + _HEAD.size <= len(block) and block[stop] in _NOT_INSIDE
                    window = _WINDOW if is_stopped else min(2 * window, max(most, _WINDOW))
                elif not opcode:
                    raise self._damaged(at, "a record of no kind")
                advance(after - told)
                at = told = after
        advance(self.size - told)

    def _walk(self, block: bytes, offset: int, topics: Collection[str] | None) -> tuple[_Starts, int]:
        """Return the positions of messages in whole records by channel, and the end of these records."""
        found: dict[int, list[int] | None] = {}
        at, end = 0, len(block)
        head, is_message, last = _MESSAGE_HEAD.unpack_from, int(Opcode.MESSAGE), end - _MESSAGE.itemsize
        while at + _HEAD.size <= end:
            if at <= last:
                opcode, length, channel = head(block, at)
                if opcode == is_message:
                    if length > end - at - 9:
                        break
                    try:
                        starts = found[channel]
                    except KeyError:
                        starts = found[channel] = self._starts(channel, topics, offset)
                    if starts is not None:
                        starts.append(at)
                    at += 9 + length
                    continue
            opcode, length = _HEAD.unpack_from(block, at)
            after = at + _HEAD.size + length
            if opcode in _NOT_INSIDE or opcode == is_message or after > end:
                break
            self._define(opcode, block[at + _HEAD.size : after], offset)
            at = after
        return {channel: starts for channel, starts in found.items() if starts}, at

    def _starts(self, channel: int, topics: Collection[str] | None, offset: int) -> list[int] | None:
        """Return a new list for a wanted channel, None for another one."""
        if (topic := self._channels.get(channel)) is None:
            raise self._damaged(offset, f"a message of channel {channel}, which was not announced")
        return [] if topics is None or topic.name in topics else None

    def _stuck(self, block: bytes, at: int, offset: int) -> InputError:
        """Return the error for a record that cannot be at its position."""
        left = len(block) - at - _HEAD.size
        if left < 0:
            return self._damaged(offset, "a record is cut off")
        opcode, length = _HEAD.unpack_from(block, at)
        what = f"a record of kind {opcode} and {length} bytes, which cannot be"
        if length > left:
            what = f"a record claims {length} bytes, of which {left} are there"
            if opcode == Opcode.MESSAGE and left >= _MESSAGE.itemsize - _HEAD.size:
                what = "a message is longer than what holds it"
        return self._damaged(offset, what)

    def _define(self, opcode: int, content: bytes, offset: int) -> None:
        """Store a schema, a channel or the message counts; a repeated schema or channel must equal the first."""
        if opcode == Opcode.SCHEMA:
            schema = self._parse(Schema, content, offset)
            if self._schemas.setdefault(schema.id, schema) != schema:
                raise self._damaged(offset, f"schema {schema.id} is defined twice")
        elif opcode == Opcode.CHANNEL:
            channel = self._parse(Channel, content, offset)
            schema = self._schemas.get(channel.schema_id)
            if schema is None and channel.schema_id:
                missing = f"channel {channel.id} has schema {channel.schema_id}, which is missing"
                raise self._damaged(offset, missing)
            topic = Topic(channel.topic, "", channel.message_encoding)
            if schema is not None:
                text = schema.data.decode(errors="replace") if len(schema.data) <= DEFINITION_BYTES else ""
                topic = replace(topic, type=schema.name, definition_format=schema.encoding, definition=text)
            if self._channels.setdefault(channel.id, topic) != topic:
                raise self._damaged(offset, f"channel {channel.id} is defined twice")
        elif opcode == Opcode.STATISTICS:
            self._counts = dict(self._parse(Statistics, content, offset).channel_message_counts)

    def _parse(self, kind: Any, content: bytes, offset: int) -> Any:
        try:
            return kind.read(ReadDataStream(BytesIO(content)))
        except Exception as error:  # struct.error, UnicodeDecodeError, McapError and others
            raise self._damaged(offset, f"its {kind.__name__} record is not readable") from error

    def _messages(self, block: bytes, starts: list[int], topic: str) -> Messages:
        where = f"topic {topic!r:.80}"
        start = np.array(starts, np.int64)
        start.sort()  # several publishers of a topic have a channel each
        windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(block, np.uint8), _MESSAGE.itemsize)
        heads = np.ascontiguousarray(windows[start]).view(_MESSAGE)[:, 0]
        size = heads["length"].astype(np.int64) - (_MESSAGE.itemsize - _HEAD.size)
        if size.min() < 0:
            raise InputError(f"{self.name}: damaged, a message of {where} is shorter than its header")
        check_sizes(size, f"{self.name}: {where}")
        if heads["log"].max() > _INT64:
            raise InputError(f"{self.name}: damaged, a message of {where} was logged after the year 2262")
        return Messages(block, start + _MESSAGE.itemsize, size, heads["log"].astype(np.int64))

    def _damaged(self, offset: int, what: str) -> InputError:
        return InputError(f"{self.name}: damaged at byte {offset}, {what}")

    def _open(self) -> BinaryIO:
        with readable(self.name):
            return self._path.open("rb")

    def _read(self, file: BinaryIO, length: int, at: int | None = None) -> bytes:
        """Read ``length`` bytes at ``at``, or at the current position; the caller has checked that the file holds
        them."""
        with readable(self.name):
            if at is not None:
                file.seek(at)
            content = file.read(length)
        if len(content) < length:
            raise InputError(f"{self.name}: became shorter while it was read")
        return content

    def _check_ends(self, file: BinaryIO) -> tuple[int, int]:
        """Return the file's size and the position of its summary, 0 if there is none."""
        size = os.fstat(file.fileno()).st_size
        if size < len(MCAP) or self._read(file, len(MCAP)) != MCAP:
            raise InputError(f"{self.name}: not an MCAP file, it begins with other bytes")
        tail = self._read(file, _TAIL, size - _TAIL) if size >= len(MCAP) + _TAIL else b""
        if not tail.endswith(MCAP):
            raise InputError(
                f"{self.name}: cut off, the MCAP file has no end; if its recording was interrupted, "
                "`mcap recover` saves what is there"
            )
        opcode, length, summary, _, _ = _FOOTER.unpack_from(tail)
        if opcode != Opcode.FOOTER or length != _FOOTER.size - _HEAD.size:
            raise self._damaged(size - _TAIL, "where the footer should be")
        if summary and not len(MCAP) <= summary <= size - _TAIL:
            raise self._damaged(size - _TAIL, f"the footer says that the summary is at byte {summary}")
        return size, summary

    def _read_summary(self, file: BinaryIO, at: int) -> None:
        """Read channels, schemas and message counts from the summary."""
        length = self.size - _TAIL - at
        if length > CHUNK_BYTES:
            raise self._damaged(at, f"a summary of {length} bytes")
        block = self._read(file, length, at)
        if (stop := self._walk(block, at, ())[1]) < length:
            raise self._stuck(block, stop, at)

    def _chunk(self, file: BinaryIO, length: int, at: int) -> bytes:
        """Return the unpacked content of a chunk, after a check of its checksum if it has one."""
        if not _CHUNK.size + 8 <= length <= 2 * CHUNK_BYTES:
            raise self._damaged(at, f"a chunk of {length} bytes")
        content = self._read(file, length)
        _, _, size, checksum, named = _CHUNK.unpack_from(content)
        begin = _CHUNK.size + named + 8
        stored = int.from_bytes(content[begin - 8 : begin], "little")
        if begin > length or stored > length - begin:
            raise self._damaged(at, "a chunk claims more bytes than it has")
        compression = content[_CHUNK.size : begin - 8].decode(errors="replace")
        if compression:
            self._unpacked.add(min(size, CHUNK_BYTES))  # ``unpack`` refuses larger chunks
        try:
            block = unpack(content[begin : begin + stored], compression, size)
        except UnpackError as error:
            raise self._damaged(at, f"the chunk {error}") from error
        if checksum and zlib.crc32(block) != checksum:
            raise self._damaged(at, "the chunk's checksum does not agree")
        return block


_OPERATIONS = 1_000_000
"""Number of SQLite operations between progress calls; a row takes about ten, and at least eight bytes of the file."""
_REQUIRED = {
    "topics": ("id", "name", "type", "serialization_format"),
    "messages": ("topic_id", "timestamp", "data"),
}
_MOST_ROWS = 10_000  # in the tables that describe topics

_Row = tuple[int, bytes, int, int]  # topic, message, time of logging [ns], row number


class SqliteBag:
    def __init__(self, path: Path, name: str) -> None:
        self.path, self.name = path, name
        self._check_file()
        with self._connected() as connection:
            self._check_tables(connection)
            self._ids: dict[int, str] = {}
            self.topics = self._read_topics(connection)
            self._last = connection.execute("SELECT max(rowid) FROM messages").fetchone()[0] or 0

    def blocks(
        self, topics: Collection[str], advance: Callable[[int], object], block_bytes: int = BLOCK_BYTES
    ) -> Iterator[dict[str, Messages]]:
        ids = [key for key, name in self._ids.items() if name in topics]
        last, told, held = -(1 << 63), 0, 0
        with self._connected() as connection:
            marks = ",".join("?" * len(ids))
            # The order by rowid needs no index and no sort, and reads the file from front to back.
            rows = connection.execute(
                f"SELECT topic_id, data, timestamp, rowid FROM messages NOT INDEXED WHERE topic_id IN ({marks}) "
                "ORDER BY rowid",
                ids,
            )
            while found := self._next(rows, block_bytes):
                order = np.array([row[3] for row in found], np.int64)
                if order[0] <= last or (order[1:] <= order[:-1]).any():
                    raise self._damaged("its table 'messages' holds the same row twice")
                last = int(order[-1])
                held += sum(len(row[1]) for row in found)
                if held > self.size:
                    raise self._damaged("its messages are larger than the file: they share pages")
                yield self._by_topic(found)
                now = int(self.size * min(max(last / self._last, 0.0), 1.0)) if self._last > 0 else 0
                advance(now - told)
                told = now
        advance(self.size - told)

    def has_messages(self, topic: str) -> bool:
        ids = [key for key, name in self._ids.items() if name == topic]
        with self._connected() as connection:
            marks = ",".join("?" * len(ids))
            query = f"SELECT 1 FROM messages NOT INDEXED WHERE topic_id IN ({marks}) LIMIT 1"
            return connection.execute(query, ids).fetchone() is not None

    def _damaged(self, what: str) -> InputError:
        return InputError(f"{self.name}: damaged, {what}")

    def _next(self, rows: Iterator[_Row], block_bytes: int) -> list[_Row]:
        """Return rows of about one block."""
        found, held = [], 0
        try:
            for row in rows:
                found.append(row)
                held += len(row[1]) + 64
                if held > block_bytes:
                    break
        except TypeError as error:
            raise self._damaged("its table 'messages' has a row without data") from error
        return found

    def _by_topic(self, rows: list[_Row]) -> dict[str, Messages]:
        parts: dict[str, list[_Row]] = {name: [] for name in self._ids.values()}
        by_id = {key: parts[name] for key, name in self._ids.items()}  # one topic may be listed several times
        for row in rows:
            by_id[row[0]].append(row)
        found = {}
        for topic, part in parts.items():
            if not part:
                continue
            _, payloads, stamps, _ = zip(*part, strict=True)
            if {*map(type, payloads)} != {bytes} or {*map(type, stamps)} != {int}:
                raise self._damaged("its table 'messages' has a row that holds no message")
            found[topic] = joined(payloads, np.array(stamps, np.int64), f"{self.name}: topic {topic!r:.80}")
        return found

    def _check_file(self) -> None:
        with readable(self.name):
            with self.path.open("rb") as file:
                head = file.read(100)
            self.size = self.path.stat().st_size
            for suffix in ("-wal", "-journal"):
                side = self.path.with_name(self.path.name + suffix)
                if side.exists() and side.stat().st_size:
                    raise InputError(
                        f"{self.name}: its recording was not closed, {side.name} holds a part of it; "
                        f"`sqlite3 {self.path.name} 'PRAGMA wal_checkpoint(TRUNCATE)'` puts it in place"
                    )
        if not head.startswith(SQLITE):
            raise InputError(f"{self.name}: not an SQLite file, it begins with other bytes")
        page = int.from_bytes(head[16:18], "big")
        pages = int.from_bytes(head[28:32], "big") if head[24:28] == head[92:96] else 0  # else outdated
        whole = max(pages * (65536 if page == 1 else page), 100)
        if self.size < whole:
            raise InputError(f"{self.name}: cut off, the SQLite file has {self.size} of {whole} bytes")

    @contextlib.contextmanager
    def _connected(self) -> Iterator[sqlite3.Connection]:
        uri = f"{self.path.absolute().as_uri()}?mode=ro&immutable=1"
        left = 16 + 16 * self.size // _OPERATIONS

        def stop() -> bool:
            nonlocal left
            left -= 1
            return left < 0

        try:
            with contextlib.closing(sqlite3.connect(uri, uri=True)) as connection:
                connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MESSAGE_BYTES)
                for setting in ("trusted_schema = OFF", "cell_size_check = ON", "mmap_size = 0"):
                    connection.execute(f"PRAGMA {setting}")
                connection.set_progress_handler(stop, _OPERATIONS)
                yield connection
        except sqlite3.DataError as error:
            limit = f"a message of more than {MESSAGE_BYTES >> 20} MiB"
            raise InputError(
                f"{self.name}: {limit} ({error}); joint data are read from smaller ones"
            ) from error
        except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
            what = "its pages run in circles" if left < 0 else detail_of(error)
            raise InputError(f"{self.name}: damaged, or not a bag ({what})") from error

    def _check_tables(self, connection: sqlite3.Connection) -> None:
        for table, columns in _REQUIRED.items():
            query = "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?"
            created = connection.execute(query, (table,)).fetchone()
            if created is None or not str(created[0]).upper().startswith("CREATE TABLE"):
                raise InputError(f"{self.name}: not a bag, the SQLite file has no table {table!r}")
            there = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
            for column in columns:
                if column not in there:
                    raise InputError(f"{self.name}: not a bag, its table {table!r} has no column {column!r}")

    def _read_topics(self, connection: sqlite3.Connection) -> dict[str, Topic]:
        definitions: dict[str, tuple[str, str]] = {}
        if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            for kind, encoding, text in connection.execute(f"{query} LIMIT {_MOST_ROWS}"):
                if isinstance(kind, str) and isinstance(encoding, str) and isinstance(text, str):
                    definitions[kind] = encoding, text
        topics: list[Topic] = []
        query = f"SELECT id, name, type, serialization_format FROM topics LIMIT {_MOST_ROWS}"
        for key, name, kind, encoding in connection.execute(query):
            if not (type(key) is int and all(isinstance(text, str) for text in (name, kind, encoding))):
                raise self._damaged(f"its table 'topics' has a row {(key, name, kind)!r:.80}")
            topics.append(Topic(name, kind, encoding, *definitions.get(kind, ("", ""))))
            self._ids[key] = name
        return merged(topics, self.name)
