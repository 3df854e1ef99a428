"""Interactive plots as plotly JSON without colours, which the theme of the page provides.

``meta`` of a trace names its colour in the palette, ``legendgroup`` the legend entry that hides it.
"""

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array
from mocobot_report.numbers import spelled_text

Axis = dict[str, Any]
Shape = dict[str, Any]
Trace = dict[str, Any]


@dataclass(frozen=True)
class Key:
    """Entry of a legend."""

    group: str  # lines that it shows and hides; empty if they cannot be hidden
    label: str
    colour: str  # name in the palette
    symbol: str = "line"  # or "dash", "band", or the name of a marker


@dataclass(frozen=True)
class Chart:
    """A plot with caption and legend."""

    title: str  # a bracketed unit is printed with superscripts
    label: str  # description for screen readers
    data: Sequence[Trace]
    layout: Mapping[str, Any]  # properties of plotly's layout
    height: int  # [px]
    keys: Sequence[Key] = ()
    note: str = ""  # text below the title
    narrow: Mapping[str, float] = field(default_factory=dict)  # for phones, by dotted path in the layout

    def to_json(self) -> dict[str, Any]:
        """Return the JSON for the page's script; arrays that several traces share as ``x`` are stored in ``arrays``."""
        arrays: list[Any] = []
        data = []
        for trace in self.data:
            x = trace["x"]
            if isinstance(x, dict):
                if x not in arrays:
                    arrays.append(x)
                x = arrays.index(x)
            data.append(trace | {"x": x})
        return {"data": data, "layout": dict(self.layout), "narrow": dict(self.narrow), "arrays": arrays}


def literal(text: str, most: int = 200) -> str:
    """Shorten a user's text in the middle and escape its markup, for use in a plot."""
    if len(text) > most:
        text = f"{text[: most // 2]}…{text[len(text) - (most - 1) // 2 :]}"
    return escape(text, quote=False)


def axis(title: str, **more: Any) -> Axis:
    """Make an axis with a title; a unit in brackets gets superscripts."""
    return {"title": {"text": spelled_text(title)}, **more}


def log_axis(title: str, values: Iterable[float | None], **more: Any) -> Axis:
    """Make a logarithmic axis that covers all positive values, with labels that do not overlap."""
    seen = [v for v in values if v is not None and v > 0] or [1e-3, 1.0]
    low, high = float(np.log10(min(seen))) - 0.15, float(np.log10(max(seen))) + 0.15
    if high - low < 2.5:  # 1, 2, 5, 10, 20, 50 ...
        powers = range(int(np.floor(low)), int(np.ceil(high)) + 1)
        at = [m * 10.0**p for p in powers for m in (1, 2, 5) if low <= np.log10(m * 10.0**p) <= high]
        ticks: Axis = {"tickvals": at, "ticktext": [f"{v:g}" for v in at]}
    else:  # plotly draws powers larger than other labels
        step = 1 if high - low < 7 else 2
        ticks = {"tickfont": {"size": 9.5}, "exponentformat": "power", "minexponent": 3, "dtick": step}
    return axis(title, type="log", range=[low, high], **ticks, **more)


def row_axis(names: Sequence[str], most: int = 26) -> Axis:
    """Make a vertical axis of named rows, the first at 0 on top; names are shortened to ``most`` letters."""
    return {**_named([literal(name, most) for name in names]), "range": [len(names) - 0.4, -0.6]}


def column_axis(names: Sequence[str]) -> Axis:
    """Make a horizontal axis of named columns, the first at 0; names may contain markup."""
    return {**_named(names), "range": [-0.6, len(names) - 0.4], "showgrid": False, "tickangle": 0}


def _named(names: Sequence[str]) -> Axis:
    ticks = {"tickvals": list(range(len(names))), "ticktext": list(names)}
    return {**ticks, "zeroline": False, "fixedrange": True}


def rule(*, x: float | None = None, y: float | None = None, of: str = "y", thin: bool = False) -> Shape:
    """Make a dashed line across a plot at ``x``, or at ``y`` of the vertical axis ``of``."""
    shape: Shape = {"type": "line"}
    if x is not None:
        shape |= {"x0": x, "x1": x, "xref": "x", "y0": 0, "y1": 1, "yref": "y domain"}
    else:
        shape |= {"x0": 0, "x1": 1, "xref": "x domain", "y0": y, "y1": y, "yref": of}
    return shape | ({"line": {"width": 1}} if thin else {})


