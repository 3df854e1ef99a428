"""A text file in blocks of whole lines, without the lines that begin with ``#``."""

import re
from collections.abc import Iterator
from typing import BinaryIO

_COMMENT = re.compile(rb"^[ \t]*#.*\n?", re.MULTILINE)


def line_blocks(file: BinaryIO, size: int) -> Iterator[bytes]:
    """Blocks of whole lines, none of them empty, without those whose first character but blanks is ``#``.

    Args:
        file: read from where it is, where a line begins.
        size: about how long blocks are [bytes]; a line of more than twice this is cut where it is so long.
    """
    rest = b""
    while block := file.read(size):
        lines = rest + block
        end = lines.rfind(b"\n") + 1
        if not end and len(lines) > 2 * size:
            end = len(lines)
        if ready := _without_comments(lines[:end]):
            yield ready
        rest = lines[end:]
    if ready := _without_comments(rest):
        yield ready


def _without_comments(lines: bytes) -> bytes:
    return _COMMENT.sub(b"", lines) if b"#" in lines else lines
