"""Functions compiled with numba, whose machine code is kept for the next process.

numba keeps it in the folder ``NUMBA_CACHE_DIR`` if that is set, else beside the source, else, where an installation
cannot be written, in the user's cache folder. Where none of them can be written, every process compiles again.
"""

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function when it is first called, without Python's lock while it runs."""
    try:
        return njit(cache=True, nogil=True)(function)
    except RuntimeError:  # no folder can be written
        return njit(nogil=True)(function)