def dots(
    x: Iterable[float | None], y: Iterable[float | None], key: Key, text: Iterable[str], *, size: int = 9, **more: Any
) -> Trace:  # fmt: skip
    """Make the points of a legend entry, each with a hover text, which is escaped."""
    return {
        "type": "scatter", "x": list(x), "y": list(y), "mode": "markers", "name": literal(key.label),
        "legendgroup": key.group, "meta": key.colour, "marker": {"symbol": key.symbol, "size": size},
        "text": [literal(t) for t in text], "hovertemplate": "%{text}<extra></extra>", **more,
    }  # fmt: skip


def line(x: ArrayLike, y: ArrayLike, key: Key, hover: str, *, width: float = 1.2, **more: Any) -> Trace:
    """Make the line of a legend entry in single precision; NaN interrupts it."""
    return {
        "type": "scatter", "x": _packed(x), "y": _packed(y), "name": literal(key.label), "legendgroup": key.group,
        "meta": key.colour, "hovertemplate": f"{hover}<extra></extra>", "mode": "lines", "line": {"width": width},
        **more,
    }  # fmt: skip


def _packed(values: ArrayLike) -> dict[str, str]:
    """Encode an array as a plotly typed array."""
    return {"dtype": "f4", "bdata": base64.b64encode(np.asarray(values, "<f4").tobytes()).decode("ascii")}


def bars(shares: Sequence[float], key: Key, text: Iterable[str], width: float, **more: Any) -> Trace:
    """Make horizontal bars [%] of a legend entry, one per row, each with a hover text, which is escaped."""
    return {
        "type": "bar", "x": [100.0 * share for share in shares], "y": list(range(len(shares))), "orientation": "h",
        "width": width, "meta": key.colour, "name": literal(key.label), "legendgroup": key.group,
        "text": [literal(t) for t in text], "hovertemplate": "%{text}<extra></extra>", **more,
    }  # fmt: skip


def row_layout(
    names: Sequence[str], across: Axis, *, rules: Iterable[float] = (), row_px: int = 24, left_px: int = 120,
    most: int = 26, font_px: int = 10,
) -> dict[str, Any]:  # fmt: skip
    """Return layout, height and layout on phones of a chart with one row per name and dashed lines at ``rules``.

    Rows are ``row_px`` high, names ``left_px`` wide (less on phones), with at most ``most`` letters of ``font_px``
    there.
    """
    layout = {
        "xaxis": across, "yaxis": row_axis(names, most), "margin": {"l": left_px}, "barmode": "stack",
        "shapes": [rule(x=at) for at in rules],
    }  # fmt: skip
    narrow = {"yaxis.tickfont.size": font_px, "margin.l": min(left_px, 155 if most > 32 else 120)}
    return {"layout": layout, "height": row_px * len(names) + 76, "narrow": narrow}


POINTS, FEWEST, MOST = 4800, 300, 1200
"""Number of points of a line over all trials of a page, and its limits for one trial. Chosen: about two points per
pixel if two plots stand side by side."""
ROW_PX, FOOT_PX = 122, 56


