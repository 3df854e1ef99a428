"""Interactive plots: plotly figures as plain JSON, with legends of buttons that keyboards reach."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mocobot_report.blocks.blocks import spelled_text
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Child, Node, data_block, el

Json = dict[str, Any]
CLEAR = "rgba(0,0,0,0)"


@dataclass(frozen=True)
class Key:
    """One entry of a legend.

    Attributes:
        group: the lines it shows and hides; empty for what cannot be hidden.
        label: what they are.
        colour: name in the palette.
        symbol: ``line``, ``dash``, ``band`` or the name of a marker.
    """

    group: str
    label: str
    colour: str
    symbol: str = "line"


def paint(name: str) -> Json:
    """A colour of the palette; the page puts in that of its theme."""
    return {"colour": name}


def shared(name: str) -> Json:
    """One of the figure's ``arrays``."""
    return {"shared": name}


def literal(text: str, most: int = 200) -> str:
    """Text of others for a plot: shortened in the middle, and not read as markup."""
    if len(text) > most:
        text = f"{text[: most // 2]}…{text[len(text) - (most - 1) // 2 :]}"
    return escape(text, quote=False)


def chart(
    book: Book,
    title: str,
    figure: Json,
    *,
    height: int,
    label: str,
    keys: Sequence[Key] = (),
    note: Child = None,
) -> Node:
    """A figure with caption, legend and plot; drawn when the reader comes near.

    Args:
        book: gives ids.
        title: of the caption.
        figure: ``data`` and ``layout`` of plotly, ``arrays`` that lines share;
            ``narrow`` changes the layout on phones, by dotted path.
        height: of the plot [px].
        label: what it shows, for those who do not see it.
        keys: the legend.
        note: below the title.
    """
    name = book.identity("figure")
    entries = [
        el("button", _swatch(key), key.label, type="button", aria_pressed="true", data_group=key.group)
        if key.group
        else el("span", _swatch(key), key.label, class_="key")
        for key in keys
    ]
    return el(
        "figure",
        el("figcaption", el("b", spelled_text(title)), note),
        el("div", *entries, class_="legend", role="group", aria_label="Shown lines; press to hide")
        if entries
        else None,
        el(
            "div",
            class_="plot",
            id=f"{name}-plot",
            style=f"height:{height}px",
            role="img",
            aria_label=label,
            data_figure=name,
        ),
        data_block(name, figure),
        class_="chart",
    )


def shared_legend(keys: Sequence[Key]) -> Node:
    """What lines and points mean in several small plots."""
    return el(
        "div", *(el("span", _swatch(key), key.label, class_="key") for key in keys), class_="legend shared"
    )


def layout(**more: Any) -> Json:
    """A plotly layout in the page's style."""
    return {
        "autosize": True,
        "showlegend": False,
        "paper_bgcolor": CLEAR,
        "plot_bgcolor": CLEAR,
        "font": {"color": paint("text"), "size": 12},
        "margin": {"l": 58, "r": 14, "t": 10, "b": 44},
        "hovermode": "closest",
        "hoverlabel": {
            "bgcolor": paint("card"),
            "bordercolor": paint("line"),
            "font": {"color": paint("text")},
        },
        "modebar": {"bgcolor": CLEAR, "color": paint("soft"), "activecolor": paint("link")},
        "uirevision": "keep",
        **more,
    }


def axis(title: str = "", **more: Any) -> Json:
    """An axis in the page's style."""
    named: Json = (
        {"title": {"text": spelled_text(title), "standoff": 8, "font": {"size": 12}}} if title else {}
    )
    return {
        **named,
        "gridcolor": paint("grid"),
        "linecolor": paint("line"),
        "zerolinecolor": paint("line"),
        "tickfont": {"color": paint("soft"), "size": 11},
        "automargin": True,
        **more,
    }


