"""Root mean squares."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def rms(x: ArrayLike) -> float:
    """Root mean square of all entries, in their unit."""
    return float(np.sqrt(np.mean(np.square(x))))


def rms_length(vectors: NDArray[np.float64]) -> float:
    """Root mean square of the lengths of vectors, shape (Q, K), in their unit."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
