"""Open input files safely, and limit their size: no pipes or devices, no control characters, no unbounded unpacking.

The limit on the unpacked size applies to every container, before memory or disk is allocated.
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
"""Largest nesting depth of a file's values, and number of parts of a TOML key; parsers take minutes or fail beyond it.
"""
MOST_BITS = 4096
"""Largest size of an integer; Python does not print much larger ones."""
TOML_BYTES, JSON_BYTES = 1 << 20, 64 << 20
_DOTTED = re.compile(rf"""(?:(?:(?<![\w-])[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{DEEPEST}}}""")


def open_input(path: Path) -> BufferedReader:
    """Open a file for reading.

    Raises:
        OSError: it cannot be opened, or is not a regular file (a pipe may never end).
    """
    number = os.open(
        path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)
    )  # otherwise opening a pipe waits for its writer
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(errno.EINVAL, "not a regular file")
    return open(number, "rb")


def read_input(path: Path, most_bytes: int) -> bytes:
    """Read a whole file.

    Raises:
        OSError: see ``open_input``, or it is larger than ``most_bytes``.
    """
    with open_input(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(errno.EFBIG, f"larger than {most_bytes >> 20} MiB")
    return content


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file, read in pieces.

    Raises:
        OSError: see ``open_input``.
    """
    with open_input(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML text.

    Raises:
        ValueError: it is not TOML, or see ``plain``.
        RecursionError: it is nested too deeply.
    """
    if _DOTTED.search(text):
        raise ValueError(f"a key has more than {DEEPEST} parts")
    return plain(tomllib.loads(text))


def plain(values: Any) -> Any:
    """Return the values unchanged if they are safe to print and search.

    Raises:
        ValueError: they have more than ``DEEPEST`` levels, or an integer of more than ``MOST_BITS`` bits.
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
    """Escape control characters, except those in ``keep``, so that a terminal may show the text."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else _escaped(c) for c in text)


def _escaped(character: str) -> str:
    """Escape as in Python; beyond ASCII also valid in TOML and JSON, because drafts of maps are printed."""
    escaped = ascii(character)[1:-1]
    return escaped if character < "\x80" else escaped.replace("\\x", "\\u00")


MOST_BYTES = 4 << 30
"""Largest unpacked size of a file, unless the file itself is larger."""
FREE_BYTES = 256 << 20
"""Unpacked size that is allowed for any file."""
LARGEST_RATIO = 100
"""Largest ratio of unpacked to packed bytes between these limits. Measured samples are noisy and rarely reach 10, even
in counts."""
GIB = 1 << 30

_CHOSEN: ContextVar[float | None] = ContextVar("max_unpacked_gib", default=None)


def set_max_unpacked(gib: float | None) -> None:
    """Set the largest unpacked size of any file [GiB]; a file's own size is always allowed.

    None means 100 times the file's size, at least 0.25 and at most 4 GiB.

    Raises:
        InputError: it is out of range.
    """
    if gib is not None and not 0 < gib <= 1e6:
        raise InputError(f"--max-unpacked is {gib:g}; it must be above 0 and at most 1e6 GiB")
    _CHOSEN.set(gib)


class Unpacked:
    """Counter of the unpacked size of one input: ``size`` so far [bytes]."""

    def __init__(self, where: str, stored_bytes: int) -> None:
        """Take the name of the input for messages, and its packed size [bytes]."""
        self.size, self._where, chosen = 0, where, _CHOSEN.get()
        usual = min(MOST_BYTES, max(FREE_BYTES, LARGEST_RATIO * stored_bytes))
        self._limit = max(stored_bytes, usual if chosen is None else chosen * GIB)

    def add(self, size: int) -> None:
        """Add a size [bytes], before or during unpacking.

        Raises:
            InputError: the total exceeds the limit.
        """
        self.size += size
        if self.size > self._limit:
            raise InputError(
                f"{self._where}: unpacks to at least {self.size / GIB:.4g} GiB; the limit is {self._limit / GIB:.4g} "
                "GiB, which --max-unpacked GIB changes (in Python: mocobot.set_max_unpacked)"
            )