def points_of_each(trials: int) -> int:
    """Return the largest number of points of a line, so that a page of many trials stays small."""
    return min(MOST, max(FEWEST, POINTS // max(trials, 1)))


@dataclass(frozen=True)
class Line:
    """One line or set of points."""

    key: Key
    time: Array  # shape (n,); NaN interrupts the line
    values: Array  # shape (n,)
    points: bool = False  # draw markers instead of a line
    width: float = 1.2  # [px]


@dataclass(frozen=True)
class Panel:
    """One of several stacked plots."""

    title: str  # title of the vertical axis
    unit: str
    lines: Sequence[Line]
    limits: tuple[float, float] | None = None  # limits of the vertical axis; None for automatic
    band: tuple[Array, Array] | None = None  # times and half heights, shape (n,); NaN interrupts it
    rule: float | None = None  # height of a dashed line
    log: bool = False  # whether the vertical axis is logarithmic


def stacked_chart(
    title: str, label: str, panels: Sequence[Panel], *, keys: Sequence[Key] = (), note: str = ""
) -> Chart:
    """Stack panels over one time axis [s]; zooming in time affects all of them."""
    names = [f"y{k}" if k > 1 else "y" for k in range(1, len(panels) + 1)]
    grid = {"rows": len(panels), "columns": 1, "ygap": 0.15, "subplots": [[f"x{name}"] for name in names]}
    across = axis("time [s]", anchor=names[-1], zeroline=False)
    layout: dict[str, Any] = {"grid": grid, "xaxis": across, "margin": {"l": 74}, "shapes": []}
    data = []
    for name, panel in zip(names, panels, strict=True):
        layout[f"yaxis{name[1:]}"] = _vertical(panel)
        data += [_trace(panel, one, name) for one in panel.lines]
        if panel.band:
            path = {"type": "path", "path": around_zero(*panel.band), "xref": "x", "yref": name}
            layout["shapes"].append(path | {"layer": "below", "line": {"width": 0}})
        if panel.rule is not None:
            layout["shapes"].append(rule(y=panel.rule, of=name, thin=True))
    return Chart(title, label, data, layout, ROW_PX * len(panels) + FOOT_PX, keys, note, {"margin.r": 6})


def _vertical(panel: Panel) -> Axis:
    text = literal(panel.title, 24) + (f"<br>[{panel.unit}]" if panel.unit else "")
    title = {"text": text, "font": {"size": 11}, "standoff": 6}
    if panel.log and panel.limits is not None:
        return log_axis("", panel.limits, nticks=4, zeroline=False, anchor="x") | {"title": title}
    limits = None if panel.limits is None else list(panel.limits)
    return {"title": title, "anchor": "x", "nticks": 5, "range": limits}


def _trace(panel: Panel, one: Line, name: str) -> Trace:
    hover = f"{literal(panel.title)}, {literal(one.key.label)}<br>%{{x:.2f}}: %{{y:.3g}} {panel.unit}"
    points = {"mode": "markers", "marker": {"size": 6}} if one.points else {}
    return line(one.time, one.values, one.key, hover, width=one.width, yaxis=name, **points)


def around_zero(time: Array, half: Array) -> str:
    """Return the outline of a band around zero as an SVG path; constant stretches keep only their ends."""
    out = []
    for piece in np.split(np.arange(len(time)), np.flatnonzero(np.isnan(time))):
        k = piece[~np.isnan(time[piece])]
        if not len(k):
            continue
        change = np.abs(np.diff(half[k])) > 1e-3 * np.nanmax(half)
        k = k[np.concatenate([[True], change]) | np.concatenate([change, [True]])]
        points = [*zip(time[k], half[k], strict=True), *zip(time[k][::-1], -half[k][::-1], strict=True)]
        out += [f"{'L' if n else 'M'}{x:.5g},{y:.4g}" for n, (x, y) in enumerate(points)] + ["Z"]
    return "".join(out)


def thinned(time: Array, values: Array, step_s: float | None = None, most: int = MOST) -> tuple[Array, Array]:
    """Decimate series for plotting: keep the minimum and maximum of every interval, and add NaN rows at pauses.

    Args:
        time: increasing times [s], shape (n,).
        values: values, shape (n, C); all columns share the kept times.
        step_s: sample period [s]; a step over 1.5 times as long is a pause. None for a series without pauses.
        most: largest number of rows to keep, not counting the ends of pauses.
    """
    n, columns = values.shape
    after = np.flatnonzero(np.diff(time) > 1.5 * step_s) + 1 if step_s else np.zeros(0, dtype=int)
    chosen = np.arange(n)
    if n > most:
        kept = {0, n - 1, *after, *(after - 1)}
        edges = np.linspace(0, n, max(2, most // (2 * columns)) + 1).astype(int)
        for start, end in pairwise(edges):
            if end > start:
                kept.update(start + np.argmin(values[start:end], axis=0))
                kept.update(start + np.argmax(values[start:end], axis=0))
        chosen = np.array(sorted(int(k) for k in kept))
    at = np.searchsorted(chosen, after)
    shown = np.insert(values[chosen].astype(float), at, np.nan, axis=0)
    return np.insert(time[chosen].astype(float), at, np.nan), shown
