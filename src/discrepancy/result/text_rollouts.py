"""The part of the report on rollouts of a serial robot (keys: ``discrepancy.joints.rolled.told``)."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from discrepancy.numbers import Shown, one_each

Values = Mapping[str, Any]
FREE = "Rolled out from measured states under the logged torques"
WIDTH = 100
LOOP = "Rolled out under the logged commands, loops closed"
ERRORS = "rms error of the position, of the given model -> of the extended one (share removed)"


def rollout_lines(values: Values) -> list[str]:
    """Errors of every joint before and after, as lines of at most 100 columns; none where there are no rollouts."""
    rolled = values.get("rollouts")
    if rolled is None:
        return []
    lines = (
        list(_free(rolled)) if rolled["why_not"] is None else [f"Not rolled out freely: {rolled['why_not']}."]
    )
    return ["", f"[[{FREE} ({blocks(rolled)})]]", *_indented(lines), *_loop(rolled)]


def _indented(lines: Iterable[str]) -> Iterable[str]:
    for line in lines:
        indented = f"    {line}"
        if len(indented) <= WIDTH:
            yield indented
        else:
            yield from textwrap.wrap(line, WIDTH, initial_indent="    ", subsequent_indent="    ")


def blocks(rolled: Values) -> str:
    """On which blocks."""
    return "on blocks left out of the fit" if rolled["validated"] else "on the block itself: not validated"


def _free(rolled: Values) -> Iterable[str]:
    horizons = rolled["horizons"]
    if horizons[0]["after"] is not None:
        yield ERRORS
    heads = [f"{h['seconds']:g} s ahead" for h in horizons]
    shown = shown_units(rolled)
    rows = []
    for j in range(len(rolled["joints"])):
        _, scale = shown[rolled["units"][j]]
        cells = []
        for h in horizons:
            after = None if h["after"] is None else h["after"]["rms"][j]
            removed = None if h["removed"] is None else h["removed"][j]
            cells.append(_cell(h["before"]["rms"][j], after, removed, scale, named=h["after"] is not None))
        rows.append(cells)
    widths = [max(map(len, column)) for column in zip(heads, *rows, strict=True)]
    called = _called(rolled, shown, WIDTH - 4 - sum(widths) - 2 * len(widths))
    for name, cells in zip(["joint", *called], [heads, *rows], strict=True):
        line = (f"  {cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
        yield f"{name:<{max(map(len, called))}}" + "".join(line)
    yield from diverged_sentences(rolled)
    if rolled["not_simulated"]:
        yield f"Not in the rollouts: {', '.join(rolled['not_simulated'])}."
    yield from rolled["refused"]


def _called(rolled: Values, shown: Mapping[str, Shown], room: int) -> list[str]:
    """Joints by name, with units; by number where names are too long: cut short, they may be alike."""
    units = [shown[unit][0] for unit in rolled["units"]]
    named = [f"{name} [{unit}]" for name, unit in zip(rolled["joints"], units, strict=True)]
    if max(map(len, named)) <= room:
        return named
    return [f"joint {j} [{unit}]" for j, unit in enumerate(units, start=1)]


def _cell(
    before: float | None, after: float | None, removed: float | None, scale: float, *, named: bool
) -> str:
    text = _number(before, scale)
    if not named:
        return text
    share = "" if removed is None else f" ({100.0 * removed:.0f} %)"
    return f"{text} -> {_number(after, scale)}{share}"


def _number(value: float | None, scale: float) -> str:
    return "diverged" if value is None else f"{scale * value:.3g}"


def diverged_sentences(rolled: Values) -> Iterable[str]:
    """How many rollouts diverged, by model and horizon."""
    for which, words in (("before", "the given model"), ("after", "the extended model")):
        counts = [
            f"{max(h[which]['diverged'])} of {h['starts']} at {h['seconds']:g} s"
            for h in rolled["horizons"]
            if h[which] is not None and max(h[which]["diverged"])
        ]
        if counts:
            listed = ", ".join(counts)
            yield f"Rollouts of {words} that diverged in the worst joint: {listed}; they are not in its errors."


def shown_units(rolled: Values) -> dict[str, Shown]:
    """The unit in which errors of joints that turn and of those that slide are shown: by what is off first."""
    free = [(h[which] or {}).get("rms", []) for h in rolled["horizons"][:1] for which in ("before", "after")]
    loop = [rolled["commanded"][which] or [] for which in ("before", "after")]
    return one_each(
        (rolled["units"][j], x or 0.0)
        for errors in (*free, *loop, [0.0] * len(rolled["units"]))
        for j, x in enumerate(errors)
    )


def _loop(rolled: Values) -> Iterable[str]:
    loop = rolled["commanded"]
    if loop["why_not"] is not None:
        yield from _indented([f"The closed loop was not simulated: {loop['why_not']}."])
        return
    yield from ("", f"[[{LOOP} ({blocks(rolled)})]]", *_indented(_errors(rolled, loop)))


def _errors(rolled: Values, loop: Values) -> Iterable[str]:
    shown = shown_units(rolled)
    named = loop["after"] is not None
    cells = []
    for j in range(len(rolled["joints"])):
        _, scale = shown[rolled["units"][j]]
        after, removed = (loop[key][j] if named else None for key in ("after", "removed"))
        cell = _cell(loop["before"][j], after, removed, scale, named=named)
        cells.append(cell)
    called = _called(rolled, shown, WIDTH - 4 - 2 - max(map(len, cells)))
    for name, cell in zip(called, cells, strict=True):
        yield f"{name:<{max(map(len, called))}}  {cell:>{max(map(len, cells))}}"
    for which, words in (("before", "the given model"), ("after", "the extended model")):
        count = lost(loop["blocks"], which)
        if count:
            yield f"{count} of {len(loop['blocks'])} blocks of {words} diverged; they are in no error."


def lost(runs: Sequence[Values], which: str) -> int:
    """How many blocks diverged in some joint."""
    return sum(run[which] is not None and None in run[which] for run in runs)
