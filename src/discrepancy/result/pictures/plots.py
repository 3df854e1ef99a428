"""Pictures of a diagnosis: residuals over time and against what they may depend on, evidence, closed loop."""

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from discrepancy.result.pictures.plots_against import AFTER, BEFORE, against_figure, scale_multiples, titled
from discrepancy.result.pictures.plots_evidence import closed_loop_figure, evidence_figure
from discrepancy.result.pictures.plots_law import law_figure
from discrepancy.result.pictures.residual_statistics import multiples
from discrepancy.result.traces import Group, Trace, group_units, groups
from estimator.arrays import Array
from mocobot_sim.plots_plain import plain_words

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
    """Draw everything there is and return the paths.

    Args:
        values: the diagnosis, as in the JSON.
        traces: residuals of every trial.
        channels: the rig's channels.
        unit: of a quantity that a misfit may depend on.
        folder: existing folder for ``residual_<trial>.png``, ``residual_against.png``, ``evidence.png`` and
            ``closed_loop.png`` and ``law.png`` (these only where the closed loop was simulated, and a law stated).
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
    """Short and distinct parts of file names for trials that may be called by their paths."""
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
        label = (
            f" {name}" if name.startswith("_") else name
        )  # a legend leaves out what begins with an underscore
        axis.plot(time, _broken(trace, values[:, k]), color=colour, linewidth=0.8, label=label)
        axis.plot(trace.time[trace.moving :], values[trace.moving :, k], "o", color=colour, markersize=3)
    axis.axhline(0.0, color="black", linewidth=0.4)
    axis.grid(alpha=0.25)


def _multiples(axis: Axes, trace: Trace, group: Group, *, named: bool) -> None:
    series = [("as simulated", trace.white_before, BEFORE)]
    series += [("with causes", trace.white_after, AFTER)] if named else []
    top = 1.0
    for label, white, colour in series:
        rms = multiples(trace, white, group.columns)
        top = max(top, float(rms.max()))
        axis.plot(_broken(trace, trace.time), _broken(trace, rms), color=colour, linewidth=1.1, label=label)
        axis.plot(trace.time[trace.moving :], rms[trace.moving :], "o", color=colour, markersize=3)
    scale_multiples(axis, top, 1.5)


def _broken(trace: Trace, values: Array) -> Array:
    """Moving rows with a NaN after every pause, so that lines do not cross it."""
    moving = values[: trace.moving]
    after = np.flatnonzero(np.diff(trace.time[: trace.moving]) > 1.5 / trace.rate_hz) + 1
    return np.insert(moving.astype(float), after, np.nan)


def _save(figure: Figure, path: Path) -> Path:
    # As savefig does it, which would arrange and draw everything twice.
    figure.dpi = 110
    FigureCanvasAgg(figure).print_png(path)
    return path
