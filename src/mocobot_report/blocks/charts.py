"""Interactive plots: plotly figures without colours of their own, which the page's theme gives them."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Child, Node, data_block, el
from mocobot_report.blocks.legend import Key, legend
from mocobot_report.blocks.theme import TEMPLATES
from mocobot_report.blocks.units import spelled_text

Axis = dict[str, Any]
"""Properties of ``go.layout.XAxis`` or ``YAxis``, which checks them."""


def chart(
    book: Book, title: str, shown: go.Figure, *, height: int, label: str, keys: Sequence[Key] = (), note: Child = None,
    narrow: Mapping[str, float] | None = None,
) -> Node:  # fmt: skip
    """A figure with caption, legend and plot; drawn when the reader comes near.

    Args:
        book: gives ids.
        title: of the caption.
        shown: the plot.
        height: of the plot [px].
        label: what it shows, for those who do not see it.
        keys: the legend.
        note: below the title.
        narrow: what changes in the layout on phones, by dotted path.
    """
    name = book.identity("figure")
    plot = el(
        "div", class_="plot", id=f"{name}-plot", style=f"height:{height}px", role="img", aria_label=label,
        data_figure=name,
    )  # fmt: skip
    caption = el("figcaption", el("b", spelled_text(title)), note)
    values = data_block(name, _values(shown) | {"narrow": dict(narrow or {})})
    return el("figure", caption, legend(keys), plot, values, class_="chart")


def _values(shown: go.Figure) -> dict[str, Any]:
    """A figure as JSON without its template; arrays that traces share as ``x`` stand in ``arrays``, once."""
    values, arrays = shown.to_plotly_json(), []
    del values["layout"]["template"]
    for trace in values["data"]:
        if isinstance(trace["x"], dict):
            if trace["x"] not in arrays:
                arrays.append(trace["x"])
            trace["x"] = arrays.index(trace["x"])
    return values | {"arrays": arrays}


def figure(traces: Sequence[go.Scatter | go.Bar], **layout: Any) -> go.Figure:
    """A figure in the page's style, with more of the layout's properties."""
    return go.Figure(traces, go.Layout(template=TEMPLATES["light"], **layout))


def literal(text: str, most: int = 200) -> str:
    """Text of others for a plot: shortened in the middle, and not read as markup."""
    if len(text) > most:
        text = f"{text[: most // 2]}…{text[len(text) - (most - 1) // 2 :]}"
    return escape(text, quote=False)


def axis(title: str, **more: Any) -> Axis:
    """An axis with a title; a bracketed unit is printed with superscripts."""
    return {"title_text": spelled_text(title), **more}


def log_axis(title: str, values: Iterable[float | None], **more: Any) -> Axis:
    """A logarithmic axis of all positive values, with labels that do not crowd."""
    seen = [v for v in values if v is not None and v > 0] or [1e-3, 1.0]
    low, high = float(np.log10(min(seen))) - 0.15, float(np.log10(max(seen))) + 0.15
    if high - low < 2.5:  # 1, 2, 5, 10, 20, 50 ...
        powers = range(int(np.floor(low)), int(np.ceil(high)) + 1)
        at = [m * 10.0**p for p in powers for m in (1, 2, 5) if low <= np.log10(m * 10.0**p) <= high]
        ticks: Axis = {"tickvals": at, "ticktext": [f"{v:g}" for v in at]}
    else:  # plotly writes powers larger than other labels
        ticks = {
            "tickfont_size": 9.5,
            "exponentformat": "power",
            "minexponent": 3,
            "dtick": 1 if high - low < 7 else 2,
        }
    return axis(title, type="log", range=[low, high], **ticks, **more)


def row_axis(names: Sequence[str], most: int = 26) -> Axis:
    """A vertical axis of named rows: the first, at 0, on top; names of up to ``most`` letters."""
    return {**_named([literal(name, most) for name in names]), "range": [len(names) - 0.4, -0.6]}


def column_axis(names: Sequence[str]) -> Axis:
    """A horizontal axis of named columns, the first at 0; names may hold markup."""
    return {**_named(names), "range": [-0.6, len(names) - 0.4], "showgrid": False, "tickangle": 0}


def _named(names: Sequence[str]) -> Axis:
    return {
        "tickvals": list(range(len(names))),
        "ticktext": list(names),
        "zeroline": False,
        "fixedrange": True,
    }


def dots(
    x: Iterable[float | None],
    y: Iterable[float | None],
    key: Key,
    text: Iterable[str],
    *,
    size: int = 9,
    **more: Any,
) -> go.Scatter:
    """Points of one entry of a legend, with a text of others for each."""
    return go.Scatter(
        x=list(x), y=list(y), mode="markers", name=literal(key.label), legendgroup=key.group, meta=key.colour,
        marker={"symbol": key.symbol, "size": size}, text=[literal(t) for t in text],
        hovertemplate="%{text}<extra></extra>", **more,
    )  # fmt: skip


def line(x: ArrayLike, y: ArrayLike, key: Key, hover: str, *, width: float = 1.2, **more: Any) -> go.Scatter:
    """A line of one entry of a legend, in single precision; NaN breaks it."""
    return go.Scatter(
        x=np.asarray(x, "<f4"), y=np.asarray(y, "<f4"), name=literal(key.label), legendgroup=key.group, meta=key.colour,
        hovertemplate=f"{hover}<extra></extra>", **{"mode": "lines", "line": {"width": width}} | more,
    )  # fmt: skip
