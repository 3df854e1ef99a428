"""Functions compiled with numba, whose machine code is kept for the next process; as they are where numba is not.

numba keeps it in the folder ``NUMBA_CACHE_DIR`` if that is set, else beside the source, else, where an installation
cannot be written, in the user's cache folder. Where none of them can be written, every process compiles again.

Without numba (``pip install 'mocobot[fast]'`` brings it) Python itself does the same arithmetic, to the same bits. It
reads arrays through memoryviews: those give plain floats, with which Python is faster than with numpy's. A function
that is compiled here therefore indexes arrays to the last axis (``a[i, k]``, never ``a[i]``).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

try:
    from numba import njit
except ImportError:
    njit = None


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function when it is first called, without Python's lock while it runs; nothing without numba."""
    if njit is None:
        return function
    try:
        return njit(cache=True, nogil=True)(function)
    except RuntimeError:  # no folder can be written
        return njit(nogil=True)(function)


def entry(function: Callable[..., Any]) -> Callable[..., Any]:
    """``compiled``, for what is called with arrays; they are changed in place."""
    if njit is not None:
        return compiled(function)

    def called(*given: Any) -> Any:
        return function(*[one.data if isinstance(one, np.ndarray) else one for one in given])

    return called