def log_axis(title: str, low: float, high: float, **more: Any) -> Json:
    """A logarithmic axis from below ``low`` to above ``high``, with labels that do not crowd."""
    ends = [float(np.log10(low)) - 0.15, float(np.log10(high)) + 0.15]
    decades = ends[1] - ends[0]
    if decades < 2.5:  # 1, 2, 5, 10, 20, 50 ...
        powers = range(int(np.floor(ends[0])), int(np.ceil(ends[1])) + 1)
        at = [m * 10.0**p for p in powers for m in (1, 2, 5) if ends[0] <= np.log10(m * 10.0**p) <= ends[1]]
        return axis(title, type="log", range=ends, tickvals=at, ticktext=[f"{v:g}" for v in at], **more)
    ticks: Json = {"dtick": 1 if decades < 7 else 2}
    # Plotly writes powers larger than other labels.
    style = {"tickfont": {"color": paint("soft"), "size": 9.5}, "exponentformat": "power", "minexponent": 3}
    return axis(title, type="log", range=ends, **style, **ticks, **more)


def dots(
    x: Sequence[float], y: Sequence[float | None], key: Key, *, up: Sequence[float | None] | None = None,
    text: Sequence[str] | None = None, size: int = 9, **more: Any,
) -> Json:  # fmt: skip
    """Points, with whiskers of so much upward (on a logarithmic axis downward has no meaning)."""
    trace: Json = {
        "type": "scatter",
        "mode": "markers",
        "x": list(x),
        "y": list(y),
        "name": key.label,
        "legendgroup": key.group,
        "marker": {"symbol": key.symbol, "color": paint(key.colour), "size": size},
        **more,
    }
    if text is not None:
        trace |= {"text": [literal(t) for t in text], "hovertemplate": "%{text}<extra></extra>"}
    if up is not None and any(up):
        trace["error_y"] = {
            "type": "data", "symmetric": False, "array": [u or 0.0 for u in up], "arrayminus": [0.0] * len(up),
            "color": paint(key.colour), "thickness": 1.3, "width": 3,
        }  # fmt: skip
    return trace


def numbers(values: ArrayLike) -> Json:
    """An array as plotly reads it fastest and smallest: float32, base64; NaN breaks a line."""
    array = np.ascontiguousarray(values, dtype="<f4")
    return {"dtype": "f4", "bdata": base64.b64encode(array.tobytes()).decode("ascii")}


def finite(values: Sequence[float] | NDArray[Any]) -> list[float | None]:
    """Plain numbers; what is not finite becomes null."""
    return [float(v) if np.isfinite(v) else None for v in values]


def rule(axis_name: str, at: float, **more: Any) -> Json:
    """A dashed line across the plot: at a value of ``y`` (or ``y2`` ...), or of ``x``."""
    line = {"color": paint("text"), "width": 1.2, "dash": "dash"}
    if axis_name.startswith("y"):
        return {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "yref": axis_name, "y0": at, "y1": at,
                "line": line, **more}  # fmt: skip
    return {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "xref": axis_name, "x0": at, "x1": at,
            "line": line, **more}  # fmt: skip


_SHAPES: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "line": ("path", {"d": "M1 6H15", "stroke-width": "2.4"}),
    "dash": ("path", {"d": "M1 6H15", "stroke-width": "2", "stroke-dasharray": "4 3"}),
    "band": ("rect", {"x": "1", "y": "2", "width": "14", "height": "8"}),
    "circle": ("circle", {"cx": "8", "cy": "6", "r": "4.5"}),
    "circle-open": ("circle", {"cx": "8", "cy": "6", "r": "4", "fill": "none", "stroke-width": "1.8"}),
    "square": ("rect", {"x": "4", "y": "2", "width": "8", "height": "8"}),
    "diamond": ("path", {"d": "M8 0.5L13.5 6L8 11.5L2.5 6Z"}),
    "triangle-down": ("path", {"d": "M2.5 2H13.5L8 11Z"}),
    "triangle-up": ("path", {"d": "M2.5 10H13.5L8 1Z"}),
    "x": ("path", {"d": "M4 2L12 10M12 2L4 10", "stroke-width": "2.4"}),
}


def _swatch(key: Key) -> Node:
    name, shape = _SHAPES[key.symbol]
    paint = f"var(--{key.colour})"
    drawn = el(name)
    for attribute, value in ({"fill": paint, "stroke": paint, "stroke-width": "0"} | dict(shape)).items():
        drawn.set(attribute, value)
    swatch = el("svg", drawn, width=16, height=12, aria_hidden="true")
    swatch.set("viewBox", "0 0 16 12")
    return swatch
