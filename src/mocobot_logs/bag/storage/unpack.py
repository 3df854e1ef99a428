"""Decompression that never makes more than was claimed, and refuses claims that are too large."""

from pathlib import Path

import lz4.frame
import zstandard

from estimator.errors import InputError
from estimator.inputs import Unpacked
from mocobot_logs.faults import detail_of

CHUNK_BYTES = 256 << 20
"""Largest chunk of a file that is unpacked in memory; recorders write chunks of about 1 MiB."""
_STEP = 1 << 20


class UnpackError(ValueError):
    """What was to be unpacked is damaged, or larger than it may be; says what is wrong, not where."""


def unpack(data: bytes, compression: str, size: int) -> bytes:
    """Unpack a chunk whose size is known.

    Args:
        data: packed bytes.
        compression: "" (none), "zstd" or "lz4", as MCAP names them.
        size: unpacked size [bytes].

    Raises:
        UnpackError: unknown compression, damaged data, or another size.
    """
    if size > CHUNK_BYTES:
        raise UnpackError(f"claims {size} bytes; chunks of at most {CHUNK_BYTES >> 20} MiB are read")
    try:
        if compression == "":
            unpacked = data
        elif compression == "zstd":
            unpacked = _zstd(data, size)
        elif compression == "lz4":
            unpacked = _lz4(data, size)
        else:
            raise UnpackError(f"is compressed by {compression!r:.40}; it must be zstd, lz4 or not compressed")
    except (zstandard.ZstdError, RuntimeError) as error:  # lz4 raises RuntimeError
        raise UnpackError(f"does not unpack ({detail_of(error)})") from error
    if len(unpacked) != size:
        more = "more" if len(unpacked) > size else f"{len(unpacked)}"
        raise UnpackError(f"claims {size} bytes unpacked, but holds {more}")
    return unpacked


def unpack_message(data: bytes, limit: int) -> bytes:
    """Unpack one message that was compressed by itself (zstd).

    Raises:
        UnpackError: damaged, or larger than ``limit`` bytes.
    """
    try:
        size = zstandard.frame_content_size(data)
        unpacked = _zstd(data, limit if size < 0 else min(size, limit))
    except zstandard.ZstdError as error:
        raise UnpackError(f"does not unpack ({detail_of(error)})") from error
    if size > limit or len(unpacked) > limit:
        raise UnpackError(f"unpacks to more than {limit >> 20} MiB")
    return unpacked


def unpack_file(source: Path, target: Path, heads: tuple[bytes, ...], name: str, unpacked: Unpacked) -> None:
    """Unpack a file of a bag that was compressed as a whole (zstd).

    Args:
        source: packed file.
        target: where to unpack it.
        heads: first bytes that the unpacked file may have.
        name: what messages call it.
        unpacked: counts.

    Raises:
        InputError: damaged, not one of ``heads``, too much in all, or there is no room for it.
    """
    done = 0
    try:
        with (
            source.open("rb") as packed,
            target.open("wb") as out,
            zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as stream,
        ):
            while block := stream.read(_STEP):
                if not done and not block.startswith(heads):
                    raise InputError(f"{name}: what it unpacks to is neither an MCAP nor an SQLite file")
                done += len(block)
                unpacked.add(len(block))
                out.write(block)
    except zstandard.ZstdError as error:
        raise InputError(f"{name}: damaged, does not unpack ({detail_of(error)})") from error
    except OSError as error:
        raise InputError(
            f"{name}: cannot be unpacked into {target.parent} ({error.strerror or error})"
        ) from error
    if not done:
        raise InputError(f"{name}: unpacks to nothing, or is cut off")


def _zstd(data: bytes, size: int) -> bytes:
    """At most ``size`` bytes and one more."""
    unpacker = zstandard.ZstdDecompressor()
    if zstandard.frame_content_size(data) == size:  # three times as fast as a stream
        return unpacker.decompress(data, max_output_size=size) if size else b""
    with unpacker.stream_reader(data, read_across_frames=True) as stream:
        return stream.read(size + 1)


def _lz4(data: bytes, size: int) -> bytes:
    """At most ``size`` bytes and one more."""
    stream = lz4.frame.LZ4FrameDecompressor()
    unpacked = stream.decompress(data, max_length=size + 1)
    if not stream.eof and len(unpacked) <= size:
        raise UnpackError("is cut off")
    return unpacked
