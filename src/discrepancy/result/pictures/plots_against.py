"""The residual against speed, position, load and frequency, in multiples of clean data."""

from collections.abc import Callable, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from discrepancy.result.pictures.residual_statistics import binned, spectrum
from discrepancy.result.traces import Group, Trace
from mocobot_sim.plots_plain import plain_numbers

BEFORE, AFTER = "#c8553d", "#2f6fd0"
SERIES = (("as simulated", "white_before", BEFORE), ("with causes and tolerances", "white_after", AFTER))


def against_figure(
    traces: Sequence[Trace], grouped: Sequence[Group], unit: Callable[[str], str], *, named: bool
) -> Figure:
    """One row per group of channels, one column per quantity; all trials together."""
    quantities = list(traces[0].quantities)
    columns = len(quantities) + 1
    figure = Figure(figsize=(3.9 * columns, 1.9 * len(grouped) + 0.9), layout="constrained")
    axes = figure.subplots(len(grouped), columns, squeeze=False, sharex="col")
    for row, group in zip(axes, grouped, strict=True):
        tops = [_binned(axis, traces, group, name) for axis, name in zip(row, quantities, strict=False)]
        tops.append(_spectrum(row[-1], traces, group))
        for axis in row:
            scale_multiples(axis, max(tops), 1.6)
        row[0].set_ylabel(f"{group.name}\n[clean = 1]", fontsize=9)
    for axis, name in zip(axes[-1], quantities, strict=False):
        axis.set_xlabel(f"{name} [{unit(name)}]")
    axes[-1][-1].set_xlabel("frequency [Hz]")
    handles, labels = axes[0][0].get_legend_handles_labels()
    labels[-1] = "with causes and tolerances" if named else "with tolerances"
    title = "Residual (whitened rms) in multiples of clean data" + ("" if named else "; nothing is named")
    return titled(figure, title, handles, labels)


def titled(
    figure: Figure, title: str, handles: Sequence[Any], labels: Sequence[str], columns: int = 2
) -> Figure:
    """The figure with its title and its legend."""
    figure.legend(handles, labels, loc="outside upper right", ncols=columns, frameon=False, fontsize=9)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def scale_multiples(axis: Axes, top: float, headroom: float) -> None:
    """An axis of multiples of clean data, a line at 1: logarithmic, up to ``headroom`` tops, where these are high."""
    axis.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
    axis.grid(alpha=0.25)
    if top > 8.0:
        log_scale(axis, 0.3, headroom * top)
    else:
        axis.set_ylim(0.0, max(2.0, 1.15 * top))


def log_scale(axis: Axes, low: float, high: float) -> None:
    """A logarithmic axis with plain numbers."""
    axis.set_yscale("log")
    axis.set_ylim(low, high)
    plain_numbers(axis.yaxis)


def _binned(axis: Axes, traces: Sequence[Trace], group: Group, name: str) -> float:
    """Root mean square in bins of equal counts; returns the highest."""
    top = 0.0
    for label, attribute, colour in SERIES:
        x, heights = binned(traces, attribute, list(group.columns), name)
        axis.plot(x, heights, "o-", color=colour, label=label, markersize=3.5, linewidth=1.1)
        top = max(top, float(heights.max()))
    return top


def _spectrum(axis: Axes, traces: Sequence[Trace], group: Group) -> float:
    """Square root of the power density over that of white noise of unit variance; returns the highest."""
    top = 0.0
    for _, attribute, colour in SERIES:
        found = spectrum(traces, attribute, list(group.columns))
        if found is not None:
            axis.plot(*found, color=colour, linewidth=1.1)
            top = max(top, float(found[1].max()))
    return top
