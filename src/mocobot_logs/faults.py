"""What a library says of damaged bytes, fit for one sentence on a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from estimator.errors import InputError
from estimator.files import system_errors
from estimator.inputs import open_input, printable

LONGEST = 200
readable = partial(system_errors, done="read")
"""A block in which what the operating system refuses becomes one sentence: that a file cannot be read."""


def read_small(path: Path, most_bytes: int, where: str, kind: str) -> bytes:
    """All of a file that describes something.

    Args:
        path: the file.
        most_bytes: more are not read.
        where: what messages call the file.
        kind: what it should be, for the message.

    Raises:
        InputError: it is larger, or cannot be read.
    """
    with readable(where), open_input(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise InputError(f"{where}: is larger than {most_bytes >> 20} MiB, which no {kind} is")
    return content


def detail_of(error: BaseException) -> str:
    """The first line of an error's message, or its type where there is none: printable and short."""
    lines = str(error).splitlines()
    return shown(lines[0].strip() if lines else "", LONGEST) or type(error).__name__


def shown(text: str, longest: int = 60) -> str:
    """Text of a file as a terminal may show it."""
    return printable(text[:longest], keep="")[:longest]


@contextmanager
def told_in_one_sentence(where: str, kind: str) -> Iterator[None]:
    """Whatever a library raises inside the block on a file of some kind, as one sentence.

    Raises:
        InputError: a file is not of that kind, or damaged, or cannot be read.
    """
    try:
        yield
    except InputError:
        raise
    except PermissionError as error:
        raise InputError(f"{where}: cannot be read (permission denied)") from error
    except Exception as error:  # on damaged bytes libraries raise many types, not all of them their own
        raise InputError(f"{where}: not a readable {kind}, or a damaged one ({detail_of(error)})") from error
