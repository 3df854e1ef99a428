"""How much a file may hold that describes something."""

from pathlib import Path

from estimator.errors import InputError
from estimator.inputs import open_input
from mocobot_logs.faults import readable


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
