"""Topics and blocks of serialised messages of a bag, and decompression with bounded memory."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.inputs import Unpacked
from mocobot_logs.formats import detail_of, shown
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
