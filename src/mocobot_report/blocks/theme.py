"""Themes of the plots: plotly templates, light and dark. A trace names its colour of the palette in ``meta``."""

from collections.abc import Mapping

import plotly.graph_objects as go

from mocobot_report.blocks.palette import DARK, LIGHT

_CLEAR = "rgba(0,0,0,0)"


def template(colours: Mapping[str, str]) -> go.layout.Template:
    """All that plots have in common, in the colours of a theme.

    Args:
        colours: ``palette.LIGHT`` or ``DARK``.
    """
    text, soft, card, line = (colours[name] for name in ("text", "soft", "card", "line"))
    axis = {
        "gridcolor": colours["grid"], "showline": True, "linecolor": line, "zerolinecolor": line, "automargin": True,
        "tickfont": {"color": soft, "size": 11}, "title": {"standoff": 8, "font": {"size": 12}},
    }  # fmt: skip
    layout = {
        "showlegend": False, "paper_bgcolor": _CLEAR, "plot_bgcolor": _CLEAR, "hovermode": "closest",
        "font": {"color": text, "size": 12}, "margin": {"l": 58, "r": 12, "t": 8, "b": 44},
        "hoverlabel": {"bgcolor": card, "bordercolor": line, "font": {"color": text}},
        "modebar": {"bgcolor": _CLEAR, "color": soft, "activecolor": colours["link"]},
        "shapedefaults": {"line": {"color": text, "width": 1.2, "dash": "dash"}, "fillcolor": colours["band"]},
        "xaxis": axis, "yaxis": axis,
    }  # fmt: skip
    bar = {"insidetextfont": {"color": card}, "outsidetextfont": {"color": text}}
    return go.layout.Template(layout=layout, data={"bar": [bar]})


TEMPLATES = {"light": template(LIGHT), "dark": template(DARK)}
