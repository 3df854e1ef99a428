"""An MCAP file as runs of whole records: unpacked chunks, and windows of what lies between them."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode

from estimator.errors import InputError
from mocobot_logs.bag.messages import BLOCK_BYTES
from mocobot_logs.bag.unpack import CHUNK_BYTES, UnpackError, unpack

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
"""Opcode and length of every record."""
_CHUNK = struct.Struct("<QQQII")  # start, end, unpacked size, checksum, length of the compression's name
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary, summary offsets, checksum
_TAIL = _FOOTER.size + len(MAGIC)
_LOOSE = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
_NOT_LOOSE = (0, Opcode.CHUNK, Opcode.DATA_END, Opcode.FOOTER)
_WINDOW = 4 << 10


@dataclass(frozen=True, eq=False)
class Run:
    """Whole records, one after the other.

    Attributes:
        block: memory that begins with them.
        end: byte of the block at which they end.
        offset: place of the chunk or window in the file.
    """

    block: bytes
    end: int
    offset: int


class McapRuns:
    """An MCAP file that has both its ends.

    Attributes:
        name: what messages call it.
        size: bytes of the file.
    """

    def __init__(self, path: Path, name: str) -> None:
        """Check both ends.

        Raises:
            InputError: not a complete MCAP file.
        """
        self._path, self.name = path, name
        with self._open() as file:
            self.size, self._summary = self._check_ends(file)

    def data(self, advance: Callable[[int], object], window_bytes: int = BLOCK_BYTES) -> Iterator[Run]:
        """All that may hold messages, from front to back.

        Args:
            advance: takes the bytes read since the last call.
            window_bytes: largest window of loose records.

        Raises:
            InputError: the file is damaged.
        """
        at, told = len(MAGIC), 0
        end, window = self.size - len(MAGIC), _WINDOW
        with self._open() as file:
            while True:
                if end - at < HEAD.size:
                    raise self.damaged(at, "the data have no end")
                head = self._read(file, HEAD.size, at)
                opcode, length = HEAD.unpack(head)
                after = at + HEAD.size + length
                if after > end:
                    left = max(end - at - HEAD.size, 0)
                    raise self.damaged(at, f"a record claims {length} bytes, of which {left} are there")
                if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                    break
                if opcode == Opcode.CHUNK:
                    block = self._unpacked(file, length, at)
                    yield Run(block, len(block), at)
                elif opcode in _LOOSE:
                    if length > CHUNK_BYTES:
                        raise self.damaged(at, f"a record of {length} bytes")
                    block = head + self._read(file, max(length, min(window, end - at - HEAD.size)))
                    last, stopped = _loose(block)
                    yield Run(block, last, at)
                    after = at + last
                    # Small steps where chunks and loose records alternate: what is read twice stays in proportion.
                    window = _WINDOW if stopped else min(2 * window, max(window_bytes, _WINDOW))
                elif not opcode:
                    raise self.damaged(at, "a record of no kind")
                advance(after - told)
                at = told = after
        advance(self.size - told)

    def summary(self) -> Run | None:
        """The summary at the end, if the file has one.

        Raises:
            InputError: the file is damaged.
        """
        if not self._summary:
            return None
        length = self.size - _TAIL - self._summary
        if length > CHUNK_BYTES:
            raise self.damaged(self._summary, f"a summary of {length} bytes")
        with self._open() as file:
            return Run(self._read(file, length, self._summary), length, self._summary)

    def damaged(self, offset: int, what: str) -> InputError:
        """The error for what is found at a byte of the file."""
        return InputError(f"{self.name}: damaged at byte {offset}, {what}")

    def _open(self) -> BinaryIO:
        try:
            return self._path.open("rb")
        except OSError as error:
            raise InputError(f"{self.name}: cannot be read ({error.strerror or error})") from error

    def _read(self, file: BinaryIO, length: int, at: int | None = None) -> bytes:
        """So many bytes from where the file is, or from ``at``; the caller knows that the file has them."""
        try:
            if at is not None:
                file.seek(at)
            content = file.read(length)
        except OSError as error:
            raise InputError(f"{self.name}: cannot be read ({error.strerror or error})") from error
        if len(content) < length:
            raise InputError(f"{self.name}: became shorter while it was read")
        return content

    def _check_ends(self, file: BinaryIO) -> tuple[int, int]:
        """Size of the file, and where its summary begins (0: it has none)."""
        size = os.fstat(file.fileno()).st_size
        if size < len(MAGIC) or self._read(file, len(MAGIC)) != MAGIC:
            raise InputError(f"{self.name}: not an MCAP file, it begins with other bytes")
        tail = self._read(file, _TAIL, size - _TAIL) if size >= len(MAGIC) + _TAIL else b""
        if not tail.endswith(MAGIC):
            raise InputError(
                f"{self.name}: cut off, the MCAP file has no end; if its recording was interrupted, "
                "`mcap recover` saves what is there"
            )
        opcode, length, summary, _, _ = _FOOTER.unpack_from(tail)
        if opcode != Opcode.FOOTER or length != _FOOTER.size - HEAD.size:
            raise self.damaged(size - _TAIL, "where the footer should be")
        if summary and not len(MAGIC) <= summary <= size - _TAIL:
            raise self.damaged(size - _TAIL, f"the footer says that the summary is at byte {summary}")
        return size, summary

    def _unpacked(self, file: BinaryIO, length: int, at: int) -> bytes:
        if length > 2 * CHUNK_BYTES or length < _CHUNK.size + 8:
            raise self.damaged(at, f"a chunk of {length} bytes")
        content = self._read(file, length)
        _, _, size, checksum, named = _CHUNK.unpack_from(content)
        begin = _CHUNK.size + named + 8
        if (
            begin > length
            or (stored := int.from_bytes(content[begin - 8 : begin], "little")) > length - begin
        ):
            raise self.damaged(at, "a chunk claims more bytes than it has")
        compression = content[_CHUNK.size : begin - 8].decode(errors="replace")
        try:
            block = unpack(content[begin : begin + stored], compression, size)
        except UnpackError as error:
            raise self.damaged(at, f"the chunk {error}") from error
        if checksum and zlib.crc32(block) != checksum:
            raise self.damaged(at, "the chunk's checksum does not agree")
        return block


def _loose(block: bytes) -> tuple[int, bool]:
    """End of the records at the head of a block that are whole, and whether a chunk or the end stops them."""
    at = 0
    while at + HEAD.size <= len(block):
        opcode, length = HEAD.unpack_from(block, at)
        if opcode in _NOT_LOOSE:
            return at, True
        after = at + HEAD.size + length
        if after > len(block):
            break
        at = after
    return at, False
