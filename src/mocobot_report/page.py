"""The report of a result folder: the answer, a part for every result, provenance."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from types import ModuleType
from typing import Any

from plotly.offline import get_plotlyjs

from estimator.files import add_written, check_target, file_facts, whole_file
from mocobot_report.blocks import palette
from mocobot_report.blocks.book import Book, section
from mocobot_report.blocks.html import Node, data_block, el, raw, to_bytes, variables, words
from mocobot_report.blocks.numbers import size
from mocobot_report.blocks.prose import facts, folded, paragraph
from mocobot_report.blocks.tables import Entry, Num, table
from mocobot_report.blocks.theme import TEMPLATES
from mocobot_report.calibration import part as calibration_part
from mocobot_report.campaign import part as campaign_part
from mocobot_report.diagnosis import part as diagnosis_part
from mocobot_report.estimate import part as estimate_part
from mocobot_report.folder import (
    Calibrated,
    Campaign,
    Contents,
    Diagnosed,
    Estimated,
    Paper,
    complete,
    read_folder,
)
from mocobot_report.glossary import glossary, link_terms
from mocobot_report.paper import part as paper_part
from mocobot_report.sought import NAME, SUFFIX


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


POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; "
    "form-action 'none'"
)
"""What the page may load: nothing but itself."""


def document(title: str, main: list[Node]) -> Node:
    """The whole page.

    Args:
        title: of the browser's window.
        main: sections; the first is the answer, the others have a heading and sections of their own.
    """
    style, script = page_assets()
    dark = f"color-scheme:dark;{variables(palette.DARK)}"
    colours = (
        f":root{{{variables(palette.LIGHT)}}}"
        f"@media (prefers-color-scheme: dark){{:root:not([data-theme=light]){{{dark}}}}}"
        f":root[data-theme=dark]{{{dark}}}"
        f"@media print{{:root:root:root{{color-scheme:light;{variables(palette.LIGHT)}}}}}"
    )
    foot = f"Made by mocobot {_version()}. This file is complete: it loads nothing from anywhere."
    return el(
        "html",
        el(
            "head",
            el("meta", charset="utf-8"),
            el("meta", name="generator", content="mocobot report"),
            el("title", f"{title} | mocobot report"),
            el("meta", name="viewport", content="width=device-width, initial-scale=1"),
            el("meta", http_equiv="Content-Security-Policy", content=POLICY),
            el("link", rel="icon", href="data:,"),
            raw("style", colours + style),
        ),
        el(
            "body",
            el("a", "Skip to the results", href="#main", class_="skip"),
            el(
                "header",
                el("div", "mocobot ", el("span", "report"), class_="brand"),
                el("button", "Dark theme", type="button", id="theme"),
                class_="top",
            ),
            el(
                "div",
                _navigation(main),
                el(
                    "main",
                    el("noscript", el("p", "Plots need JavaScript; everything else on this page does not.")),
                    *main,
                    el("p", foot, class_="foot"),
                    id="main",
                    tabindex="-1",
                ),
                class_="frame",
            ),
            data_block("templates", {name: theme.to_plotly_json() for name, theme in TEMPLATES.items()}),
            raw("script", get_plotlyjs()),
            raw("script", script),
        ),
        lang="en",
    )


def page_assets() -> tuple[str, str]:
    """Style sheet and script of the page."""
    assets = files("mocobot_report").joinpath("assets")
    style, script = (assets.joinpath(name).read_text(encoding="utf-8") for name in ("style.css", "page.js"))
    return style, script


def _navigation(main: list[Node]) -> Node:
    """Links to every part and its sections."""
    entries = [el("li", el("a", "Answer", href="#answer"))]
    for part in main[1:]:
        inner = [el("li", _link(child, child[0])) for child in part if child.tag == "section"]
        entries.append(el("li", _link(part, part[0]), el("ol", *inner) if inner else None))
    return el("nav", el("p", "Contents", class_="contents"), el("ol", *entries), aria_label="Contents")


def _link(target: Node, heading: Node) -> Node:
    return el("a", words(heading), href=f"#{target.get('id')}")


def _version() -> str:
    try:
        return version("mocobot")
    except PackageNotFoundError:
        return "from source"


Say = Callable[[str], object]


def write_report(folder: Path, out: Path | None = None, say: Say = lambda _: None) -> Path:
    """Write the report of a result folder.

    Args:
        folder: what ``mocobot paper``, ``estimate``, ``calibrate``, ``diagnose`` or ``campaign`` wrote.
        out: file to write; ``report.html`` in the folder if None. An existing file is replaced.
        say: takes the name of every stage that begins.

    Returns:
        The file.

    Raises:
        InputError: the folder holds no result, or one that cannot be read, or the file cannot be written.
    """
    contents = read_folder(folder)
    out = folder / NAME if out is None else out
    check_target(out, SUFFIX)
    with whole_file(out) as temporary:
        temporary.write_bytes(make_page(contents, say))
    if out.parent == folder:
        add_written(out)
    return out


def make_page(contents: Contents, say: Say = lambda _: None) -> bytes:
    """The page of a folder's contents, HTML in UTF-8; the same files give the same bytes.

    Args:
        contents: of a result folder.
        say: takes the name of every stage that begins.

    Raises:
        InputError: a file has gone, or changed its meaning, since the folder was read.
    """
    book, parts, answers = Book(say), [], []
    results = _results(contents)
    for result in results:
        with complete(result.path):
            answers.append(
                (f"{result.part.title(result.found)}{result.of}", result.part.answer(result.found))
            )
            parts.append((result.identity, result.name, result.part.sections(book, result.found)))
    made = [(result.made, result.found.provenance) for result in results]
    parts.append(("provenance", "Provenance", provenance_part(book, contents, made)))
    if len(answers) == 1:
        title, top = answers[0]
    else:
        title, top = (
            f"{len(answers)} results",
            [node for name, nodes in answers for node in (el("h2", name), *nodes)],
        )
    main = [el("section", el("h1", title), *top, id="answer", aria_label="Answer")]
    for identity, name, blocks in parts:
        heading = el("h2", name, id=f"{identity}-heading")
        main.append(
            el("section", heading, *blocks, id=identity, class_="part", aria_labelledby=f"{identity}-heading")
        )
    say("pictures")
    book.gallery.fill()
    if terms := link_terms(main):
        heading = el("h2", "Glossary", id="glossary-heading")
        main.append(
            el(
                "section",
                heading,
                glossary(terms),
                id="glossary",
                class_="part",
                aria_labelledby="glossary-heading",
            )
        )
    say("page")
    return to_bytes(document(title, main))


@dataclass(frozen=True)
class _Result:
    """One result: its file, what was read, the module that makes nodes of it, its id, and how headings call it."""

    path: Path
    found: Paper | Estimated | Calibrated | Diagnosed | Campaign
    part: ModuleType
    identity: str
    name: str
    made: str
    of: str = ""


def _results(contents: Contents) -> list[_Result]:
    out = []
    if (paper := contents.paper) is not None:
        path = contents.folder / "paper.json"
        out.append(_Result(path, paper, paper_part, "paper", "The experiment in detail", "the experiment"))
    for k, one in enumerate(contents.estimates, start=1):
        several = len(contents.estimates) > 1
        name = f"Estimate {one.path.name}" if several else "The estimate in detail"
        of = f": {one.path.name}" if several else ""
        out.append(_Result(one.path, one, estimate_part, f"estimate-{k}", name, one.path.name, of))
    for k, one in enumerate(contents.calibrations, start=1):
        several = len(contents.calibrations) > 1
        name = f"Calibration {one.path.name}" if several else "The calibration in detail"
        of = f": {one.path.name}" if several else ""
        out.append(_Result(one.path, one, calibration_part, f"calibration-{k}", name, one.path.name, of))
    if (diagnosis := contents.diagnosis) is not None:
        path = diagnosis.folder / "diagnosis.json"
        out.append(
            _Result(path, diagnosis, diagnosis_part, "diagnosis", "The diagnosis in detail", "the diagnosis")
        )
    if (campaign := contents.campaign) is not None:
        name = "The campaign in detail"
        out.append(_Result(campaign.path, campaign, campaign_part, "campaign", name, "the campaign"))
    return out
