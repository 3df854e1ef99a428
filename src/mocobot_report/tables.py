"""Tables for the page and for notebooks, with errors and units in their cells; ``assets/table.html`` renders them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import ArrayLike

from estimator.estimate.result import PayloadEstimate
from mocobot_report.numbers import (
    NONE,
    counted,
    measured,
    percent,
    plain,
    probability,
    spelled_text,
    tidy,
    without_percent,
)


@dataclass(frozen=True)
class Num:
    """Right-aligned number in a table, with its error or spread, and a unit if the column has none."""

    text: str
    error: str = ""
    mark: bool = False
    unit: str = ""


Entry = str | Num  # a cell of a table; text is escaped unless it is ``Markup``


@cache
def templates() -> Environment:
    """Load the templates of the page; they escape all text, and an unknown name is an error."""
    made = Environment(
        loader=PackageLoader("mocobot_report", "assets"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, auto_reload=False,
    )  # fmt: skip
    made.filters |= {"spelled_text": spelled_text, "tidy": tidy, "counted": counted, "percent": percent}
    made.globals |= {"table": table, "bullets": bullets, "plain": plain}
    return made


def table(
    caption: str, head: Sequence[str], rows: Sequence[Sequence[Entry]], *, note: str = "", headers: int = 1,
    groups: bool = False, stack: bool = False,
) -> Markup:  # fmt: skip
    """Make a table in a box that scrolls if the table is too wide.

    A column ``unit`` directly after the row headers moves into them, so that narrow screens show the numbers.

    Args:
        caption, note: first and second line of the caption.
        head: names of the columns; a unit in brackets does not wrap.
        rows: cells; the first ``headers`` cells of each row are row headers.
        groups: whether an empty first cell continues the group above.
        stack: whether narrow screens show every row as a heading with its cells below, for rows with long names.
    """
    if len(head) > headers and head[headers] == "unit":
        head = [*head[:headers], *head[headers + 1 :]]
        rows = [
            [*row[: headers - 1], _with_unit(*row[headers - 1 : headers + 1]), *row[headers + 1 :]]
            for row in rows
        ]
    numeric = [any(isinstance(row[k], Num) for row in rows) for k in range(len(head))]
    shown = templates().get_template("table.html").render(
        caption=caption, head=list(zip(head, numeric, strict=True)), rows=rows, note=note, headers=headers,
        groups=groups, stack=stack,
    )  # fmt: skip
    return Markup(shown)


def _with_unit(name: Entry, unit: Entry) -> Markup:
    """Append a unit to a row header."""
    shown, text = (entry.text if isinstance(entry, Num) else entry for entry in (name, unit))
    return Markup('{} <span class="unit">{}</span>' if text else "{}").format(shown, text)


SYMBOL = re.compile(r"\b([RpIT])_?(1c|\d\d|\d|xx|yy|zz|xy|xz|yz|b)\b")


def quantity(text: str) -> Markup:
    """Typeset the name of a quantity, such as ``p_1c x``, with subscripts."""
    return Markup(SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", str(Markup.escape(text))))


def bullets(sentences: Sequence[str]) -> Markup:
    """Make a bullet list of sentences; empty without sentences."""
    items = Markup("").join(Markup("<li>{}</li>").format(sentence) for sentence in sentences)
    return Markup("<ul>{}</ul>").format(items) if items else Markup("")


def value(number: float | None, digits: int = 3, *, mark: bool = False) -> Num:
    """Make a cell with a number of ``digits`` significant digits."""
    return Num(plain(number, digits), mark=mark)


def measurement(number: float | None, se: float | None, unit: str = "") -> Num:
    """Make a cell with value and standard error, rounded to the second digit of the error."""
    return Num(*measured(number, se), unit=unit)


def component(values: ArrayLike | None, errors: ArrayLike | None, k: int, scale: float = 1.0) -> Num:
    """Make a cell with component k of an estimated vector; a dash if it is unknown."""
    if values is None or errors is None:
        return Num(NONE)
    return measurement(scale * float(np.asarray(values)[k]), scale * float(np.asarray(errors)[k]))


def vector(
    name: str, unit: str, found: Sequence[tuple[ArrayLike | None, ArrayLike | None]], scale: float = 1.0,
    parts: str = "xyz",
) -> list[list[Entry]]:  # fmt: skip
    """Make three rows with name, unit and the components of the estimated vectors with errors in ``found``."""
    return [
        [quantity(f"{name} {part}"), unit, *(component(values, errors, k, scale) for values, errors in found)]
        for k, part in enumerate(parts)
    ]


def mass(e: PayloadEstimate) -> Num:
    """Make a cell with the mass [kg]."""
    return measurement(e.mass.mass, e.mass.se) if e.mass else Num(NONE)


def place(e: PayloadEstimate, k: int) -> Num:
    """Make a cell with coordinate k of the centre of mass in {1} [mm]."""
    return component(e.p_1c, e.p_1c_se_m, k, 1e3)


def moment(e: PayloadEstimate, k: int) -> Num:
    """Make a cell with principal moment of inertia k [kg m²]."""
    if e.inertia is None:
        return Num(NONE)
    return component(e.inertia.principal.moments, e.inertia.principal.moments_se, k)


def distance(e: PayloadEstimate, i: int, j: int) -> Num:
    """Make a cell with the distance between grasps i and j [mm]; robots count from 1."""
    if e.grasps is None or max(i, j) > e.robots:
        return Num(NONE)
    pair = e.grasps.pair(i, j)
    return measurement(1e3 * float(np.linalg.norm(pair.p_ij)), 1e3 * pair.distance_se_m)


def cause_name(words: str, cause: str) -> Markup:
    """Write a cause in words, followed by its name on the command line."""
    return Markup('{} <code class="id">{}</code>').format(tidy(words), cause)


def numbers_of(cause: Mapping[str, Any]) -> list[tuple[str, str, Mapping[str, Any]]]:
    """List name, place and value of a cause's parameters; the place is empty unless the cause has several places."""
    members = cause.get("members", ())
    places = [(m["place"], m) for m in members] if len(members) > 1 else [("", cause)]
    return [(name, place, entry) for place, of in places for name, entry in of["parameters"].items()]


def sentence_of(cause: Mapping[str, Any]) -> str:
    """Return the sentence of a cause, followed by its plausible rivals."""
    others = [entry["name"] for entry in cause.get("told", ()) if entry["name"] != cause["name"]]
    also = f" It may as well be {' or '.join(others)}." if others else ""
    return tidy(f"{cause['sentence']}{also}")


def chance_of(chance: float) -> str:
    """Format a probability in percent, without the percent sign."""
    return without_percent(probability(chance))
