"""A campaign's summary as text, and its sets as a table for other programs."""

import csv
import io
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from mocobot_report.campaign import sentences, tables

WIDTH = 110
COLUMNS = (
    "key", "background", "team", "cause", "robot", "joint", "factor", "verdict", "named", "probability", "right",
    "extras", "error",
)  # fmt: skip
Json = Mapping[str, Any]


def format_campaign(summary: Json) -> str:
    """The text report."""
    head, *more = sentences(summary)
    parts = [
        "\n".join([*_fill(head), *(line for sentence in more for line in _fill(sentence, "- "))]),
        *(f"{title}\n\n{_aligned(heads, rows)}" for title, heads, rows in tables(summary)),
        _failed(summary["sets"]["failed"]),
    ]
    return "\n\n".join(part for part in parts if part)


def csv_table(summary: Json) -> str:
    """One line for each set that was diagnosed, with the columns of ``COLUMNS``; empty where there is nothing."""
    out = io.StringIO()
    writer = csv.DictWriter(out, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for record in summary["records"]:
        writer.writerow(record | {"extras": " ".join(record["extras"])})
    return out.getvalue()


def _failed(failed: Sequence[Json]) -> str:
    lines = [
        line
        for entry in failed
        for line in _fill(f"{entry['key']}: {entry['error'].strip().splitlines()[-1]}", "- ")
    ]
    return "\n".join([f"Not diagnosed: {len(failed)}", "", *lines]) if lines else ""


def _fill(sentence: str, mark: str = "") -> list[str]:
    held = sentence.replace(" %", "\0%")  # a number and its unit stay together
    lines = textwrap.wrap(held, WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark))
    return [line.replace("\0", " ") for line in lines]


def _aligned(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in [heads, *rows]
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])
