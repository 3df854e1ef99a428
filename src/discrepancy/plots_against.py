"""The residual against speed, position, load and frequency, in multiples of clean data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray
from scipy.signal import welch

from discrepancy.traces import Group, Trace
from discrepancy.words import Words

Array = NDArray[np.float64]

BEFORE, AFTER = "#c8553d", "#2f6fd0"
BINS = 12
SEGMENT_S = 10.0
SERIES = (("as simulated", "white_before", BEFORE), ("with causes and tolerances", "white_after", AFTER))


def against_figure(traces: Sequence[Trace], grouped: Sequence[Group], words: Words, *, named: bool) -> Figure:
    """One row per group of channels, one column per quantity; all trials together."""
    quantities = list(traces[0].quantities)
    columns = len(quantities) + 1
    figure = Figure(figsize=(3.9 * columns, 1.9 * len(grouped) + 0.9), layout="constrained")
    axes = figure.subplots(len(grouped), columns, squeeze=False, sharex="col")
    for row, group in zip(axes, grouped, strict=True):
        tops = [_binned(axis, traces, group, name) for axis, name in zip(row, quantities, strict=False)]
        tops.append(_spectrum(row[-1], traces, group))
        for axis in row:
            axis.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
            axis.grid(alpha=0.25)
            if max(tops) > 8.0:
                axis.set_yscale("log")
                axis.set_ylim(0.3, 1.6 * max(tops))
                axis.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
            else:
                axis.set_ylim(0.0, max(2.0, 1.15 * max(tops)))
        row[0].set_ylabel(f"{group.name}\n[clean = 1]", fontsize=9)
    for axis, name in zip(axes[-1], quantities, strict=False):
        axis.set_xlabel(f"{name} [{words.unit(name)}]")
    axes[-1][-1].set_xlabel("frequency [Hz]")
    handles, labels = axes[0][0].get_legend_handles_labels()
    labels[-1] = "with causes and tolerances" if named else "with tolerances"
    figure.legend(handles, labels, loc="outside upper right", ncols=2, frameon=False, fontsize=9)
    title = "Residual (whitened rms) in multiples of clean data" + ("" if named else "; nothing is named")
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def _binned(axis: Axes, traces: Sequence[Trace], group: Group, name: str) -> float:
    """Root mean square in bins of equal counts; returns the highest."""
    x, top = np.concatenate([trace.quantities[name] for trace in traces]), 0.0
    order = np.argsort(x, kind="stable")
    bins = [part for part in np.array_split(order, min(BINS, len(x))) if len(part)]
    for label, attribute, colour in SERIES:
        square = np.concatenate(
            [np.mean(getattr(trace, attribute)[:, list(group.columns)] ** 2, axis=1) for trace in traces]
        )
        heights = [float(np.sqrt(square[part].mean())) for part in bins]
        axis.plot(
            [float(x[part].mean()) for part in bins], heights, "o-", color=colour, label=label,
            markersize=3.5, linewidth=1.1,
        )  # fmt: skip
        top = max(top, *heights)
    return top


def _spectrum(axis: Axes, traces: Sequence[Trace], group: Group) -> float:
    """Square root of the power density over that of white noise of unit variance; returns the highest."""
    top = 0.0
    for _, attribute, colour in SERIES:
        total, weight, frequency = 0.0, 0.0, None
        # Rows on either side of a pause follow each other here; holds are left out.
        shortest = min((trace.moving for trace in traces if trace.moving >= 16), default=0)
        for trace in traces:
            if trace.moving < 16 or trace.rate_hz != traces[0].rate_hz:
                continue
            segment = min(round(SEGMENT_S * trace.rate_hz), shortest)
            series = getattr(trace, attribute)[: trace.moving, list(group.columns)]
            frequency, power = welch(series, trace.rate_hz, nperseg=segment, axis=0, detrend="constant")
            total = total + trace.moving * power.mean(axis=1) * trace.rate_hz / 2.0
            weight += trace.moving
        if frequency is None:
            continue
        height = np.sqrt(np.asarray(total) / weight)
        height[[0, -1]] *= np.sqrt(2.0)  # the ends are not doubled in a one-sided density
        axis.plot(frequency, height, color=colour, linewidth=1.1)
        top = max(top, float(height.max()))
    return top
