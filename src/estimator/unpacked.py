"""How much a file may unpack to, whatever its container: more is refused before memory or disk is taken for it."""

from contextvars import ContextVar

from estimator.errors import InputError

MOST_BYTES = 4 << 30
"""No file unpacks to more unless it is larger itself."""
FREE_BYTES = 256 << 20
"""Any file may unpack to so much: it does no harm."""
LARGEST_RATIO = 100
"""Between these, of unpacked to packed bytes. Measured samples are noisy and rarely reach 10, even in counts."""
GIB = 1 << 30

_CHOSEN: ContextVar[float | None] = ContextVar("max_unpacked_gib", default=None)


def set_max_unpacked(gib: float | None) -> None:
    """Choose how much any file may unpack to; a file's own size is always allowed.

    Args:
        gib: the limit [GiB], or None for 100 times the file's size, at least 0.25 and at most 4 GiB.

    Raises:
        InputError: it is out of range.
    """
    if gib is not None and not 0 < gib <= 1e6:
        raise InputError(f"--max-unpacked is {gib:g}; it must be above 0 and at most 1e6 GiB")
    _CHOSEN.set(gib)


class Unpacked:
    """Counts what one input unpacks to.

    Attributes:
        size: so far [bytes].
    """

    def __init__(self, where: str, stored_bytes: int) -> None:
        """Take the name of the input for messages, and its size [bytes]."""
        self.size, self._where, chosen = 0, where, _CHOSEN.get()
        usual = min(MOST_BYTES, max(FREE_BYTES, LARGEST_RATIO * stored_bytes))
        self._limit = max(stored_bytes, usual if chosen is None else chosen * GIB)

    def add(self, size: int) -> None:
        """Count more, before or while it is unpacked.

        Args:
            size: claimed or unpacked [bytes].

        Raises:
            InputError: it is too much in all.
        """
        self.size += size
        if self.size > self._limit:
            raise InputError(
                f"{self._where}: unpacks to at least {self.size / GIB:.4g} GiB; the limit is {self._limit / GIB:.4g} "
                "GiB, which --max-unpacked GIB changes (in Python: mocobot.set_max_unpacked)"
            )
