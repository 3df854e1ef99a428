"""Plots of a diagnosis: residuals over time and against other quantities, evidence, closed loop and laws."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from discrepancy.numbers import fitting
from discrepancy.result.report import drawn, label, relation
from discrepancy.result.tables import floor_words, predicted_torques, response_units
from discrepancy.result.traces import Group, Trace, binned, group_units, groups, multiples, spectrum
from estimator.arrays import Array
from mocobot_sim.plots_plain import plain_numbers, plain_words

BEFORE, AFTER = "#c8553d", "#2f6fd0"
SERIES = (("as simulated", "white_before", BEFORE), ("with causes and tolerances", "white_after", AFTER))


def against_figure(
    traces: Sequence[Trace], grouped: Sequence[Group], unit: Callable[[str], str], *, named: bool
) -> Figure:
    """Plot residuals of all trials: one row for each group of channels, one column for each quantity."""
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
    """Add a title and a legend to a figure."""
    figure.legend(handles, labels, loc="outside upper right", ncols=columns, frameon=False, fontsize=9)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11)
    return figure


def scale_multiples(axis: Axes, top: float, headroom: float) -> None:
    """Format an axis of multiples of clean data, with a line at 1; logarithmic if the values are high."""
    axis.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
    axis.grid(alpha=0.25)
    if top > 8.0:
        log_scale(axis, 0.3, headroom * top)
    else:
        axis.set_ylim(0.0, max(2.0, 1.15 * top))


def log_scale(axis: Axes, low: float, high: float) -> None:
    """Set a logarithmic axis with plain numbers."""
    axis.set_yscale("log")
    axis.set_ylim(low, high)
    plain_numbers(axis.yaxis)


def _binned(axis: Axes, traces: Sequence[Trace], group: Group, name: str) -> float:
    """Plot the rms in bins of equal counts; return the highest."""
    top = 0.0
    for what, attribute, colour in SERIES:
        x, heights = binned(traces, attribute, list(group.columns), name)
        axis.plot(x, heights, "o-", color=colour, label=what, markersize=3.5, linewidth=1.1)
        top = max(top, float(heights.max()))
    return top


def _spectrum(axis: Axes, traces: Sequence[Trace], group: Group) -> float:
    """Plot the square root of the power density over that of unit white noise; return the highest."""
    top = 0.0
    for _, attribute, colour in SERIES:
        found = spectrum(traces, attribute, list(group.columns))
        if found is not None:
            axis.plot(*found, color=colour, linewidth=1.1)
            top = max(top, float(found[1].max()))
    return top


RELATIONS = {
    "named": ("named", "#2f6fd0", "s"),
    "family": ("same family", "#3f8f6b", "o"),
    "other": ("other", "#6b7280", "D"),
}


def evidence_figure(values: Mapping[str, Any]) -> Figure:
    """Plot the evidence of the strongest candidates, without and with the named causes, on one scale."""
    evidence = values["evidence"]
    panels = [("nothing is named yet", drawn(evidence["before"]))]
    if evidence["after"] is not None:
        panels.append(("the named causes are in the model", drawn(evidence["after"])))
    figure = Figure(figsize=(7.5 * len(panels), 5.2), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False, sharex=True)[0]
    for axis, (title, strongest) in zip(axes, panels, strict=True):
        _dots(axis, strongest, values["causes"])
        axis.set_title(f"when {title}", loc="left", fontsize=10)
    seen = [entry[key] for _, strongest in panels for entry in strongest for key in ("nats", "needed")]
    # Use dots: bars need a zero, and a log axis has none.
    axes[0].set_xlim(0.6, 3.0 * max(seen, default=10.0))
    shown = RELATIONS if values["causes"] else {"other": ("candidate", *RELATIONS["other"][1:])}
    handles = [axes[0].plot([], [], mark, color=colour)[0] for _, colour, mark in shown.values()]
    handles += axes[0].plot([], [], "|", color="black", markersize=12)
    words = [*(word for word, _, _ in shown.values()), "needed to be named"]
    title = "Evidence that a cause is there"
    return titled(figure, title, handles, words, len(words))


def _dots(axis: Axes, strongest: Sequence[Mapping[str, Any]], causes: Sequence[Mapping[str, Any]]) -> None:
    at = list(range(len(strongest)))[::-1]
    axis.set_xscale("log")
    for y, entry in zip(at, strongest, strict=True):
        _, colour, mark = RELATIONS[relation(entry, causes)]
        axis.plot(entry["needed"], y, "|", color="black", markersize=12)
        axis.plot(entry["nats"], y, mark, color=colour, markersize=7)
        nats = f"{entry['nats']:.0f}" if entry["nats"] >= 100 else f"{entry['nats']:.3g}"
        right = entry["nats"] > entry["needed"]  # avoid the mark of the required evidence
        axis.annotate(nats, (entry["nats"], y), (8 if right else -8, 0), textcoords="offset points", va="center",
                      ha="left" if right else "right", fontsize=8)  # fmt: skip
    axis.set_yticks(at, [label(entry) for entry in strongest], fontsize=9)
    axis.set_ylim(-0.7, max(len(strongest), 1) - 0.3)
    plain_numbers(axis.xaxis)
    axis.set_xlabel("log Bayes factor [nats]")
    axis.grid(alpha=0.25)
    if not strongest:
        axis.text(0.5, 0.5, "nothing speaks for any cause", transform=axis.transAxes, ha="center", fontsize=9)


def closed_loop_figure(values: Mapping[str, Any]) -> Figure | None:
    """Plot each channel's error and chi-square by trial, without and with the causes; None if not simulated."""
    gain = values["gain"]
    trials = [t for t in (gain or {}).get("trials", ()) if t["before"] is not None]
    if not trials:
        return None
    named = bool(values["causes"])
    panels = [(f"{name}_rms", f"{name} rms", *shown) for name, shown in response_units(gain).items()]
    panels.append(("chi2_per_n", "chi2/n", "", 1.0))
    figure = Figure(figsize=(3.6 * len(panels), 4.0), layout="constrained")
    axes = figure.subplots(1, len(panels), squeeze=False)[0]
    at = np.arange(len(trials))
    for axis, (key, title, unit, scale) in zip(axes, panels, strict=True):
        series = (
            [("before", -0.1, BEFORE, "s"), ("after", 0.1, AFTER, "o")]
            if named
            else [("before", 0.0, BEFORE, "s")]
        )
        low, high = np.inf, 0.0
        for which, shift, colour, mark in series:
            heights = np.array([np.nan if t[which] is None else scale * t[which][key] for t in trials])
            axis.plot(
                at + shift, heights, mark, color=colour, markersize=8, label=which if named else "error"
            )
            low, high = min(low, float(np.nanmin(heights))), max(high, float(np.nanmax(heights)))
        floor = scale * gain["noise"][key] if key in gain["noise"] else 1.0
        axis.axhline(floor, color="black", linewidth=0.8, linestyle="--", label=floor_words(gain))
        low, high = min(low, floor), max(high, floor)
        if high > 12.0 * low:
            log_scale(axis, 10 ** np.floor(np.log10(0.9 * low)), 10 ** np.ceil(np.log10(1.1 * high)))
        else:
            axis.set_ylim(0.0, 1.15 * high)
        axis.set_xlim(-0.6, len(trials) - 0.4)
        axis.set_xticks(at, [f"{k + 1}" for k in at])
        axis.set_xlabel("trial")
        axis.set_title(
            f"{title} [{unit}]" if unit else f"{title} ({floor_words(gain).removesuffix(' error')} = 1)",
            loc="left",
            fontsize=10,
        )
        axis.grid(axis="y", alpha=0.25)
    handles, labels = axes[0].get_legend_handles_labels()
    if predicted_torques(gain):
        title = "Torques, predicted from the recorded motion: error"
    else:
        title = "Recorded commands, simulated again: error of the response"
    return titled(figure, title, handles, labels)


