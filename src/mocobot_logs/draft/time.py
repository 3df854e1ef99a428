"""Where a table's time is, as lines of a draft."""

import json
from collections.abc import Sequence

import numpy as np

from estimator.errors import InputError
from mocobot_logs.draft.candidates import Candidate
from mocobot_logs.draft.robots import HOLE, Robots, templates_of
from mocobot_logs.draft.values import DOUBTFUL, guess_time, printable
from mocobot_logs.map.units import DATES
from mocobot_logs.table.table import Table, Wanted


def time_lines(table: Table, candidates: Sequence[Candidate], robots: Robots) -> list[str]:
    """The lines of [time].

    Args:
        table: the log.
        candidates: what it has; those that are called like time count.
        robots: what they are called in names.
    """
    times = [candidate for candidate in candidates if candidate.reading.group == "time"]
    if not times:
        return ["[time]", f"# {DOUBTFUL}nothing is called like time", '# column = "?"', '# unit = "s"', ""]
    name, column, doubts = _choose(table, times, robots)
    unit, said = column.reading.unit, ""
    if unit is None and column.values is not None and len(column.values):
        unit, doubt = guess_time(column.values)
        said = "by the intervals"
        doubts += [doubt] if doubt else []
    elif column.values is None or not len(column.values):
        dates = _has_dates(table, column.name)
        if not dates:
            doubts.append("its values cannot be read")
        unit = unit or (DATES if dates else "s")
    comment = f"  # {DOUBTFUL}{'; '.join(doubts)}" if doubts else f"  # {said}" if said else ""
    return [
        "[time]",
        f"column = {json.dumps(name, ensure_ascii=False)}",
        f'unit = "{unit}"{printable(comment)}',
        "",
    ]


def _choose(table: Table, times: list[Candidate], robots: Robots) -> tuple[str, Candidate, list[str]]:
    """Name of the column, with a placeholder where every robot has its own; the column; and what is doubtful."""
    if robots.called:
        for template, each in templates_of(times).items():
            if set(robots.called) <= set(each):
                return template.replace(HOLE, robots.placeholder), each[robots.called[0]], []
    exact = [c for c in times if c.name == table.time_column]
    best = (exact or sorted(times, key=lambda c: (len(c.reading.rest), len(c.name))))[0]
    others = [c.name for c in times if c is not best and len(c.reading.rest) <= len(best.reading.rest)]
    return best.name, best, [f"or {others[0]}?"] if others and not exact else []


def _has_dates(table: Table, column: str) -> bool:
    try:
        block = next(table.blocks(Wanted((), (column,), None), lambda _: None), None)
    except InputError:
        return False
    return block is not None and bool(np.any(block.clocks[column][1]))
