"""Simulate mobile cobots that carry an unknown payload, estimate it, and find out what the simulation gets wrong.

The names in ``__all__`` are the public ones (docs/api.md), listed in ``__init__.pyi``; each is imported when it is
first used, so that ``import mocobot`` costs nothing.
"""

from __future__ import annotations

import os
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any


def _one_thread() -> None:
    """One thread for matrices: how many there are decides how sums round.

    The matrices are small, too: threads that fight over them make a diagnosis several times slower on a busy machine.
    OpenBLAS reads the variable when it is loaded; where numpy or scipy is there already, its own must be told.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    for name in ("numpy.linalg._umath_linalg", "scipy.linalg._fblas"):
        if name.partition(".")[0] in sys.modules:
            import ctypes  # takes longer than the rest of ``import mocobot``

            library = ctypes.CDLL(import_module(name).__file__)  # names are looked up in what it links, too
            for kind in ("scipy_openblas_%s64_", "scipy_openblas_%s", "openblas_%s64_", "openblas_%s"):
                if hasattr(library, kind % "set_num_threads"):
                    getattr(library, kind % "set_num_threads")(1)


_one_thread()

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOMES = {name: home for home, name in re.findall(r"^from (\S+) import (\w+) as", _STUB, re.MULTILINE)}
"""The module that defines each public name; modules of this package are themselves public."""

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """A public name, imported now (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES[name]
    found = import_module(f"{home}.{name}") if home == __name__ else getattr(import_module(home), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """What a notebook completes."""
    return sorted(__all__)
