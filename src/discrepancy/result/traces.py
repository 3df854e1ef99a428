"""Residuals as a plot wants them: over time, in physical units and in multiples of clean noise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.channel import Channel
from discrepancy.numbers import Shown, one_each
from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Trace:
    """One trial's residual without and with the named causes; C channels.

    Attributes:
        name: the trial.
        time: of every row [s], shape (n,).
        moving: number of leading rows that are a series; the others are means of holds.
        rate_hz: of the series.
        before, after: physical residuals, shape (n, C).
        sigma: standard deviations of clean data, shape (n, C).
        white_before, white_after: whitened residuals, shape (n, C); unit variance if clean.
        quantities: what a misfit may depend on, shape (n,) each.
    """

    name: str
    time: Array
    moving: int
    rate_hz: float
    before: Array
    after: Array
    sigma: Array
    white_before: Array
    white_after: Array
    quantities: dict[str, Array]


@dataclass(frozen=True)
class Group:
    """Channels that are shown together, such as the three components of a force.

    Attributes:
        name: such as ``grasp 2 rotation``.
        unit: of the physical residual.
        columns: their indices.
        components: what tells them apart, such as x, y, z.
    """

    name: str
    unit: str
    columns: tuple[int, ...]
    components: tuple[str, ...]


def group_units(traces: Sequence[Trace], grouped: Sequence[Group]) -> dict[str, Shown]:
    """For every unit of some channels the one in which all of them are shown, by the largest rms as simulated."""
    return one_each(
        (group.unit, float(np.sqrt(np.mean(trace.before[:, k] ** 2))))
        for trace in traces for group in grouped for k in group.columns
    )  # fmt: skip


def groups(channels: Sequence[Channel]) -> list[Group]:
    """Channels whose names differ in the last word only."""
    found: dict[str, list[int]] = {}
    for k, channel in enumerate(channels):
        stem, _, last = channel.name.rpartition(" ")
        found.setdefault(stem or last, []).append(k)
    return [
        Group(name, channels[at[0]].unit, tuple(at), tuple(channels[k].name.split()[-1] for k in at))
        for name, at in found.items()
    ]
