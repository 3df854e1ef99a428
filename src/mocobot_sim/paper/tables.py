"""Tables II-V as rows of numbers and as text: a column of the published values, then columns of each sensor preset.

Columns of joint fits (``mocobot_sim.paper.experiment``) follow that of the staged estimate. If errors in the frames
defined by the encoders are available, grasps and centres of mass have additional rows for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import wrap
from typing import Any

from mocobot_sim.paper.scoring import ENCODER_FRAMES, MOMENTS, SPRING_SCALE, published_errors

PAIRS = ("12", "23", "31")
PAPER = "paper"
"""Name of the column of published values."""
Scores = Mapping[str, Any]
AllScores = Mapping[str, Mapping[str, Scores | None]]
"""Scores by preset or column of fits, then payload, as in ``paper.json``; None if a column has no value."""
BY_ENCODERS = "encoder frames"
"""Label of rows with errors in the frames defined by the encoders; other rows use the frames of the CAD model."""


@dataclass(frozen=True)
class Cell:
    """A number and, for a mean, its standard deviation; None if missing."""

    value: float | None
    spread: float | None = None


@dataclass(frozen=True)
class Row:
    """One quantity of one payload."""

    payload: str  # name of the payload; empty in the summary, which covers all payloads
    quantity: str  # name of the quantity, such as ``R12`` or ``mass``
    unit: str  # unit of the numbers
    cells: tuple[Cell, ...]  # one per column of the table
    frames: str = ""  # ``BY_ENCODERS``; empty for the frames of the CAD model


@dataclass(frozen=True)
class PaperTable:
    """A table with one column of published values and columns of our results."""

    number: str  # number of the paper's table, such as ``II``; empty for the summary
    title: str  # title
    note: str  # explanation of the numbers
    columns: tuple[str, ...]  # ``paper``, then each preset followed by its joint fits
    rows: tuple[Row, ...]  # rows, grouped by payload

    def part(self, unit: str, quantity: str | None = None, frames: str = "") -> PaperTable:
        """Keep only the rows with a given unit and kind of frames and, unless None, a given quantity."""
        rows = tuple(
            row
            for row in self.rows
            if row.unit == unit and row.frames == frames and quantity in (None, row.quantity)
        )
        return replace(self, rows=rows)


def paper_tables(scores: AllScores) -> list[PaperTable]:
    """Make Tables II, III, IV and V.

    Args:
        scores: scores by preset, then payload, as in ``paper.json``.
    """
    columns, payloads = _columns(scores)
    frames = ("", BY_ENCODERS) if _entries(scores, ENCODER_FRAMES) else ("",)
    fits, over_trials = _fits_note(scores), "mean +- standard deviation over the random trials"

    def table(number: str, title: str, note: str, kinds: Sequence[_Kind]) -> PaperTable:
        rows = tuple(
            Row(
                payload, quantity, unit,
                tuple(_cell(column[payload], seen, value, spread) for column in columns.values()), seen,
            )
            for payload in payloads
            for quantity, unit, value, spread, seen in kinds
        )  # fmt: skip
        return PaperTable(number, title, note, tuple(columns), rows)

    return [
        table(
            "II", "Relative grasp orientation: error angle [deg]", over_trials + fits,
            [(f"R{p}", "deg", f"R{p}_deg.mean", f"R{p}_deg.std", seen) for seen in frames for p in PAIRS],
        ),
        table(
            "III", "Relative grasp position: error [m] and error relative to |p| [%]", over_trials + fits,
            [
                (f"p{pair}", unit, f"p{pair}_{key}.mean", f"p{pair}_{key}.std", seen)
                for seen in frames
                for pair in PAIRS
                for unit, key in (("m", "m"), ("%", "percent"))
            ],
        ),
        table(
            "IV", "Mass and centre of mass: error, and error relative to the truth [%]",
            "one set of six static holds" + fits + _scale_note(scores, ("m",)),
            [
                ("m", "kg", "m_kg", "", ""), ("m", "%", "m_percent", "", ""),
                *(
                    ("p1c", unit, f"p1c_{key}", "", seen)
                    for seen in frames
                    for unit, key in (("m", "m"), ("%", "percent"))
                ),
            ],
        ),
        table(
            "V", "Principal moments of inertia: error [kg m^2] and relative error [%]",
            "|mean error| +- standard deviation of the estimates over random and periodic trials"
            + fits + _scale_note(scores, MOMENTS),
            [(name, "kg m^2", f"all.{name}.mean", f"all.{name}.std", "") for name in MOMENTS]
            + [(name, "%", f"all.{name}.percent", f"all.{name}.std_percent", "") for name in MOMENTS],
        ),
    ]  # fmt: skip


def summary_table(scores: AllScores) -> PaperTable:
    """Make a table of the largest mean error of each kind over payloads and pairs or moments."""
    columns, payloads = _columns(scores)
    frames = ("", BY_ENCODERS) if _entries(scores, ENCODER_FRAMES) else ("",)
    grasps = [
        ("grasp rotation", "deg", 1.0, [f"R{pair}_deg.mean" for pair in PAIRS]),
        ("grasp position", "mm", 1e3, [f"p{pair}_m.mean" for pair in PAIRS]),
        ("grasp position", "%", 1.0, [f"p{pair}_percent.mean" for pair in PAIRS]),
    ]
    centres = [
        ("centre of mass", "mm", 1e3, ["p1c_m"]), ("centre of mass", "%", 1.0, ["p1c_percent"])
    ]  # fmt: skip
    moments = [
        (f"inertia, {kind} trials", "%", 1.0, [f"{kind}.{name}.percent" for name in MOMENTS])
        for kind in ("all", "periodic", "random")
    ]
    kinds = [
        *((*kind, seen) for seen in frames for kind in grasps),
        ("mass", "%", 1.0, ["m_percent"], ""),
        *((*kind, seen) for seen in frames for kind in centres),
        *((*kind, "") for kind in moments),
    ]

    def largest(column: Mapping[str, Scores | None], scale: float, paths: Sequence[str], seen: str) -> Cell:
        entries = (_in_frames(column[payload], seen) for payload in payloads)
        found = (
            _at(entry, path)
            for entry in entries
            if entry is not None
            for path in paths
            if path.partition(".")[0] in entry
        )
        return Cell(max((scale * value for value in found if value is not None), default=None))

    rows = tuple(
        Row("", quantity, unit, tuple(largest(c, scale, paths, seen) for c in columns.values()), seen)
        for quantity, unit, scale, paths, seen in kinds
    )
    note = (_fits_note(scores) + _scale_note(scores, ("m", *MOMENTS))).removeprefix("; ")
    return PaperTable("", "largest error over the payloads", note, tuple(columns), rows)


def spring_share(scores: AllScores) -> float | None:
    """Largest relative error of mass and inertia due to the common stiffness scale of the springs [%]; None if unknown.

    Calibration with a payload cannot determine this scale.
    """
    found = [abs(entry["percent"]) for entry in _entries(scores, SPRING_SCALE)]
    return max(found, default=None)


_Kind = tuple[str, str, str, str, str]
"""Quantity, unit, paths of its value and standard deviation in the scores, frames."""


def _columns(scores: AllScores) -> tuple[dict[str, Mapping[str, Scores | None]], list[str]]:
    """Scores by column, the published values first, and the names of the payloads."""
    payloads = list(next(iter(scores.values())))
    return {PAPER: {p: published_errors(p) for p in payloads}, **scores}, payloads


def _entries(scores: AllScores, key: str) -> list[Scores]:
    """Collect the values under an optional key from all columns and payloads."""
    return [
        entry[key]
        for column in scores.values()
        for entry in column.values()
        if entry is not None and key in entry
    ]


def _in_frames(entry: Scores | None, frames: str) -> Scores | None:
    return entry if entry is None or not frames else entry.get(ENCODER_FRAMES)


def _at(entry: Scores, path: str) -> float | None:
    """Look up a number by a path of keys joined by dots."""
    value: Any = entry
    for key in path.split("."):
        value = value[key]
    return value


def _cell(entry: Scores | None, frames: str, value: str, spread: str) -> Cell:
    found = _in_frames(entry, frames)
    return Cell(None) if found is None else Cell(_at(found, value), _at(found, spread) if spread else None)


def _fits_note(scores: AllScores) -> str:
    if not _entries(scores, SPRING_SCALE):
        return ""
    return (
        "; one fit, self-calibrated, transfer: one number from one fit of three trials, the first random, the first "
        "periodic and the static one"
    )


def _scale_note(scores: AllScores, names: Sequence[str]) -> str:
    """Sentence on the share of the common spring scale in the errors of mass and inertia; may be empty."""
    found = [entry for entry in _entries(scores, SPRING_SCALE) if entry["percent"]]
    if not found:
        return ""
    shares = sorted({f"{entry['percent']:+.2f}" for entry in found})
    beyond = max(entry[f"{name}_percent"] for entry in found for name in names)
    return (
        f"; mass and inertia of calibrated teams are truth / (1 + mean stiffness ratio of their springs), here "
        f"{' and '.join(shares)} %, which no carry decides; beyond that they err by at most {number(beyond)} %"
    )


def number(value: float | None) -> str:
    """Format a number with two significant digits; ``none`` if it is missing."""
    if value is None:
        return "none"
    return f"{value:.2g}" if value >= 1e-4 or value == 0 else f"{value:.1e}"


def format_tables(scores: AllScores) -> str:
    """Format Tables II-V as text.

    Args:
        scores: scores by preset, then payload, as in ``paper.json``.
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
    """Format the summary table as text."""
    table = summary_table(scores)
    rows = [
        [_framed(f"{row.quantity} [{row.unit}]", row), *map(format_cell, row.cells)] for row in table.rows
    ]
    shown = _align(_heads([table.title, *table.columns]), rows)
    return f"{shown}\n\n{_wrapped(table.note)}" if table.note else shown


def format_cell(cell: Cell) -> str:
    """Format a cell as ``0.94 +- 0.21``; ``none`` if the number is missing."""
    value = number(cell.value)
    return value if cell.spread is None else f"{value} +- {number(cell.spread)}"


def _framed(label: str, row: Row) -> str:
    return f"{label}, {row.frames}" if row.frames else label


def _heads(columns: Sequence[str]) -> list[list[str]]:
    """Split the column heads at their commas into two lines, if any has one."""
    if not any(", " in column for column in columns):
        return [list(columns)]
    parts = [column.partition(", ") for column in columns]
    return [[first + comma.strip() for first, comma, _ in parts], [second for _, _, second in parts]]


def _wrapped(note: str) -> str:
    held = note.replace(" %", "\0%")  # keep numbers and their unit on one line
    return "\n".join(wrap(held, 120)).replace("\0", " ")


def _align(heads: Sequence[Sequence[str]], rows: Sequence[Sequence[str]]) -> str:
    cells = [*heads, *rows]
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]
    return "\n".join([*lines[: len(heads)], "-" * max(map(len, lines)), *lines[len(heads) :]])
