"""What campaigns of all machines share: scores of probabilities, settings changed one by one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, replace

import numpy as np

from discrepancy.evidence.settings import SETTINGS, Settings

SURE = 0.9
"""Probability from which something named and not there is falsely certain."""
LEAST = 1e-3
"""Least probability that a score takes: the engine's own numbers are not good to more."""
CHANGED = 10
"""Settings that are changed for a set."""
AS_THEY_ARE = "as they are"
"""Settings of which none is changed, in words."""


def log_score(stated: Sequence[tuple[float, bool]]) -> float:
    """Mean log of the probability that was given to what is so [nats]: 0 at best; nan where nothing was named.

    Args:
        stated: probability of everything that was named, and whether it is there.
    """
    told = [np.clip(p if right else 1.0 - p, LEAST, 1.0) for p, right in stated]
    return float(np.mean(np.log(told))) if told else float("nan")


def median_and_most(values: Iterable[float], digits: int = 1) -> str:
    """Of seconds or gigabytes, as a cell of a table."""
    each = list(values)
    return f"{np.median(each):.{digits}f}, {max(each):.{digits}f}" if each else "-"


def changed_settings(seed: int, factor: float) -> Iterator[tuple[str, Settings]]:
    """Settings of which one is ``factor`` times what it is, each with what it says in words.

    Args:
        seed: draws which ten.
        factor: 0.5 or 2; whole numbers stay whole, and one at least.
    """
    for name in map(
        str, np.random.default_rng(seed).permutation([f.name for f in fields(Settings)])[:CHANGED]
    ):
        own = getattr(SETTINGS, name)
        other = max(1, round(factor * own)) if isinstance(own, int) else factor * own
        yield f"{name} {own:g} -> {other:g}", replace(SETTINGS, **{name: other})
