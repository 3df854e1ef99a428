"""What a diagnosis leaves open: limits of detection, what cannot be decided, the extended models, notes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from discrepancy.causes.units import one_each, parameter
from discrepancy.result.read import AS_FOUND, EXTENDED, kind_of
from discrepancy.result.text import NOTHING_WRONG_HERE
from estimator.written import LIST
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.html import Child, Node, el
from mocobot_report.blocks.numbers import plain, size, spelled
from mocobot_report.blocks.prose import bullets, folded, paragraph, tidy
from mocobot_report.blocks.tables import Entry, Num, table
from mocobot_report.diagnosis.keys import cause_name
from mocobot_report.folder import Diagnosed

Values = Mapping[str, Any]


def rest_sections(book: Book, diagnosed: Diagnosed) -> list[Node]:
    """Detection limits, undecidable questions, the extended models' files, notes."""
    values = diagnosed.values
    limits = _limits(values) if values["detection_limits"] else None
    if limits is not None and values["verdict"] not in NOTHING_WRONG_HERE:
        limits = folded("Show the limits", limits)
    entries = [
        (el("dt", tidy(entry["what"])), el("dd", tidy(f"{entry['why']}; needs {entry['remedy']}.")))
        for entry in values["undecidable"]
    ]
    notes = [tidy(note) for note in values["notes"]]
    outline = [
        ("What would have been noticed", limits),
        ("What such recordings cannot decide", el("dl", entries, class_="list") if entries else None),
        ("Models to take away", _models(diagnosed.folder)),
        ("Notes", bullets(notes) if notes else None),
    ]
    return [section(book, name, content) for name, content in outline if content is not None]


def _limits(values: Values) -> Node:
    """One row per cause and parameter: smallest and largest limit over the places."""
    sizes: dict[tuple[str, str], list[float | None]] = {}
    kinds = {entry["cause"]: kind_of(entry) for entry in values["detection_limits"]}
    for entry in values["detection_limits"]:
        for name, limit in entry["parameters"].items():
            sizes.setdefault((entry["cause"], name), []).append(limit)
    shown = one_each(
        (parameter(name)[1], limit)
        for (_, name), found in sizes.items()
        for limit in found
        if limit is not None
    )
    rows: list[list[Entry]] = []
    last = ""
    for (cause, name), found in sizes.items():
        words, unit = parameter(name)
        unit, scale = shown.get(unit, (unit, 1.0))
        seen = sorted(scale * limit for limit in found if limit is not None)
        blind = len(found) - len(seen)
        sizes_said = Num("never")
        where = f"nowhere: these recordings say nothing ({len(found)} places)"
        if seen:
            low, high = plain(seen[0], 2), plain(seen[-1], 2)
            sizes_said = Num(low if low == high else f"{low} to {high}", unit=spelled(unit))
            where = f"{len(seen)} of {len(found)}" if blind else "everywhere"
        who = cause_name(kinds[cause], cause) if cause != last else ""
        rows.append([who, words, sizes_said, where])
        last = cause
    return table(
        "Size that would have been noticed nine times in ten", ["cause", "parameter", "best to worst place",
        "seen at"], rows, groups=True, stack=True,
        note="had it been there, in these very recordings",
    )  # fmt: skip


def _models(folder: Path) -> list[Node] | None:
    there = {name: files for name in (EXTENDED, AS_FOUND) if (files := _files(folder / name))}
    if not there:
        return None
    said = [
        paragraph(*_told(name, files), " Its own README says what is where.") for name, files in there.items()
    ]
    rows = [
        [el("code", path.relative_to(folder).as_posix()), Num(size(path.stat().st_size))]
        for files in there.values()
        for path in files
    ]
    return [*said, table("Files beside this report", ["file", "size"], rows)]


def _told(name: str, files: Sequence[Path]) -> list[Child]:
    takes = el("code", f"mocobot simulate --model {name}")
    if name == AS_FOUND:
        how = "The estimated team with every part as far off as it is found, within its tolerance, too: "
        return [how, takes, " takes the folder."]
    if any(path.name == "team.xml" for path in files):
        loads = el("code", "team.xml")
        named = "The estimated team with the named causes in it: "
        return [named, loads, " loads in plain MuJoCo, and ", takes, " takes the folder."]
    return ["The model with the named causes in it; it loads in plain MuJoCo."]


def _files(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.rglob("*") if path.is_file() and path.name != LIST)
    except OSError:
        return []
