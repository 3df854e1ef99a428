"""Tables: captions, heads with units, numbers with their errors."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from estimator.estimate.result import PayloadEstimate
from mocobot_report.blocks.html import Child, Node, el, words
from mocobot_report.blocks.numbers import NONE, PLUS_MINUS, THIN, measured, plain
from mocobot_report.blocks.units import spelled_text


@dataclass(frozen=True)
class Num:
    """A number in a table, with its error or spread, and a unit where the column has none; right-aligned."""

    text: str
    error: str = ""
    mark: bool = False
    unit: str = ""


Entry = str | Num | Node


def value(number: float | None, digits: int = 3, *, mark: bool = False) -> Num:
    """A number of so many significant digits."""
    return Num(plain(number, digits), mark=mark)


def measurement(number: float | None, se: float | None, unit: str = "") -> Num:
    """Value and standard error, rounded to the error's second digit."""
    return Num(*measured(number, se), unit=unit)


def component(values: ArrayLike | None, errors: ArrayLike | None, k: int, scale: float = 1.0) -> Num:
    """One component of a measured vector; a dash where it is not known."""
    if values is None or errors is None:
        return Num(NONE)
    return measurement(scale * float(np.asarray(values)[k]), scale * float(np.asarray(errors)[k]))


def table(
    caption: str,
    head: Sequence[str],
    rows: Sequence[Sequence[Entry]],
    *,
    note: str = "",
    headers: int = 1,
    groups: bool = False,
    stack: bool = False,
) -> Node:
    """A table in a box of its own that scrolls if it is too wide; the page shows then that there is more.

    A column ``unit`` right after the row headers is written behind them, so that narrow screens show the numbers.

    Args:
        caption: what it shows.
        head: names of the columns; a unit in brackets is kept together.
        rows: entries; the first ``headers`` of each are row headers.
        note: second line of the caption.
        headers: number of leading columns that head their rows.
        groups: an empty first entry continues the group above.
        stack: on narrow screens every row is a heading, with its entries and their columns' names below; for tables
            whose rows have long names.
    """
    if len(head) > headers and head[headers] == "unit":
        head = [*head[:headers], *head[headers + 1 :]]
        rows = [
            [*row[: headers - 1], _with_unit(row[headers - 1], row[headers]), *row[headers + 1 :]]
            for row in rows
        ]
    role = _ROLES if stack else {}
    numeric = [any(isinstance(row[k], Num) for row in rows) for k in range(len(head))]
    titles = [
        el(
            "th",
            spelled_text(name),
            scope="col",
            class_="num" if numeric[k] else None,
            role=role.get("column"),
        )
        if name
        else el("td", role=role.get("cell"))
        for k, name in enumerate(head)
    ]
    body = []
    for k, row in enumerate(rows):
        first = groups and k > 0 and row[0] != ""
        cells = [_cell(entry, k < headers) for k, entry in enumerate(row)]
        if stack:
            for cell, name in zip(cells, head, strict=True):
                heads = cell.tag == "th"
                cell.set("role", _ROLES["row header" if heads else "cell"])
                if name and not heads:
                    cell.set("data-label", spelled_text(name))
        body.append(el("tr", *cells, class_="first" if first else None, role=role.get("row")))
    shown = el("caption", el("span", caption), el("span", note, class_="note") if note else None)
    top = el("thead", el("tr", *titles, role=role.get("row")), role=role.get("group"))
    whole = el("table", shown, top, el("tbody", *body, role=role.get("group")), role=role.get("table"))
    return el("div", whole, class_="scroll stack" if stack else "scroll", role="region", aria_label=caption)


_ROLES = {
    "table": "table", "group": "rowgroup", "row": "row", "column": "columnheader", "row header": "rowheader",
    "cell": "cell",
}  # fmt: skip
"""Said aloud, since a table that is laid out otherwise is none to a screen reader."""


def _with_unit(name: Entry, unit: Entry) -> Node:
    """A row's header with its unit behind it."""
    text = unit if isinstance(unit, str) else words(unit) if isinstance(unit, Node) else unit.text
    shown = name.text if isinstance(name, Num) else name
    return el("span", shown, *([" ", el("span", text, class_="unit")] if text else []))


LONG = 44
"""Characters above which a cell's text may wrap."""


def _cell(entry: Entry, header: bool) -> Node:
    if isinstance(entry, Num):
        error = el("span", f" {PLUS_MINUS} {entry.error}", class_="pm") if entry.error else None
        unit = f"{THIN}{entry.unit}" if entry.unit else None
        return el("td", entry.text, error, unit, class_="num mark" if entry.mark else "num")
    text = entry if isinstance(entry, str) else words(entry)
    kind = "long" if len(text) > LONG else None
    if header and text:
        return el("th", entry, scope="row", class_=kind)
    return el("td", entry, class_=kind)


SYMBOL = re.compile(r"\b([RpIT])_?(1c|\d\d|\d|xx|yy|zz|xy|xz|yz|b)\b")


def quantity(text: str) -> Node:
    """The name of a quantity, such as ``p_1c x``, with its indices lowered."""
    out: list[Child] = []
    at = 0
    for match in SYMBOL.finditer(text):
        out += [text[at : match.start()], el("i", match[1]), el("sub", match[2])]
        at = match.end()
    return el("span", *out, text[at:])


def mass(e: PayloadEstimate) -> Num:
    """The mass [kg]."""
    return measurement(e.mass.mass, e.mass.se) if e.mass else Num(NONE)


def place(e: PayloadEstimate, k: int) -> Num:
    """One coordinate of the centre of mass in {1} [mm]."""
    return component(e.p_1c, e.p_1c_se_m, k, 1e3)


def moment(e: PayloadEstimate, k: int) -> Num:
    """One principal moment of inertia [kg m²]."""
    return (
        component(e.inertia.principal.moments, e.inertia.principal.moments_se, k) if e.inertia else Num(NONE)
    )


def distance(e: PayloadEstimate, i: int, j: int) -> Num:
    """Distance of two grasps [mm]; robots counted from 1."""
    if e.grasps is None or max(i, j) > e.robots:
        return Num(NONE)
    pair = e.grasps.pair(i, j)
    return measurement(1e3 * float(np.linalg.norm(pair.p_ij)), 1e3 * pair.distance_se_m)