Values = Mapping[str, Any]


def law_figure(values: Values) -> Figure | None:
    """Plot each unlisted law over time in the first trial and against its signal in all trials; None without a law."""
    laws = [cause for cause in values["causes"] if cause.get("law") and cause["law"]["traces"]]
    if not laws:
        return None
    figure = Figure(figsize=(12.0, 3.6 * len(laws) + 0.6), layout="constrained")
    rows = figure.subplots(len(laws), 2, squeeze=False)
    for cause, (over_time, against) in zip(laws, rows, strict=True):
        _drawn(cause, over_time, against)
    over_time = rows[0][0]
    handles = [
        over_time.errorbar([], [], [], fmt=".", color=BEFORE, elinewidth=0.8),
        over_time.plot([], [], color=AFTER)[0],
    ]
    words = ["error that explains most there, found without a formula (1 standard error)", "the formula"]
    return titled(figure, "What nobody listed", handles, words, 2)


def strongest(traces: Sequence[Values]) -> int:
    """Index of the component with the largest values of the law."""
    sizes = [
        np.std(np.concatenate([trace["law"][k] for trace in traces])) for k in range(len(traces[0]["law"]))
    ]
    return int(np.argmax(sizes))


def _drawn(cause: Values, over_time: Axes, against: Axes) -> None:
    law, traces = cause["law"], cause["law"]["traces"]
    k = strongest(traces)
    largest = max(np.abs(np.concatenate([trace["law"][k] for trace in traces])).max(), 1e-300)
    unit, scale = fitting(law["unit"], float(largest))
    label = f"{law['targets'][k].replace('_', ' ')} [{unit}]"
    first = traces[0]
    _points(over_time, first["time_s"], first, k, scale)
    over_time.plot(first["time_s"], scale * np.array(first["law"][k]), color=AFTER)
    over_time.set_xlabel("time in the first trial [s]")
    over_time.set_ylabel(label)
    over_time.set_title(cause["name"], loc="left", fontsize=9, wrap=True)
    for trace in traces:
        _points(against, trace["signal"], trace, k, scale)
    signal, value = (
        np.concatenate([trace[key] if key == "signal" else trace["law"][k] for trace in traces])
        for key in ("signal", "law")
    )
    order = np.argsort(signal)
    alone = law["times"] is None and law["function"] not in ("play", "lag", "second_order")
    against.plot(signal[order], scale * value[order], "-" if alone else ".", color=AFTER, markersize=3)
    against.set_xlabel(law["of"].replace("_", " "))
    against.set_ylabel(label)
    for axis in (over_time, against):
        axis.grid(alpha=0.25)
        reach = 1.6 * scale * largest
        axis.set_ylim(
            -reach if np.min(value) < 0 else -0.4 * reach, reach if np.max(value) > 0 else 0.4 * reach
        )


