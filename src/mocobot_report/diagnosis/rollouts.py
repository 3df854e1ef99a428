"""Rollouts of a serial robot: how far simulated joints are from measured ones, before and after."""

from collections.abc import Mapping
from typing import Any

from discrepancy.result.text_rollouts import blocks, diverged_sentences, lost, shown_units
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.numbers import NONE, percent
from mocobot_report.blocks.prose import paragraph, tidy
from mocobot_report.blocks.tables import Entry, Num, table, value
from mocobot_report.blocks.units import spelled_text

Values = Mapping[str, Any]


def rollout_section(book: Book, values: Values) -> Node | None:
    """Free rollouts and the closed loop; None where the JSON has nothing of them."""
    rolled = values.get("rollouts")
    if rolled is None:
        return None
    inside: list[Node] = []
    if rolled["why_not"] is not None:
        inside.append(paragraph(tidy(f"Not rolled out freely: {rolled['why_not']}.")))
    else:
        inside += _free(rolled)
    loop = rolled["commanded"]
    if loop["why_not"] is not None:
        inside.append(paragraph(tidy(f"The closed loop was not simulated: {loop['why_not']}.")))
    else:
        inside += _loop(rolled, loop)
    return section(book, "Simulated from measured states", *inside)


def _free(rolled: Values) -> list[Node]:
    said = f"From measured states the model is let go under the logged torques, {blocks(rolled)}."
    more = [*diverged_sentences(rolled), *rolled["refused"]]
    if rolled["not_simulated"]:
        more.append(f"Not in the rollouts: {', '.join(rolled['not_simulated'])}.")
    rows: list[list[Entry]] = []
    for j in range(len(rolled["joints"])):
        for k, horizon in enumerate(rolled["horizons"]):
            sides = [
                None if horizon[which] is None else horizon[which]["rms"][j] for which in ("before", "after")
            ]
            share = None if horizon["removed"] is None else horizon["removed"][j]
            rows.append(
                [
                    _named(rolled, j) if not k else "",
                    value(horizon["seconds"], 2),
                    *_row(rolled, j, sides, share, named=horizon["after"] is not None),
                    Num(str(horizon["starts"])),
                ]
            )
    head = ["joint", "ahead [s]", *_heads(named=rolled["horizons"][0]["after"] is not None), "starts"]
    note = "rms over the starts; a dash where more than half of the rollouts diverged"
    return [
        paragraph(tidy(" ".join([said, *more]))),
        table("Error of the position after free rollouts", head, rows, note=note, groups=True),
    ]


def _loop(rolled: Values, loop: Values) -> list[Node]:
    named = loop["after"] is not None
    rows: list[list[Entry]] = []
    for j in range(len(rolled["joints"])):
        sides = [loop["before"][j], loop["after"][j] if named else None]
        rows.append(
            [_named(rolled, j), *_row(rolled, j, sides, loop["removed"][j] if named else None, named=named)]
        )
    count = len(loop["blocks"])
    missing = [
        f"of the {word} model {lost(loop['blocks'], which)} of {count} blocks diverged and are left out"
        for which, word in (("before", "given"), ("after", "extended"))
        if lost(loop["blocks"], which)
    ]
    note = "; ".join(["rms over the blocks under their logged commands", *missing])
    return [table("Error of the position in closed loop", ["joint", *_heads(named=named)], rows, note=note)]


def _heads(*, named: bool) -> list[str]:
    return ["before", "after", "removed"] if named else ["error"]


def _named(rolled: Values, j: int) -> str:
    return f"{rolled['joints'][j]} [{spelled_text(shown_units(rolled)[rolled['units'][j]][0])}]"


def _row(
    rolled: Values, j: int, sides: list[float | None], share: float | None, *, named: bool
) -> list[Entry]:
    scale = shown_units(rolled)[rolled["units"][j]][1]
    numbers: list[Entry] = [
        Num(NONE) if x is None else value(scale * x, 3) for x in sides[: 2 if named else 1]
    ]
    return [*numbers, *([Num(NONE if share is None else percent(share))] if named else [])]
