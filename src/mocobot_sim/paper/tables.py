"""Tables II-V: the paper's columns, then one column per sensor preset, as rows of numbers and as text."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mocobot_sim.paper.published import published_errors

PAIRS = ("12", "23", "31")
MOMENTS = ("Ixx", "Iyy", "Izz")
PAPER = "paper"
"""Name of the column of published figures."""
Scores = Mapping[str, Any]
AllScores = Mapping[str, Mapping[str, Scores]]
"""By preset, then payload, as in ``paper.json``."""


@dataclass(frozen=True)
class Cell:
    """One number, with its spread where it is a mean of several; None marks what there is not."""

    value: float | None
    spread: float | None = None


@dataclass(frozen=True)
class Row:
    """One quantity of one payload.

    Attributes:
        payload: its name; empty in the summary, which is over all payloads.
        quantity: such as ``R12`` or ``mass``.
        unit: of the numbers.
        cells: one per column of the table.
    """

    payload: str
    quantity: str
    unit: str
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class PaperTable:
    """A table with one column of published figures, then ours.

    Attributes:
        number: of the paper's table, such as ``II``; empty for the summary.
        title: what it shows.
        note: what the numbers are.
        columns: ``paper``, then the presets.
        rows: payload by payload.
    """

    number: str
    title: str
    note: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    def part(self, unit: str, quantity: str | None = None) -> PaperTable:
        """The rows of one unit only, or of one quantity in it."""
        rows = tuple(row for row in self.rows if row.unit == unit and quantity in (None, row.quantity))
        return replace(self, rows=rows)


def paper_tables(scores: AllScores) -> list[PaperTable]:
    """Tables II, III, IV and V.

    Args:
        scores: by preset, then payload, as in ``paper.json``.
    """
    columns, payloads = _columns(scores)

    def table(
        number: str, title: str, note: str, kinds: Sequence[tuple[str, str, Callable[[Scores], Cell]]]
    ) -> PaperTable:
        rows = tuple(
            Row(payload, quantity, unit, tuple(cell(column[payload]) for column in columns.values()))
            for payload in payloads
            for quantity, unit, cell in kinds
        )
        return PaperTable(number, title, note, tuple(columns), rows)

    return [
        table(
            "II",
            "Relative grasp orientation: error angle [deg]",
            "mean +- standard deviation over the random trials",
            [(f"R{pair}", "deg", lambda s, key=f"R{pair}_deg": _mean(s[key])) for pair in PAIRS],
        ),
        table(
            "III",
            "Relative grasp position: error [m] and error relative to |p| [%]",
            "mean +- standard deviation over the random trials",
            [
                (f"p{pair}", unit, lambda s, key=f"p{pair}_{key}": _mean(s[key]))
                for pair in PAIRS
                for unit, key in (("m", "m"), ("%", "percent"))
            ],
        ),
        table(
            "IV",
            "Mass and centre of mass: error, and error relative to the truth [%]",
            "one set of six static holds",
            [
                ("m", "kg", lambda s: Cell(s["m_kg"])),
                ("m", "%", lambda s: Cell(s["m_percent"])),
                ("p1c", "m", lambda s: Cell(s["p1c_m"])),
                ("p1c", "%", lambda s: Cell(s["p1c_percent"])),
            ],
        ),
        table(
            "V",
            "Principal moments of inertia: error [kg m^2] and relative error [%]",
            "|mean error| +- standard deviation of the estimates over random and periodic trials",
            [(name, "kg m^2", lambda s, n=name: _mean(s["all"][n])) for name in MOMENTS]
            + [
                (name, "%", lambda s, n=name: Cell(s["all"][n]["percent"], s["all"][n]["std_percent"]))
                for name in MOMENTS
            ],
        ),
    ]


def summary_table(scores: AllScores) -> PaperTable:
    """The largest mean error of every kind over payloads (and pairs or moments), the paper's beside ours."""
    columns, payloads = _columns(scores)

    def moments(kind: str) -> Callable[[Scores], list[float | None]]:
        return lambda s: [s[kind][name]["percent"] for name in MOMENTS] if kind in s else []

    kinds: list[tuple[str, str, float, Callable[[Scores], list[float | None]]]] = [
        ("grasp rotation", "deg", 1.0, lambda s: [s[f"R{pair}_deg"]["mean"] for pair in PAIRS]),
        ("grasp position", "mm", 1e3, lambda s: [s[f"p{pair}_m"]["mean"] for pair in PAIRS]),
        ("grasp position", "%", 1.0, lambda s: [s[f"p{pair}_percent"]["mean"] for pair in PAIRS]),
        ("mass", "%", 1.0, lambda s: [s["m_percent"]]),
        ("centre of mass", "mm", 1e3, lambda s: [s["p1c_m"]]),
        ("centre of mass", "%", 1.0, lambda s: [s["p1c_percent"]]),
        ("inertia, all trials", "%", 1.0, moments("all")),
        ("inertia, periodic trials", "%", 1.0, moments("periodic")),
        ("inertia, random trials", "%", 1.0, moments("random")),
    ]

    def largest(
        column: Mapping[str, Scores], scale: float, values: Callable[[Scores], list[float | None]]
    ) -> Cell:
        found = [value for payload in payloads for value in values(column[payload])]
        return Cell(max((scale * value for value in found if value is not None), default=None))

    rows = tuple(
        Row("", quantity, unit, tuple(largest(column, scale, values) for column in columns.values()))
        for quantity, unit, scale, values in kinds
    )
    return PaperTable("", "largest error over the payloads", "", tuple(columns), rows)


def format_tables(scores: AllScores) -> str:
    """All four tables.

    Args:
        scores: by preset, then payload, as in ``paper.json``.
    """
    blocks = []
    for table in paper_tables(scores):
        cells, last = [["", "", *table.columns]], ""
        for row in table.rows:
            head = f"({row.payload})" if row.payload != last else ""
            label = row.quantity if row.unit == "deg" else f"{row.quantity} [{row.unit}]"
            cells.append([head, label, *map(format_cell, row.cells)])
            last = row.payload
        blocks.append(f"Table {table.number}. {table.title}\n{table.note}\n\n{_align(cells)}")
    return "\n\n".join(blocks)


def format_summary(scores: AllScores) -> str:
    """The summary as text."""
    table = summary_table(scores)
    cells = [[table.title, *table.columns]]
    cells += [[f"{row.quantity} [{row.unit}]", *map(format_cell, row.cells)] for row in table.rows]
    return _align(cells)


def format_cell(cell: Cell) -> str:
    """``0.94 +- 0.21``, two significant digits; ``none`` where there is no number."""
    value = _number(cell.value)
    return value if cell.spread is None else f"{value} +- {_number(cell.spread)}"


def _columns(scores: AllScores) -> tuple[dict[str, Mapping[str, Scores]], list[str]]:
    """The columns by name, the published figures first, and the payloads."""
    payloads = list(next(iter(scores.values())))
    return {PAPER: {p: published_errors(p) for p in payloads}, **scores}, payloads


def _mean(entry: Mapping[str, float | None]) -> Cell:
    return Cell(entry["mean"], entry["std"])


def _number(value: float | None) -> str:
    if value is None:
        return "none"
    return f"{value:.2g}" if value >= 1e-4 or value == 0 else f"{value:.1e}"


def _align(cells: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])
