"""How a diagnosis' plots and tables name things: what they compare, and causes."""

from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.legend import Key
from mocobot_report.blocks.numbers import percent
from mocobot_report.blocks.prose import tidy

LEAST = 0.001
"""Probabilities are not known better than that."""
CLEAN = Key("", "clean data", "text", "dash")


def misfits(*, named: bool, lines: bool = False) -> tuple[Key, Key]:
    """The misfit as simulated, and that within tolerances with the causes that are named, if any; dots or lines."""
    after = "with causes and tolerances" if named else "with tolerances"
    square, circle = ("line", "line") if lines else ("square", "circle")
    return Key("before", "as simulated", "before", square), Key("after", after, "after", circle)


def cause_name(words: str, cause: str) -> Node:
    """A cause in words, and softly what the command line calls it."""
    return el("span", tidy(words), " ", el("code", cause, class_="id"))


def share_of(share: float | None) -> str:
    """A share in percent, without the sign."""
    return percent(share).removesuffix("\u00a0%")


def chance_of(probability: float) -> str:
    """A probability in percent, without the sign."""
    if probability < LEAST:
        return f"< {100 * LEAST:g}"
    return f"> {100 * (1 - LEAST):g}" if probability > 1.0 - LEAST else share_of(probability)
