"""Time series as stacked plots with one time axis, thinned so that no spike is lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mocobot_report.blocks.blocks import spelled_text
from mocobot_report.blocks.charts import Json, Key, axis, layout, literal, log_axis, numbers, paint, shared

Array = NDArray[np.float64]

MOST = 1600
"""Points that a line keeps at most, about two per pixel of a wide plot."""
ROW_PX, FOOT_PX = 122, 56


@dataclass(frozen=True)
class Line:
    """One line, or a set of points.

    Attributes:
        key: its legend entry.
        time: shape (n,); NaN breaks the line.
        values: shape (n,).
        points: markers in place of a line.
    """

    key: Key
    time: Array
    values: Array
    points: bool = False


@dataclass(frozen=True)
class Panel:
    """One of several plots above each other.

    Attributes:
        title: of the vertical axis.
        unit: of its values.
        lines: to draw.
        limits: of the vertical axis, or None for all that there is.
        band: half height of a shaded band around zero, or None.
        rule: where a dashed line runs, or None.
        log: whether the axis is logarithmic; then it starts at ``limits``.
    """

    title: str
    unit: str
    lines: Sequence[Line] = field(default_factory=list)
    limits: tuple[float, float] | None = None
    band: float | None = None
    rule: float | None = None
    log: bool = False


def height(panels: Sequence[Panel]) -> int:
    """Of the stack [px]."""
    return ROW_PX * len(panels) + FOOT_PX


def stacked(panels: Sequence[Panel], x_title: str = "time [s]") -> Json:
    """A plotly figure of panels above each other; zooming one in time zooms all."""
    count = len(panels)
    gap = 0.16 / max(count, 1)
    tall = (1.0 - gap * (count - 1)) / max(count, 1)
    data, shapes, arrays = [], [], {}
    known: dict[bytes, str] = {}

    def once(values: Array) -> Json:
        packed = np.ascontiguousarray(values, dtype="<f4").tobytes()
        if packed not in known:
            known[packed] = f"t{len(known)}"
            arrays[known[packed]] = numbers(values)
        return shared(known[packed])

    axes: Json = {}
    for k, panel in enumerate(panels):
        number = "" if k == 0 else str(k + 1)
        top = 1.0 - k * (tall + gap)
        domain = [max(0.0, top - tall), top]
        title = f"{literal(panel.title, 24)}<br>[{panel.unit}]" if panel.unit else literal(panel.title, 24)
        style = {"domain": domain, "anchor": "x", "zeroline": not panel.log, "nticks": 5}
        if panel.log and panel.limits is not None:
            axes[f"yaxis{number}"] = log_axis(title, *panel.limits, **(style | {"nticks": 4}))
        else:
            limits = {} if panel.limits is None else {"range": list(panel.limits)}
            axes[f"yaxis{number}"] = axis(title, **style, **limits)
        axes[f"yaxis{number}"]["title"] = {"text": spelled_text(title), "standoff": 6, "font": {"size": 11}}
        if panel.band:
            shapes.append(
                {"type": "rect", "xref": "paper", "x0": 0, "x1": 1, "yref": f"y{number}", "y0": -panel.band,
                 "y1": panel.band, "fillcolor": paint("band"), "line": {"width": 0}, "layer": "below"}
            )  # fmt: skip
        if panel.rule is not None:
            shapes.append(
                {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "yref": f"y{number}", "y0": panel.rule,
                 "y1": panel.rule, "line": {"color": paint("text"), "width": 1, "dash": "dash"}}
            )  # fmt: skip
        for line in panel.lines:
            trace: Json = {
                "type": "scatter",
                "mode": "markers" if line.points else "lines",
                "x": once(line.time),
                "y": numbers(line.values),
                "yaxis": f"y{number}",
                "name": literal(line.key.label),
                "legendgroup": line.key.group,
                "hovertemplate": f"{literal(panel.title)}, {literal(line.key.label)}<br>%{{x:.2f}}: %{{y:.3g}} "
                f"{panel.unit}<extra></extra>",
            }
            if line.points:
                trace["marker"] = {"color": paint(line.key.colour), "size": 6}
            else:
                dash = {"dash": "dash"} if line.key.symbol == "dash" else {}
                trace["line"] = {"color": paint(line.key.colour), "width": 1.2, **dash}
            data.append(trace)
    last = "y" if count == 1 else f"y{count}"
    return {
        "data": data,
        "arrays": arrays,
        "layout": layout(
            xaxis=axis(x_title, anchor=last, zeroline=False),
            **axes,
            shapes=shapes,
            margin={"l": 74, "r": 12, "t": 8, "b": 44},
        ),
        "narrow": {"margin.r": 6},
    }


def runs(time: Array, step_s: float) -> Array:
    """Number of the uninterrupted run that each sample belongs to, shape (n,); a pause begins a new one."""
    return np.concatenate([[0], np.cumsum(np.diff(time) > 1.5 * step_s)]) if len(time) else np.zeros(0)


def thinned(time: Array, values: Array, run: Array | None = None, most: int = MOST) -> tuple[Array, Array]:
    """The smallest and the largest value of every stretch of time, at their own times; NaN rows at pauses.

    Args:
        time: shape (n,), increasing.
        values: shape (n, C); all columns share the times that are kept.
        run: as ``runs`` gives it, or None where there is no pause.
        most: rows to keep at most, apart from ends of runs.

    Returns:
        Times, shape (m,), and values, shape (m, C).
    """
    n, columns = values.shape
    run = np.zeros(n) if run is None else run
    if n > most:
        kept = {0, n - 1, *np.flatnonzero(np.diff(run) > 0), *(np.flatnonzero(np.diff(run) > 0) + 1)}
        edges = np.linspace(0, n, max(2, most // (2 * columns)) + 1).astype(int)
        for start, end in pairwise(edges):
            if end > start:
                kept.update(start + np.argmin(values[start:end], axis=0))
                kept.update(start + np.argmax(values[start:end], axis=0))
        chosen = np.array(sorted(int(k) for k in kept))
        time, values, run = time[chosen], values[chosen], run[chosen]
    breaks = np.flatnonzero(np.diff(run) > 0) + 1
    return np.insert(time.astype(float), breaks, np.nan), np.insert(
        values.astype(float), breaks, np.nan, axis=0
    )
