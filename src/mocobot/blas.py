"""One thread for matrices, whatever the environment says: how many there are decides how sums round."""

import os
import sys
from importlib import import_module


def one_thread() -> None:
    """OpenBLAS reads the variable when it is loaded; where numpy or scipy is there already, its own must be told."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    for name in ("numpy.linalg._umath_linalg", "scipy.linalg._fblas"):
        if name.partition(".")[0] in sys.modules:
            import ctypes  # takes longer than the rest of ``import mocobot``

            library = ctypes.CDLL(import_module(name).__file__)  # names are looked up in what it links, too
            for kind in ("scipy_openblas_%s64_", "scipy_openblas_%s", "openblas_%s64_", "openblas_%s"):
                if hasattr(library, kind % "set_num_threads"):
                    getattr(library, kind % "set_num_threads")(1)
