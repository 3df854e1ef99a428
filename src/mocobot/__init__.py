"""Find what a robot's simulation model gets wrong; simulate, estimate and calibrate teams of mobile cobots.

``__all__`` lists the public names (docs/api.md), which ``__init__.pyi`` declares. Each name is imported at its first
use, so that ``import mocobot`` is fast.
"""

from __future__ import annotations

import os
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any


def _one_thread() -> None:
    """Restrict OpenBLAS to one thread, because the number of threads changes how sums round.

    The matrices are small, so more threads would also slow down a diagnosis on a busy machine. OpenBLAS reads the
    variable when it is loaded. If numpy or scipy is already loaded, the function calls OpenBLAS directly.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    for name in ("numpy.linalg._umath_linalg", "scipy.linalg._fblas"):
        if name.partition(".")[0] in sys.modules:
            import ctypes  # takes longer than the rest of ``import mocobot``

            library = ctypes.CDLL(import_module(name).__file__)  # also finds symbols in its linked libraries
            for kind in ("scipy_openblas_%s64_", "scipy_openblas_%s", "openblas_%s64_", "openblas_%s"):
                if hasattr(library, kind % "set_num_threads"):
                    getattr(library, kind % "set_num_threads")(1)


_one_thread()

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOMES = {name: home for home, name in re.findall(r"^from (\S+) import (\w+) as", _STUB, re.MULTILINE)}
"""Module that defines each public name; submodules of this package are public themselves."""

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """Import a public name at its first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES[name]
    found = import_module(f"{home}.{name}") if home == __name__ else getattr(import_module(home), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """List the public names, for completion."""
    return sorted(__all__)