def _points(axis: Axes, x: Sequence[float], trace: Values, k: int, scale: float) -> None:
    error, se = scale * np.array(trace["error"][k]), scale * np.array(trace["se"][k])
    axis.errorbar(x, error, se, fmt=".", color=BEFORE, elinewidth=0.6, markersize=3, alpha=0.6)


CLEAN_BAND = "#d9dde3"
COMPONENTS = ("#7a5195", "#d99a2b", "#2a9d8f")


@plain_words()
def save_plots(
    values: Mapping[str, Any],
    traces: Sequence[Trace],
    channels: Sequence[Any],
    unit: Callable[[str], str],
    folder: Path,
) -> list[Path]:
    """Draw all plots of a diagnosis, and return their paths.

    Args:
        values: the diagnosis, as in the JSON.
        traces: residuals of each trial.
        channels: the residual channels.
        unit: returns the unit of a quantity by name.
        folder: existing folder for ``residual_<trial>.png``, ``residual_against.png`` and ``evidence.png``. It also
            gets ``closed_loop.png`` if the closed loop was simulated, and ``law.png`` if there is a law.
    """
    grouped, named = groups(channels), bool(values["causes"])
    paths = []
    for trace, name in zip(traces, file_names([trace.name for trace in traces]), strict=True):
        paths.append(_save(_time_figure(trace, grouped, named=named), folder / f"residual_{name}.png"))
    paths.append(_save(against_figure(traces, grouped, unit, named=named), folder / "residual_against.png"))
    paths.append(_save(evidence_figure(values), folder / "evidence.png"))
    loop = closed_loop_figure(values)
    if loop is not None:
        paths.append(_save(loop, folder / "closed_loop.png"))
    law = law_figure(values)
    if law is not None:
        paths.append(_save(law, folder / "law.png"))
    return paths


