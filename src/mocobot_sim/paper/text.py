"""Tables II-V as text."""

from collections.abc import Sequence
from textwrap import wrap

from mocobot_sim.paper.tables import AllScores, Cell, Row, number, paper_tables, summary_table


def format_tables(scores: AllScores) -> str:
    """All four tables.

    Args:
        scores: by preset, then payload, as in ``paper.json``.
    """
    blocks = []
    for table in paper_tables(scores):
        rows, last = [], ""
        for row in table.rows:
            head = f"({row.payload})" if row.payload != last else ""
            label = row.quantity if row.unit == "deg" else f"{row.quantity} [{row.unit}]"
            rows.append([head, _framed(label, row), *map(format_cell, row.cells)])
            last = row.payload
        shown = _align(_heads(["", "", *table.columns]), rows)
        blocks.append(f"Table {table.number}. {table.title}\n{_wrapped(table.note)}\n\n{shown}")
    return "\n\n".join(blocks)


def format_summary(scores: AllScores) -> str:
    """The summary as text."""
    table = summary_table(scores)
    rows = [
        [_framed(f"{row.quantity} [{row.unit}]", row), *map(format_cell, row.cells)] for row in table.rows
    ]
    shown = _align(_heads([table.title, *table.columns]), rows)
    return f"{shown}\n\n{_wrapped(table.note)}" if table.note else shown


def format_cell(cell: Cell) -> str:
    """``0.94 +- 0.21``, two significant digits; ``none`` where there is no number."""
    value = number(cell.value)
    return value if cell.spread is None else f"{value} +- {number(cell.spread)}"


def _framed(label: str, row: Row) -> str:
    return f"{label}, {row.frames}" if row.frames else label


def _heads(columns: Sequence[str]) -> list[list[str]]:
    """Heads in two lines where one has a comma."""
    if not any(", " in column for column in columns):
        return [list(columns)]
    parts = [column.partition(", ") for column in columns]
    return [[first + comma.strip() for first, comma, _ in parts], [second for _, _, second in parts]]


def _wrapped(note: str) -> str:
    held = note.replace(" %", "\0%")  # a number and its unit stay together
    return "\n".join(wrap(held, 120)).replace("\0", " ")


def _align(heads: Sequence[Sequence[str]], rows: Sequence[Sequence[str]]) -> str:
    cells = [*heads, *rows]
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]
    return "\n".join([*lines[: len(heads)], "-" * max(map(len, lines)), *lines[len(heads) :]])
