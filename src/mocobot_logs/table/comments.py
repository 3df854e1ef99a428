"""A text file without the lines that begin with ``#``."""

import re
from typing import BinaryIO

_COMMENT = re.compile(rb"^[ \t]*#.*\n?", re.MULTILINE)
_BLOCK_BYTES = 1 << 20
_LONGEST_LINE = 8 << 20
"""A longer line is handed on as it is, for the reader to refuse."""


class WithoutComments:
    """What ``pyarrow`` reads of a file: its bytes without the lines whose first character but blanks is ``#``."""

    def __init__(self, file: BinaryIO) -> None:
        """Take the file where a line begins."""
        self._file = file
        self._ready, self._open = b"", b""
        self.closed = False

    def read(self, size: int) -> bytes:
        """At most so many bytes, none at the end."""
        while not self._ready:
            block = self._file.read(_BLOCK_BYTES)
            lines = self._open + block
            end = lines.rfind(b"\n") + 1 if block and len(lines) < _LONGEST_LINE else len(lines)
            self._ready, self._open = lines[:end], lines[end:]
            if b"#" in self._ready:
                self._ready = _COMMENT.sub(b"", self._ready)
            if not block:
                break
        given, self._ready = self._ready[:size], self._ready[size:]
        return given

    def tell(self) -> int:
        """How far the file is read."""
        return self._file.tell()

    def close(self) -> None:
        """The file is its owner's to close."""
        self.closed = True
