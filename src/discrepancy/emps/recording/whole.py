"""Whether a MATLAB file is whole: scipy's reader crashes the interpreter on some that are cut off."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from estimator.inputs import Unpacked, open_input

HEADER_BYTES, TAG_BYTES = 128, 8
COMPRESSED = 15
"""Type of an element that zlib packed."""
_STEP = 1 << 20


def is_whole(path: Path) -> bool:
    """Whether every element of a file's top level ends within it, as far as its header says that it has such.

    Level 5 MAT-files ("MAT-File Format", The MathWorks, 2024, "MAT-File Structure") are a header of 128 bytes, which
    ends with version and byte order, and elements: type and number of bytes, then so many bytes. A file of another
    format is left to its reader.

    Raises:
        OSError: it cannot be read.
        InputError: it unpacks to too much.
    """
    size = path.stat().st_size
    unpacked = Unpacked(str(path), size)
    with open_input(path) as file:
        header = file.read(HEADER_BYTES)
        order = {b"IM": "<", b"MI": ">"}.get(header[126:])
        if order is None or struct.unpack(f"{order}H", header[124:126]) != (0x0100,):
            return True
        at = HEADER_BYTES
        while at < size:
            file.seek(at)
            tag = file.read(TAG_BYTES)
            if len(tag) < TAG_BYTES:
                return False
            kind, count = struct.unpack(f"{order}II", tag)
            at += TAG_BYTES + count
            if kind == COMPRESSED and at <= size:
                packed, stream = file.read(count), zlib.decompressobj()
                while packed:
                    unpacked.add(len(stream.decompress(packed, _STEP)))
                    packed = stream.unconsumed_tail
    return at == size
