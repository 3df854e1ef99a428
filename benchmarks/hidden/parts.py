"""Which sets each part of the campaign consists of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from discrepancy.team.causes import CAUSES
from hidden.generator import PAYLOADS, HiddenSet, Kind
from hidden.logger import Logger
from hidden.schedule import SHORT, Schedule

Part = Literal["clean", "tolerance", "single", "pairs", "leave-one-out", "logs", "hidden-in-logs"]
LEFT_OUT_FACTOR = 4.0


@dataclass(frozen=True)
class Task:
    """One diagnosis to run.

    Attributes:
        part: of the campaign.
        request: the set.
        excluded: causes left out of the diagnosis' catalogue.
    """

    part: Part
    request: HiddenSet
    excluded: tuple[str, ...] = ()


def tasks(
    part: Part,
    seeds: Sequence[int],
    factors: Sequence[float],
    causes: Sequence[str],
    *,
    background: bool,
    preset: str = "nominal",
) -> list[Task]:
    """All tasks of a part; payloads of clean and tolerance sets take turns, others are drawn."""
    names = list(causes) or list(CAUSES)
    if part in ("clean", "tolerance"):
        return [
            Task(part, HiddenSet(part, seed, payload=PAYLOADS[seed % len(PAYLOADS)], preset=preset))
            for seed in seeds
        ]
    if part == "pairs":
        return [
            Task(part, HiddenSet("pair", seed, _pair(seed), background=background, preset=preset))
            for seed in seeds
        ]
    if part == "logs":
        return [Task(part, _logged("clean", seed, (), background)) for seed in seeds]
    if part == "hidden-in-logs":  # the causes take turns
        return [
            Task(part, _logged("single", seed, (names[seed % len(names)],), background)) for seed in seeds
        ]
    if part == "leave-one-out":
        factors = [LEFT_OUT_FACTOR]
    return [
        Task(
            part,
            HiddenSet("single", seed, (cause,), factor, background=background, preset=preset),
            (cause,) if part == "leave-one-out" else (),
        )
        for seed in seeds
        for factor in factors
        for cause in names
    ]


def _pair(seed: int) -> tuple[str, str]:
    """Two causes of different families."""
    rng = np.random.default_rng([seed, *b"pair"])
    first = str(rng.choice(list(CAUSES)))
    others = [cause for cause in CAUSES if CAUSES[cause].family != CAUSES[first].family]
    return first, str(rng.choice(others))


def _logged(kind: Kind, seed: int, causes: tuple[str, ...], background: bool) -> HiddenSet:
    """A set from a logger of its own; payloads and kinds of trials take turns."""
    rng = np.random.default_rng([seed, *b"logger"])
    payload = PAYLOADS[seed % len(PAYLOADS)]
    # What is healthy in two trials is so in four; what is hidden has to help on trials that it was not fitted to.
    schedule = Schedule() if causes else SHORT[seed // len(PAYLOADS) % len(SHORT)]
    logger = Logger.draw(rng)
    if any(CAUSES[cause].by_clocks for cause in causes):  # the conversion would take it out
        logger = replace(logger, offset_s=0.0, drift=0.0)
    return HiddenSet(
        kind, seed, causes, payload=payload, schedule=schedule, logger=logger, background=background
    )
