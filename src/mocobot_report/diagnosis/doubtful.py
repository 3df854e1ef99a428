"""What a diagnosis does not name: suspicions, and kinds of which all places are off."""

from collections.abc import Mapping
from typing import Any

from discrepancy.result.evidence_list import label
from discrepancy.result.read import kind_of
from discrepancy.result.remains import farthest, remedy, sizes_of
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.html import Node
from mocobot_report.blocks.numbers import about
from mocobot_report.blocks.prose import bullets, paragraph, tidy
from mocobot_report.blocks.tables import Entry, Num, table, value
from mocobot_report.diagnosis.keys import cause_name, chance_of

Values = Mapping[str, Any]


def doubtful_sections(book: Book, values: Values) -> list[Node]:
    """Kinds that scatter, and suspected causes, where there are any."""
    out = []
    if values["scatter"]:
        out.append(
            section(
                book,
                "Off at all places alike",
                paragraph(tidy(remedy(values))),
                _scatter(values),
                _places(values),
            )
        )
    if values["suspected"]:
        out.append(section(book, "Suspected", _suspected(values)))
    return out


def _scatter(values: Values) -> Node:
    rows: list[list[Entry]] = [
        [
            cause_name(entry["kind"], entry["cause"]),
            tidy(sizes_of(entry, "spread"), inside=True),
            tidy(sizes_of(entry, "tolerance"), inside=True),
            Num(about(entry["factor"])),
            Num(str(entry["places"])),
            value(entry["nats"]),
        ]
        for entry in values["scatter"]
    ]
    return table(
        "Kinds that scatter more than their tolerance",
        ["cause", "spread", "tolerance", "factor", "places", "likelier by [nats]"], rows, stack=True,
        note="standard deviation over all places, learnt from the recordings",
    )  # fmt: skip


def _places(values: Values) -> Node | None:
    """The places of every kind that are farthest off."""
    told = [(entry, farthest(entry)) for entry in values["scatter"]]
    said = [f"{kind_of(entry)}: farthest off are {where}" for entry, where in told if where]
    return bullets([tidy(f"{text[:1].upper()}{text[1:]}.") for text in said]) if said else None


def _suspected(values: Values) -> Node:
    rows: list[list[Entry]] = [
        [
            cause_name(label(entry), entry["cause"]),
            Num(chance_of(entry["probability"])),
            value(entry["over_nothing"]),
            tidy(entry["sentence"]),
        ]
        for entry in values["suspected"]
    ]
    head = ["cause", "probability [%]", "over nothing [nats]", "it would be"]
    return table("Too improbable to be named", head, rows, stack=True)
