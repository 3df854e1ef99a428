"""Columns that are there for a while, as whole arrays and as patches."""

import numpy as np

from discrepancy.team.linear.rows import Patches


def patchwork(rng, rows, channels, spans, firsts):
    """Two columns each in some of the rows and from some channel on, shape (rows, channels, k), and as patches."""
    whole, parts = [], []
    for (start, stop), first in zip(spans, firsts, strict=True):
        x = np.zeros((rows, channels, 2))
        x[start:stop, first:] = rng.standard_normal((stop - start, channels - first, 2))
        whole.append(x)
        parts.append(Patches.of(x))
    return np.concatenate(whole, axis=2), Patches((rows, channels)).beside(parts)


def dense(patches):
    """The same columns as one array, shape (n, C, k)."""
    out, at = np.zeros((*patches.shape, patches.width)), 0
    for patch in patches.each:
        stop = at + patch.values.shape[2]
        out[patch.rows, patch.first :, at:stop] = patch.values
        at = stop
    return out
