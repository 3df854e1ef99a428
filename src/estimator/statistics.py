"""Root mean squares, and rounding of values to their standard errors."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def decimals(se: float) -> int:
    """Return the decimals down to the second digit of a standard error, finite and above 0; negative above 100."""
    return 1 - math.floor(math.log10(se))


def measured(value: float, se: float) -> tuple[str, str]:
    """Format value and standard error, both to the second digit of the error, with 0 to 9 decimals."""
    digits = min(max(decimals(se), 0), 9)
    return f"{value:.{digits}f}", f"{se:.{digits}f}"


def rms(x: ArrayLike) -> float:
    """Return the root mean square of all entries, in their unit."""
    return float(np.sqrt(np.mean(np.square(x))))


def rms_length(vectors: NDArray[np.float64]) -> float:
    """Return the root mean square of the lengths of vectors, shape (Q, K), in their unit."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
