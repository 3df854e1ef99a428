"""Legends: what the marks of a plot mean, as buttons that show and hide where they can."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mocobot_report.blocks.html import Node, el


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


def legend(keys: Sequence[Key]) -> Node | None:
    """The legend of one plot; None if there is nothing to say."""
    entries = [
        el("button", _swatch(key), key.label, type="button", aria_pressed="true", data_group=key.group)
        if key.group
        else _still(key)
        for key in keys
    ]
    if not entries:
        return None
    return el("div", *entries, class_="legend", role="group", aria_label="Shown lines; press to hide")


def shared_legend(keys: Sequence[Key]) -> Node:
    """What lines and points mean in several small plots."""
    return el("div", *map(_still, keys), class_="legend shared")


def _still(key: Key) -> Node:
    return el("span", _swatch(key), key.label, class_="key")


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
    "triangle-up-open": ("path", {"d": "M3.2 9.5H12.8L8 2Z", "fill": "none", "stroke-width": "1.8"}),
    "x": ("path", {"d": "M4 2L12 10M12 2L4 10", "stroke-width": "2.4"}),
}


def _swatch(key: Key) -> Node:
    name, shape = _SHAPES[key.symbol]
    colour = f"var(--{key.colour})"
    drawn = el(name, **{"fill": colour, "stroke": colour, "stroke-width": "0"} | dict(shape))
    return el("svg", drawn, width=16, height=12, aria_hidden="true", viewBox="0 0 16 12")
