"""Colours of the page and its plots, for a light and a dark theme.

Series use the colour-blind safe set of Okabe and Ito, darkened or lightened for contrast.
"""

from collections.abc import Mapping
from typing import Any

_THEMES = {
    "page": ("#f6f7f9", "#0f141a"),
    "card": ("#ffffff", "#171d25"),
    "sunk": ("#eef1f5", "#1f2731"),
    "text": ("#18202b", "#e8edf3"),
    "soft": ("#4f5b6b", "#a9b5c3"),
    "line": ("#d5dbe3", "#34404e"),
    "grid": ("#e3e8ee", "#2a3440"),
    "link": ("#0a5ca8", "#7cc0ff"),
    "focus": ("#0a5ca8", "#7cc0ff"),
    "good": ("#116b43", "#63d6a1"),
    "good-card": ("#e3f4eb", "#12352a"),
    "warn": ("#804d00", "#f2bd5c"),
    "warn-card": ("#fdf0d8", "#3a2c10"),
    "bad": ("#a3261b", "#ff9c90"),
    "bad-card": ("#fde8e5", "#431d1a"),
    "band": ("#dde3ea", "#2b3541"),
    **dict.fromkeys(("nominal", "after", "r1"), ("#0068b0", "#56b4e9")),
    **dict.fromkeys(("uncalibrated", "before", "r2"), ("#c24e00", "#f2904a")),
    **dict.fromkeys(("ideal", "truth", "c3", "r3"), ("#00805c", "#2fc49a")),
    **dict.fromkeys(("c1", "r4"), ("#a6407d", "#e08fc0")),
    **dict.fromkeys(("c2", "r5"), ("#8a6a00", "#e3c04a")),
    **dict.fromkeys(("paper", "r6"), ("#59616d", "#b8c1cc")),
}
"""Every colour in the light and in the dark theme."""
LIGHT = {name: light for name, (light, _) in _THEMES.items()}
DARK = {name: dark for name, (_, dark) in _THEMES.items()}


def template(colours: Mapping[str, str]) -> dict[str, Any]:
    """Make the plotly template of all plots in ``LIGHT`` or ``DARK``; traces name their colour in ``meta``."""
    text, soft, card, line = (colours[name] for name in ("text", "soft", "card", "line"))
    clear = "rgba(0,0,0,0)"
    axis = {
        "gridcolor": colours["grid"], "showline": True, "linecolor": line, "zerolinecolor": line, "automargin": True,
        "tickfont": {"color": soft, "size": 11}, "title": {"standoff": 8, "font": {"size": 12}},
    }  # fmt: skip
    layout = {
        "showlegend": False, "paper_bgcolor": clear, "plot_bgcolor": clear, "hovermode": "closest",
        "font": {"color": text, "size": 12}, "margin": {"l": 58, "r": 12, "t": 8, "b": 44},
        "hoverlabel": {"bgcolor": card, "bordercolor": line, "font": {"color": text}},
        "shapedefaults": {"line": {"color": text, "width": 1.2, "dash": "dash"}, "fillcolor": colours["band"]},
        "xaxis": axis, "yaxis": axis,
    }  # fmt: skip
    bar = {"type": "bar", "insidetextfont": {"color": card}, "outsidetextfont": {"color": text}}
    return {"layout": layout, "data": {"bar": [bar]}}
