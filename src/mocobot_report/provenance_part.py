"""Where the numbers come from: versions, options, files and their hashes."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from estimator.files import file_facts
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Node, el
from mocobot_report.blocks.numbers import size
from mocobot_report.blocks.prose import facts, folded, paragraph
from mocobot_report.blocks.sections import section
from mocobot_report.blocks.tables import Entry, Num, table
from mocobot_report.folder import Contents


def provenance_part(book: Book, contents: Contents, results: Iterable[tuple[str, Any]]) -> list[Node]:
    """One section per result, by its name and provenance, and the files that this page was made from."""
    out = [section(book, f"How {name} was made", *_one(made)) for name, made in results]
    return [*out, section(book, "What this page was made from", _read(contents))]


def _one(made: Any) -> list[Node]:
    if not isinstance(made, Mapping):
        return [paragraph("The result does not say how it was made; it is of an older mocobot.")]
    packages = made.get("packages")
    versions = ", ".join(f"{k} {v}" for k, v in packages.items()) if isinstance(packages, Mapping) else ""
    commit = str(made.get("commit") or "not from a checkout")
    entries: list[tuple[str, Node | str]] = [
        ("command", el("code", f"mocobot {made.get('command', '')}")),
        ("mocobot", f"{made.get('mocobot', '')}"),
        ("commit", el("code", commit)),
        ("Python", f"{made.get('python', '')} on {made.get('platform', '')}"),
        ("packages", versions),
    ]
    options = made.get("options")
    if isinstance(options, Mapping):
        entries += [(f"option {name}", el("code", _text(v))) for name, v in options.items()]
    out = [facts(entries)]
    for key, title in (("files", "Made from"), ("written", "Written")):
        listed = made.get(key)
        if isinstance(listed, list) and listed:
            shown = _files(title, [entry for entry in listed if isinstance(entry, Mapping)])
            out.append(shown if len(listed) <= 12 else folded(f"{title}: {len(listed)} files", shown))
    return out


def _text(option: Any) -> str:
    if isinstance(option, bool):
        return "yes" if option else "no"
    if isinstance(option, list):
        return " ".join(map(str, option)) or "none"
    return "none" if option is None else str(option)


def _files(caption: str, listed: Sequence[Mapping[str, Any]]) -> Node:
    rows: list[list[Entry]] = []
    for entry in listed:
        count, digest = entry.get("bytes"), el("span", str(entry.get("sha256", "")), class_="hash")
        name = el("code", str(entry.get("path", entry.get("name", ""))))
        rows.append([name, Num(size(count) if isinstance(count, int) else ""), digest])
    return table(caption, ["file", "size", "SHA-256"], rows, stack=True)


def _read(contents: Contents) -> Node:
    listed = [
        file_facts(path) | {"path": path.relative_to(contents.folder).as_posix()} for path in contents.files
    ]
    return _files("Read from the folder", listed)
