"""A comparison as text: what changed, and all numbers."""

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from estimator.extras import draws_plots
from estimator.files import write_json, write_text
from estimator.statistics import measured
from mocobot.comparison import rules
from mocobot.comparison.comparison import Comparison
from mocobot.comparison.difference import Group

NAME, REPORT, PICTURE = "comparison.json", "report.txt", "comparison.png"


def write_into(folder: Path, found: Comparison, made_with: Mapping[str, Any] | None = None) -> None:
    """Write everything into an existing folder.

    Args:
        folder: it.
        found: what is written.
        made_with: what ``mocobot.files.provenance.provenance`` says, or None.

    Raises:
        InputError: something cannot be written.
    """
    more = {} if made_with is None else {"provenance": dict(made_with)}
    write_json(folder / NAME, found.to_dict() | more)
    write_text(folder / REPORT, f"{format_comparison(found)}\n")
    if found.groups and draws_plots():
        from mocobot.comparison.picture import save_picture  # matplotlib

        save_picture(found, folder / PICTURE)


WIDTH = 110


def format_comparison(found: Comparison) -> str:
    """The text report."""
    lines = [
        f"Two {_plural(found.kind)}: A is {found.a}",
        f"{'':{len(_plural(found.kind)) + 6}}B is {found.b}",
        "",
    ]
    lines += _fill(verdict(found))
    lines += [line for sentence in found.changes for line in _fill(sentence, "- ")]
    width = max((len(_label(group, entry)) for group in found.groups for entry in group.entries), default=0)
    if found.groups:
        lines += ["", f"{'':{width}}{'A':>24}{'B':>24}{'B - A':>24}{'over its error':>16}"]
    changed = found.changed_groups
    for group in found.groups:
        lines += [
            f"{_label(group, entry):{width}}{row}{' *' * (group in changed)}"
            for entry, row in zip(group.entries, _rows(group), strict=True)
        ]
    if close := [group.name for group in found.groups if group.together]:
        said = (
            f"Errors within a group move together (correlation above {rules.TOGETHER}), which the test heeds"
        )
        lines += ["", *_fill(f"{said}: {'; '.join(close)}.", "- ")]
    lines += [line for note in found.notes for line in _fill(note, "- ")]
    return "\n".join(lines).rstrip()


def verdict(found: Comparison) -> str:
    """What changed, in a sentence."""
    tests = (
        f"{len(found.groups)} groups of numbers are tested together, one false alarm in a hundred comparisons"
    )
    if not found.groups and not found.changes:
        return "NOTHING TO COMPARE: they have no number in common."
    if not found.changed:
        return f"NOTHING CHANGED beyond its errors ({tests})."
    if not found.changed_groups:
        return "CHANGED; what both give agrees within its errors." if found.groups else "CHANGED."
    return f"CHANGED beyond its errors, marked with a star ({tests}): {what_changed(found)}."


def what_changed(found: Comparison) -> str:
    """The groups of numbers that did, the clearest first."""
    return "; ".join(f"{group.name} ({_clearest(group)})" for group in found.changed_groups)


def _clearest(group: Group) -> str:
    """The largest difference of a group."""
    k = int(np.argmax(np.abs(group.ratio)))
    value, error = _with_error(group.difference[k], group.se[k])
    shown = f"{value} +- {error}" if error else value
    entry = f"{group.entries[k]} by " if group.entries[k] else "by "
    return f"{entry}{shown} {group.unit}".rstrip()


def _rows(group: Group) -> list[str]:
    errors = [np.sqrt(np.maximum(np.diag(c), 0.0)) for c in (group.a_covariance, group.b_covariance)]
    columns = ((group.a, errors[0]), (group.b, errors[1]), (group.difference, group.se))
    rows = []
    for k in range(len(group.entries)):
        cells = [_with_error(values[k], se[k]) for values, se in columns]
        texts = [f"{value} +- {error}" if error else value for value, error in cells]
        rows.append("".join(f"{text:>24}" for text in texts) + f"{group.ratio[k]:16.1f}")
    return rows


def _with_error(value: float, se: float) -> tuple[str, str]:
    return measured(value, se) if se > 0 else (f"{value:.6g}", "")


def _label(group: Group, entry: str) -> str:
    unit = f" [{group.unit}]" if group.unit else ""
    return f"{group.name}{' ' * bool(entry)}{entry}{unit}"


def _plural(kind: str) -> str:
    return {"diagnosis": "diagnoses"}.get(kind, f"{kind}s")


def _fill(text: str, mark: str = "") -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=mark, subsequent_indent=" " * len(mark))
