"""The page's building blocks: sections, tables, tiles, tabs, lists."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Child, Node, el, words
from mocobot_report.blocks.numbers import MINUS, NONE, PLUS_MINUS, measured, plain, spelled


@dataclass(frozen=True)
class Num:
    """A number in a table, with its error or spread; right-aligned."""

    text: str
    error: str = ""
    mark: bool = False


Entry = str | Num | Node


def value(number: float | None, digits: int = 3, *, mark: bool = False) -> Num:
    """A number of so many significant digits."""
    return Num(plain(number, digits), mark=mark)


def measurement(number: float | None, se: float | None) -> Num:
    """Value and standard error, rounded to the error's second digit."""
    return Num(*measured(number, se))


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
) -> Node:
    """A table in a box of its own that scrolls if it is too wide.

    Args:
        caption: what it shows.
        head: names of the columns; a unit in brackets is kept together.
        rows: entries; the first ``headers`` of each are row headers.
        note: second line of the caption.
        headers: number of leading columns that head their rows.
        groups: an empty first entry continues the group above.
    """
    numeric = [any(isinstance(row[k], Num) for row in rows) for k in range(len(head))]
    titles = [
        el("th", spelled_text(name), scope="col", class_="num" if numeric[k] else None) if name else el("td")
        for k, name in enumerate(head)
    ]
    body = []
    for k, row in enumerate(rows):
        first = groups and k > 0 and row[0] != ""
        cells = [_cell(entry, k < headers) for k, entry in enumerate(row)]
        body.append(el("tr", *cells, class_="first" if first else None))
    shown = el("caption", el("span", caption), el("span", note, class_="note") if note else None)
    whole = el("table", shown, el("thead", el("tr", *titles)), el("tbody", *body))
    return el("div", whole, class_="scroll", role="region", aria_label=caption)


LONG = 44
"""Characters above which a cell's text may wrap."""


def _cell(entry: Entry, header: bool) -> Node:
    if isinstance(entry, Num):
        error = el("span", f" {PLUS_MINUS} {entry.error}", class_="pm") if entry.error else None
        return el("td", entry.text, error, class_="num mark" if entry.mark else "num")
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


def spelled_text(text: str) -> str:
    """Text whose bracketed unit is printed with superscripts and does not break."""
    return re.sub(r"\[(.*?)\]", lambda m: f"[{spelled(m[1])}]", text)


def section(book: Book, title: str, *children: Child, level: int = 3, identity: str | None = None) -> Node:
    """A section with its heading."""
    name = identity or book.identity("part")
    heading = el(f"h{level}", title, id=f"{name}-title")
    return el("section", heading, *children, id=name, aria_labelledby=f"{name}-title")


def paragraph(*children: Child, kind: str | None = None) -> Node:
    """A paragraph."""
    return el("p", *children, class_=kind)


def verdict(kind: str, label: str, *sentences: Child) -> Node:
    """A box that says something first: ``good``, ``warn``, ``bad`` or ``plain``."""
    return el(
        "div", el("p", label, class_="label"), *(el("p", s) for s in sentences), class_=f"verdict {kind}"
    )


def tiles(entries: Sequence[tuple[str, str, str]]) -> Node:
    """Name, value and what goes with it, side by side."""
    boxes = [
        el("div", el("dt", n), el("dd", v, el("small", more) if more else None)) for n, v, more in entries
    ]
    return el("dl", *boxes, class_="tiles")


def tabs(book: Book, name: str, panels: Sequence[tuple[str, Child]]) -> list[Node]:
    """Panels of which one is shown at a time; radio buttons, so arrow keys choose. A single panel needs no choice."""
    group = book.identity("choice")
    shown = [
        el("div", content, id=f"{group}-{k}", data_panel=True, role="group", aria_label=label)
        for k, (label, content) in enumerate(panels)
    ]
    if len(panels) == 1:
        return shown
    inputs = [
        el(
            "label",
            el("input", type="radio", name=group, value=f"{group}-{k}", checked=k == 0, autocomplete="off"),
            label,
        )
        for k, (label, _) in enumerate(panels)
    ]
    return [el("fieldset", el("legend", name), *inputs, class_="tabs"), *shown]


def bullets(sentences: Sequence[Child]) -> Node:
    """A list of sentences."""
    return el("ul", *(el("li", sentence) for sentence in sentences))


def folded(title: str, *children: Child) -> Node:
    """Details that open on demand."""
    return el("details", el("summary", title), *children)


def facts(entries: Sequence[tuple[str, Child]]) -> Node:
    """Names and what they are."""
    return el("dl", *((el("dt", n), el("dd", v if v else NONE)) for n, v in entries), class_="facts")


def tidy(sentence: str, *, inside: bool = False) -> str:
    """A sentence of a result in the page's typography: ``+-`` and powers as signs, a capital unless it goes on."""
    text = sentence.replace(" +- ", f"\u00a0{PLUS_MINUS}\u00a0").replace("chi2/n", "chi²/n")
    text = re.sub(r"(?<![\w.])-(?=\d)", MINUS, text)
    return text if inside else text[:1].upper() + text[1:]