def file_names(names: Sequence[str]) -> list[str]:
    """Short and distinct parts of file names for trials, whose names may be paths."""
    out: list[str] = []
    for name in names:
        stem = re.sub(r"[^\w.-]+", "_", re.split(r"[/\\]", name)[-1].removesuffix(".parquet"))[:60] or "trial"
        taken = {"against", *out}
        out.append(
            next(s for k in range(len(names) + 2) if (s := stem if not k else f"{stem}_{k + 1}") not in taken)
        )
    return out


def _time_figure(trace: Trace, grouped: Sequence[Group], *, named: bool) -> Figure:
    columns = 3 if named else 2
    units = group_units([trace], grouped)
    figure = Figure(figsize=(5.2 * columns, 1.75 * len(grouped) + 0.9), layout="constrained")
    axes = figure.subplots(len(grouped), columns, sharex=True, squeeze=False)
    for row, group in zip(axes, grouped, strict=True):
        unit, scale = units[group.unit]
        _components(row[0], trace, group, scale * trace.before, scale)
        row[0].set_ylabel(f"{group.name}\n[{unit}]", fontsize=9)
        if named:
            _components(row[1], trace, group, scale * trace.after, scale)
            row[1].set_ylim(*row[0].get_ylim())
        _multiples(row[-1], trace, group, named=named)
    axes[0][0].set_title("as simulated (grey: 2 sigma of clean data)", loc="left", fontsize=10)
    if named:
        axes[0][1].set_title("with the named causes, same scale", loc="left", fontsize=10)
    axes[0][-1].set_title("whitened rms, in multiples of clean data", loc="left", fontsize=10)
    found = [axis.get_legend_handles_labels() for axis in (axes[0][0], axes[0][-1])]
    handles, labels = found[0][0] + found[1][0], found[0][1] + found[1][1]
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    return titled(figure, f"Residual of {trace.name}", handles, labels, len(labels))


def _components(axis: Axes, trace: Trace, group: Group, values: Array, scale: float) -> None:
    time = _broken(trace, trace.time)
    sigma = 2.0 * scale * trace.sigma[:, list(group.columns)].max(axis=1)
    if trace.moving:
        band = _broken(trace, sigma)
        axis.fill_between(time, -band, band, color=CLEAN_BAND, linewidth=0)
    for k, name, colour in zip(group.columns, group.components, cycle(COMPONENTS), strict=False):
        shown = f" {name}" if name.startswith("_") else name  # a legend omits labels that begin with "_"
        axis.plot(time, _broken(trace, values[:, k]), color=colour, linewidth=0.8, label=shown)
        axis.plot(trace.time[trace.moving :], values[trace.moving :, k], "o", color=colour, markersize=3)
    axis.axhline(0.0, color="black", linewidth=0.4)
    axis.grid(alpha=0.25)


def _multiples(axis: Axes, trace: Trace, group: Group, *, named: bool) -> None:
    series = [("as simulated", trace.white_before, BEFORE)]
    series += [("with causes", trace.white_after, AFTER)] if named else []
    top = 1.0
    for what, white, colour in series:
        rms = multiples(trace, white, group.columns)
        top = max(top, float(rms.max()))
        axis.plot(_broken(trace, trace.time), _broken(trace, rms), color=colour, linewidth=1.1, label=what)
        axis.plot(trace.time[trace.moving :], rms[trace.moving :], "o", color=colour, markersize=3)
    scale_multiples(axis, top, 1.5)


def _broken(trace: Trace, values: Array) -> Array:
    """Rows in motion with a NaN after each pause, so that lines do not cross it."""
    moving = values[: trace.moving]
    after = np.flatnonzero(np.diff(trace.time[: trace.moving]) > 1.5 / trace.rate_hz) + 1
    return np.insert(moving.astype(float), after, np.nan)


def _save(figure: Figure, path: Path) -> Path:
    # ``savefig`` would arrange and draw everything twice.
    figure.dpi = 110
    FigureCanvasAgg(figure).print_png(path)
    return path
