"""How a diagnosis' plots and tables name things: what they compare, and causes."""

from collections.abc import Mapping
from typing import Any

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


def numbers_of(cause: Mapping[str, Any]) -> list[tuple[str, str, Mapping[str, Any]]]:
    """Parameters of a cause: name, place and value; the place only of one that all joints have, for every joint."""
    members = cause.get("members", ())
    places = [(m["place"], m) for m in members] if len(members) > 1 else [("", cause)]
    return [(name, place, entry) for place, of in places for name, entry in of["parameters"].items()]


def sentence_of(cause: Mapping[str, Any]) -> str:
    """What a cause does, and what else it may be with a chance that counts."""
    others = [entry["name"] for entry in cause.get("told", ()) if entry["name"] != cause["name"]]
    return tidy(
        f"{cause['sentence']} It may as well be {' or '.join(others)}." if others else cause["sentence"]
    )


def share_of(share: float | None) -> str:
    """A share in percent, without the sign."""
    return percent(share).removesuffix("\u00a0%")


def chance_of(probability: float) -> str:
    """A probability in percent, without the sign."""
    if probability < LEAST:
        return f"< {100 * LEAST:g}"
    return f"> {100 * (1 - LEAST):g}" if probability > 1.0 - LEAST else share_of(probability)
