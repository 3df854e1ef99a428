"""Files that users name, and texts in them: no pipes or devices, nothing boundless, nothing that a terminal obeys.

Whatever its container, a file unpacks to so much and no more: what is beyond is refused before memory or disk is
taken for it.
"""

import errno
import hashlib
import os
import re
import stat
import tomllib
from contextvars import ContextVar
from io import BufferedReader
from pathlib import Path
from typing import Any

from estimator.errors import InputError

DEEPEST = 64
"""Most levels of a file's values, and parts of a key in TOML: beyond, parsers take minutes or fail."""
MOST_BITS = 4096
"""Longest whole number: Python does not print much larger ones."""
TOML_BYTES, JSON_BYTES = 1 << 20, 64 << 20
_DOTTED = re.compile(rf"""(?:(?:(?<![\w-])[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{DEEPEST}}}""")


def open_input(path: Path) -> BufferedReader:
    """Open a file to read.

    Raises:
        OSError: it cannot be, or is no regular file: a pipe may never end.
    """
    number = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))  # without, a pipe waits for its writer
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(errno.EINVAL, "not a regular file")
    return open(number, "rb")


def read_input(path: Path, most_bytes: int) -> bytes:
    """All of a file.

    Raises:
        OSError: see ``open_input``, or it is larger.
    """
    with open_input(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"larger than {most_bytes >> 20} MiB")
    return content


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, which is read piece by piece.

    Raises:
        OSError: see ``open_input``.
    """
    with open_input(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def parse_toml(text: str) -> dict[str, Any]:
    """Tables of TOML.

    Raises:
        ValueError: it is not TOML, or see ``plain``.
        RecursionError: it has too many levels.
    """
    if _DOTTED.search(text):
        raise ValueError(f"a key has more than {DEEPEST} parts")
    return plain(tomllib.loads(text))


def plain(values: Any) -> Any:
    """Values as they are, if they can be shown and searched.

    Raises:
        ValueError: they have more than ``DEEPEST`` levels, or a whole number of more than ``MOST_BITS`` bits.
    """
    level = [values]
    for _ in range(DEEPEST):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, dict | list):
                inner += value.values() if isinstance(value, dict) else value
            elif isinstance(value, int) and value.bit_length() > MOST_BITS:
                raise ValueError(f"a whole number has more than {MOST_BITS} bits")
        level = inner
    if level:
        raise ValueError(f"it has more than {DEEPEST} levels")
    return values


def printable(text: str, keep: str = "\n\t") -> str:
    """Text as a terminal may show it: control characters are escaped, but for a few."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else _escaped(c) for c in text)


def _escaped(character: str) -> str:
    """As Python has it, and beyond ASCII TOML and JSON, too: drafts of maps are printed."""
    escaped = ascii(character)[1:-1]
    return escaped if character < "\x80" else escaped.replace("\\x", "\\u00")


MOST_BYTES = 4 << 30
"""No file unpacks to more unless it is larger itself."""
FREE_BYTES = 256 << 20
"""Any file may unpack to so much: it does no harm."""
LARGEST_RATIO = 100
"""Between these, of unpacked to packed bytes. Measured samples are noisy and rarely reach 10, even in counts."""
GIB = 1 << 30

_CHOSEN: ContextVar[float | None] = ContextVar("max_unpacked_gib", default=None)


def set_max_unpacked(gib: float | None) -> None:
    """Choose how much any file may unpack to [GiB]; a file's own size is always allowed.

    None stands for 100 times the file's size, at least 0.25 and at most 4 GiB.

    Raises:
        InputError: it is out of range.
    """
    if gib is not None and not 0 < gib <= 1e6:
        raise InputError(f"--max-unpacked is {gib:g}; it must be above 0 and at most 1e6 GiB")
    _CHOSEN.set(gib)


class Unpacked:
    """Counts what one input unpacks to: ``size`` so far [bytes]."""

    def __init__(self, where: str, stored_bytes: int) -> None:
        """Take the name of the input for messages, and its size [bytes]."""
        self.size, self._where, chosen = 0, where, _CHOSEN.get()
        usual = min(MOST_BYTES, max(FREE_BYTES, LARGEST_RATIO * stored_bytes))
        self._limit = max(stored_bytes, usual if chosen is None else chosen * GIB)

    def add(self, size: int) -> None:
        """Count more [bytes], before or while it is unpacked.

        Raises:
            InputError: it is too much in all.
        """
        self.size += size
        if self.size > self._limit:
            raise InputError(
                f"{self._where}: unpacks to at least {self.size / GIB:.4g} GiB; the limit is {self._limit / GIB:.4g} "
                "GiB, which --max-unpacked GIB changes (in Python: mocobot.set_max_unpacked)"
            )
