"""Sentences and what frames them: paragraphs, verdicts, tiles, lists."""

import re
from collections.abc import Sequence

from mocobot_report.blocks.html import Child, Node, el
from mocobot_report.blocks.numbers import MINUS, NONE, PLUS_MINUS


def paragraph(*children: Child, kind: str | None = None) -> Node:
    """A paragraph."""
    return el("p", *children, class_=kind)


def verdict(kind: str, label: str, *contents: Child) -> Node:
    """A box that says something first: ``good``, ``warn``, ``bad`` or ``plain``; sentences, and nodes such as lists."""
    inside = (el("p", content) if isinstance(content, str) else content for content in contents)
    return el("div", el("p", label, class_="label"), *inside, class_=f"verdict {kind}")


def tiles(entries: Sequence[tuple[str, str, str]]) -> Node:
    """Name, value and what goes with it, side by side."""
    boxes = [
        el("div", el("dt", n), el("dd", v, el("small", more) if more else None)) for n, v, more in entries
    ]
    return el("dl", *boxes, class_="tiles")


def bullets(sentences: Sequence[Child]) -> Node:
    """A list of sentences."""
    return el("ul", *(el("li", sentence) for sentence in sentences))


def folded(title: str, *children: Child) -> Node:
    """Details that open on demand."""
    return el("details", el("summary", title), *children)


def facts(entries: Sequence[tuple[str, Child]]) -> Node:
    """Names and what they are; a dash for an empty text."""
    return el("dl", *((el("dt", n), el("dd", NONE if v == "" else v)) for n, v in entries), class_="facts")


def tidy(sentence: str, *, inside: bool = False) -> str:
    """A sentence of a result in the page's typography: ``+-`` and powers as signs, a capital unless it goes on."""
    text = sentence.replace(" +- ", f"\u00a0{PLUS_MINUS}\u00a0").replace("+-(", f"{PLUS_MINUS}(")
    text = text.replace("chi2/n", "chi²/n")
    text = re.sub(r"(?<![\w.])-(?=\d)", MINUS, text)
    text = re.sub(r"(?<=\d )u(?=m\b)", "µ", text).replace("rad^3", "rad³").replace("m^2", "m²")
    return text if inside else text[:1].upper() + text[1:]
