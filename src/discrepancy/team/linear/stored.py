"""Arrays in temporary files that the system maps: long recordings need no more memory than what is worked on."""

from __future__ import annotations

import mmap
import tempfile
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Kind = TypeVar("Kind", bound=np.generic)


def stored(x: NDArray[Kind]) -> NDArray[Kind]:
    """The same numbers, to be read only, in a file that is gone with the array; where no file can be, the array.

    They lie as they did: where components are apart in memory, sums over them have the same bits.
    """
    if not x.size or is_stored(x):
        return x
    order = np.argsort([-stride for stride in x.strides], kind="stable")
    apart = x.transpose(order)
    try:
        with tempfile.TemporaryFile() as file:
            np.ascontiguousarray(apart).tofile(file)
            file.flush()
            pages = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError:  # a full disk
        return x
    return np.frombuffer(pages, dtype=x.dtype).reshape(apart.shape).transpose(np.argsort(order))


def is_stored(x: NDArray[np.generic]) -> bool:
    """Whether an array, or what it is a view of, is in a file."""
    return _pages(x) is not None


def given_back(*arrays: NDArray[np.generic]) -> None:
    """Let the system take the memory of arrays that are stored, until they are read again; others stay."""
    for x in arrays:
        pages = _pages(x)
        if pages is not None and hasattr(mmap, "MADV_DONTNEED"):
            pages.madvise(mmap.MADV_DONTNEED)


def _pages(x: object) -> mmap.mmap | None:
    """What an array is a view of, where it is stored."""
    while isinstance(x, np.ndarray):
        x = x.base
    x = x.obj if isinstance(x, memoryview) else x
    return x if isinstance(x, mmap.mmap) else None
