"""Time series as stacked plots with one time axis, thinned so that no spike is lost."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import plotly.graph_objects as go

from estimator.arrays import Array
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.charts import Axis, axis, chart, figure, line, literal, log_axis
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.legend import Key

MOST = 1600
"""Points that a line keeps at most, about two per pixel of a wide plot."""
ROW_PX, FOOT_PX = 122, 56
GAP = 0.15
"""Between panels, as a share of a row."""


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
        band: times and half heights of a shaded band around zero, shape (n,) each, or None; NaN breaks it.
        rule: where a dashed line runs, or None.
        log: whether the axis is logarithmic; then it starts at ``limits``.
    """

    title: str
    unit: str
    lines: Sequence[Line] = field(default_factory=list)
    limits: tuple[float, float] | None = None
    band: tuple[Array, Array] | None = None
    rule: float | None = None
    log: bool = False


def stacked_chart(
    book: Book,
    title: str,
    panels: Sequence[Panel],
    *,
    keys: Sequence[Key],
    label: str,
    note: str | None = None,
) -> Node:
    """Panels above each other over one time axis [s]; zooming one in time zooms all. Arguments as of ``chart``."""
    height = ROW_PX * len(panels) + FOOT_PX
    return chart(
        book,
        title,
        _stacked(panels),
        height=height,
        label=label,
        keys=keys,
        note=note,
        narrow={"margin.r": 6},
    )


def _stacked(panels: Sequence[Panel]) -> go.Figure:
    names = [f"y{k}" if k > 1 else "y" for k in range(1, len(panels) + 1)]
    axes = {f"yaxis{name[1:]}": _vertical(panel) for name, panel in zip(names, panels, strict=True)}
    shown = figure(
        [_trace(panel, one, name) for name, panel in zip(names, panels, strict=True) for one in panel.lines],
        grid={"rows": len(panels), "columns": 1, "subplots": [[f"x{name}"] for name in names], "ygap": GAP},
        xaxis=axis("time [s]", anchor=names[-1], zeroline=False),
        margin_l=74,
        **axes,
    )
    for name, panel in zip(names, panels, strict=True):
        across = {"xref": "paper", "x0": 0, "x1": 1, "yref": name}
        if panel.band:
            path = around_zero(*panel.band)
            shown.add_shape(type="path", path=path, layer="below", line_width=0, xref="x", yref=name)
        if panel.rule is not None:
            shown.add_shape(type="line", y0=panel.rule, y1=panel.rule, line_width=1, **across)
    return shown


def around_zero(time: Array, half: Array) -> str:
    """The outline of a band as SVG; where its height does not change, only ends are kept."""
    out = []
    for piece in np.split(np.arange(len(time)), np.flatnonzero(np.isnan(time))):
        k = piece[~np.isnan(time[piece])]
        change = np.abs(np.diff(half[k])) > 1e-3 * np.nanmax(half)
        k = k[np.concatenate([[True], change]) | np.concatenate([change, [True]])] if len(k) else k
        points = [*zip(time[k], half[k], strict=True), *zip(time[k][::-1], -half[k][::-1], strict=True)]
        out += [f"{'L' if n else 'M'}{x:.5g},{y:.4g}" for n, (x, y) in enumerate(points)] + [
            "Z" * bool(len(k))
        ]
    return "".join(out)


def _vertical(panel: Panel) -> Axis:
    title = literal(panel.title, 24) + (f"<br>[{panel.unit}]" if panel.unit else "")
    style: Axis = {"anchor": "x", "title_font_size": 11, "title_standoff": 6}
    if panel.log and panel.limits is not None:
        return log_axis(title, panel.limits, nticks=4, zeroline=False, **style)
    return axis(title, nticks=5, range=panel.limits, **style)


def _trace(panel: Panel, one: Line, name: str) -> go.Scatter:
    hover = f"{literal(panel.title)}, {literal(one.key.label)}<br>%{{x:.2f}}: %{{y:.3g}} {panel.unit}"
    points = {"mode": "markers", "marker": {"size": 6}} if one.points else {}
    return line(one.time, one.values, one.key, hover, yaxis=name, **points)


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
    return with_breaks(time, values, run)


def with_breaks(time: Array, values: Array, run: Array) -> tuple[Array, Array]:
    """Times, shape (n,), and values, shape (n, C), with a NaN row wherever another run begins."""
    breaks = np.flatnonzero(np.diff(run) > 0) + 1
    return np.insert(time.astype(float), breaks, np.nan), np.insert(
        values.astype(float), breaks, np.nan, axis=0
    )
