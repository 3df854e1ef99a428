"""Tables of the page and of notebooks: cells with errors and units, rendered by ``assets/table.html``."""

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
    """A number in a table, with its error or spread, and a unit where the column has none; right-aligned."""

    text: str
    error: str = ""
    mark: bool = False
    unit: str = ""


Entry = str | Num
"""A cell; HTML in it is ``Markup``, other text is escaped."""


@cache
def templates() -> Environment:
    """The page's templates; every text is escaped, an unknown name is an error."""
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
    """A table in a box of its own that scrolls if it is too wide.

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
    """A row's header with its unit behind it."""
    shown, text = (entry.text if isinstance(entry, Num) else entry for entry in (name, unit))
    return Markup('{} <span class="unit">{}</span>' if text else "{}").format(shown, text)


SYMBOL = re.compile(r"\b([RpIT])_?(1c|\d\d|\d|xx|yy|zz|xy|xz|yz|b)\b")


def quantity(text: str) -> Markup:
    """The name of a quantity, such as ``p_1c x``, with its indices lowered."""
    return Markup(SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", str(Markup.escape(text))))


def bullets(sentences: Sequence[str]) -> Markup:
    """A list of sentences; nothing where there are none."""
    items = Markup("").join(Markup("<li>{}</li>").format(sentence) for sentence in sentences)
    return Markup("<ul>{}</ul>").format(items) if items else Markup("")


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


def vector(
    name: str, unit: str, found: Sequence[tuple[ArrayLike | None, ArrayLike | None]], scale: float = 1.0,
    parts: str = "xyz",
) -> list[list[Entry]]:  # fmt: skip
    """Three rows: a component's name, the unit, and the component of every measured vector and error in ``found``."""
    return [
        [quantity(f"{name} {part}"), unit, *(component(values, errors, k, scale) for values, errors in found)]
        for k, part in enumerate(parts)
    ]


def mass(e: PayloadEstimate) -> Num:
    """The mass [kg]."""
    return measurement(e.mass.mass, e.mass.se) if e.mass else Num(NONE)


def place(e: PayloadEstimate, k: int) -> Num:
    """One coordinate of the centre of mass in {1} [mm]."""
    return component(e.p_1c, e.p_1c_se_m, k, 1e3)


def moment(e: PayloadEstimate, k: int) -> Num:
    """One principal moment of inertia [kg m²]."""
    if e.inertia is None:
        return Num(NONE)
    return component(e.inertia.principal.moments, e.inertia.principal.moments_se, k)


def distance(e: PayloadEstimate, i: int, j: int) -> Num:
    """Distance of two grasps [mm]; robots counted from 1."""
    if e.grasps is None or max(i, j) > e.robots:
        return Num(NONE)
    pair = e.grasps.pair(i, j)
    return measurement(1e3 * float(np.linalg.norm(pair.p_ij)), 1e3 * pair.distance_se_m)


def cause_name(words: str, cause: str) -> Markup:
    """A cause in words, and softly what the command line calls it."""
    return Markup('{} <code class="id">{}</code>').format(tidy(words), cause)


def numbers_of(cause: Mapping[str, Any]) -> list[tuple[str, str, Mapping[str, Any]]]:
    """Parameters of a cause: name, place and value; the place only of one that all joints have, for every joint."""
    members = cause.get("members", ())
    places = [(m["place"], m) for m in members] if len(members) > 1 else [("", cause)]
    return [(name, place, entry) for place, of in places for name, entry in of["parameters"].items()]


def sentence_of(cause: Mapping[str, Any]) -> str:
    """What a cause does, and what else it may be with a chance that counts."""
    others = [entry["name"] for entry in cause.get("told", ()) if entry["name"] != cause["name"]]
    also = f" It may as well be {' or '.join(others)}." if others else ""
    return tidy(f"{cause['sentence']}{also}")


def chance_of(chance: float) -> str:
    """A probability in percent, without the sign."""
    return without_percent(probability(chance))
