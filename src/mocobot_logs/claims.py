"""How much a file may hold, or claim to hold, before it is taken for a bomb."""

from pathlib import Path

from estimator.errors import InputError
from estimator.inputs import open_input
from mocobot_logs.faults import readable

FREE_BYTES = 256 << 20
"""Up to here any claim is read: it does no harm."""
LARGEST_RATIO = 100
"""Of unpacked to packed bytes beyond ``FREE_BYTES``. Measured samples are noisy and rarely reach 10, even in counts."""


def check_claim(claimed_bytes: int, stored_bytes: int, where: str) -> None:
    """Refuse what would unpack to far more than measured samples can.

    Args:
        claimed_bytes: what the file says it holds, unpacked.
        stored_bytes: what it takes in the file.
        where: what holds it, for the message.

    Raises:
        InputError: the claim is beyond ``FREE_BYTES`` and ``LARGEST_RATIO``.
    """
    if claimed_bytes > max(FREE_BYTES, LARGEST_RATIO * stored_bytes):
        raise InputError(
            f"{where} claims {claimed_bytes / 2**30:.3g} GiB in {stored_bytes / 2**20:.3g} MiB of the file; "
            f"more than {LARGEST_RATIO} times is no measured log"
        )


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
