"""The whole page: header, answer, parts, provenance, in one file that needs nothing else."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path

from plotly.offline import get_plotlyjs

from mocobot_report.blocks import palette
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import Node, el, raw, to_bytes, variables, words
from mocobot_report.diagnosis import part as diagnosis_part
from mocobot_report.estimate import part as estimate_part
from mocobot_report.folder import Contents, complete, read_folder
from mocobot_report.paper import part as paper_part
from mocobot_report.provenance_part import provenance_part
from mocobot_report.target import MARK, check_target, write_page

NAME = "report.html"
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: "
    "blob:; base-uri 'none'; "
    "form-action 'none'"
)
"""What the page may load: nothing but itself."""
Say = Callable[[str], object]


def write_report(folder: Path, out: Path | None = None, say: Say = lambda _: None) -> Path:
    """Write the report of a result folder.

    Args:
        folder: what ``mocobot paper``, ``estimate`` or ``diagnose`` wrote.
        out: file to write; ``report.html`` in the folder if None. An earlier report is replaced.
        say: takes the name of every stage that begins.

    Returns:
        The file.

    Raises:
        InputError: the folder holds no result, or one that cannot be read, or the file cannot be written.
    """
    contents = read_folder(folder)
    out = folder / NAME if out is None else out
    check_target(out)
    write_page(out, make_page(contents, say))
    return out


def make_page(contents: Contents, say: Say = lambda _: None) -> bytes:
    """The page of a folder's contents, HTML in UTF-8; the same files give the same bytes.

    Args:
        contents: of a result folder.
        say: takes the name of every stage that begins.

    Raises:
        InputError: a file has gone, or changed its meaning, since the folder was read.
    """
    book = Book(say)
    parts = _parts(book, contents)
    parts.append(("provenance", "Provenance", provenance_part(book, contents)))
    title, top = _top(contents)
    main = [el("section", el("h1", title), *top, id="answer", aria_label="Answer")]
    for identity, name, blocks in parts:
        heading = el("h2", name, id=f"{identity}-heading")
        main.append(
            el("section", heading, *blocks, id=identity, class_="part", aria_labelledby=f"{identity}-heading")
        )
    say("pictures")
    book.gallery.fill()
    say("page")
    return to_bytes(_document(title, main))


def _parts(book: Book, contents: Contents) -> list[tuple[str, str, list[Node]]]:
    """Id, heading and content of every part."""
    parts = []
    if contents.paper is not None:
        with complete(contents.folder / "paper.json"):
            parts.append(("paper", "The experiment in detail", paper_part.sections(book, contents.paper)))
    for k, estimated in enumerate(contents.estimates, start=1):
        name = "The estimate in detail" if len(contents.estimates) == 1 else f"Estimate {estimated.path.name}"
        with complete(estimated.path):
            parts.append((f"estimate-{k}", name, estimate_part.sections(book, estimated)))
    if contents.diagnosis is not None:
        with complete(contents.diagnosis.folder / "diagnosis.json"):
            parts.append(
                ("diagnosis", "The diagnosis in detail", diagnosis_part.sections(book, contents.diagnosis))
            )
    return parts


def _top(contents: Contents) -> tuple[str, list[Node]]:
    """Title of the page, and the answers of all that it holds."""
    answers: list[tuple[str, list[Node]]] = []
    if contents.paper is not None:
        answers.append((paper_part.title(contents.paper), paper_part.answer(contents.paper)))
    for estimated in contents.estimates:
        name = f": {estimated.path.name}" if len(contents.estimates) > 1 else ""
        with complete(estimated.path):
            answers.append((f"{estimate_part.title(estimated)}{name}", estimate_part.answer(estimated)))
    if contents.diagnosis is not None:
        with complete(contents.diagnosis.folder / "diagnosis.json"):
            answers.append(
                (diagnosis_part.title(contents.diagnosis), diagnosis_part.answer(contents.diagnosis))
            )
    if len(answers) == 1:
        return answers[0]
    return f"{len(answers)} results", [node for name, nodes in answers for node in (el("h2", name), *nodes)]


def _navigation(main: list[Node]) -> Node:
    """Links to every part and its sections."""
    entries = [el("li", el("a", "Answer", href="#answer"))]
    for part in main[1:]:
        inner = [
            el("li", el("a", words(child[0]), href=f"#{child.get('id')}"))
            for child in part
            if child.tag == "section"
        ]
        entries.append(
            el("li", el("a", words(part[0]), href=f"#{part.get('id')}"), el("ol", *inner) if inner else None)
        )
    return el("nav", el("p", "Contents", class_="contents"), el("ol", *entries), aria_label="Contents")


def page_assets() -> tuple[str, str]:
    """Style sheet and script of the page."""
    assets = files("mocobot_report").joinpath("assets")
    style, script = (assets.joinpath(name).read_text(encoding="utf-8") for name in ("style.css", "page.js"))
    return style, script


def _document(title: str, main: list[Node]) -> Node:
    style, script = page_assets()
    dark = f"color-scheme:dark;{variables(palette.DARK)}"
    colours = (
        f":root{{{variables(palette.LIGHT)}}}"
        f"@media (prefers-color-scheme: dark){{:root:not([data-theme=light]){{{dark}}}}}"
        f":root[data-theme=dark]{{{dark}}}"
        f"@media print{{:root:root:root{{color-scheme:light;{variables(palette.LIGHT)}}}}}"
    )
    return el(
        "html",
        el(
            "head",
            el("meta", charset="utf-8"),
            el("meta", name="generator", content=MARK),
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
                    el(
                        "p",
                        f"Made by mocobot {_version()}. This file is complete: it loads nothing from anywhere.",
                        class_="foot",
                    ),
                    id="main",
                    tabindex="-1",
                ),
                class_="frame",
            ),
            raw("script", get_plotlyjs()),
            raw("script", script),
        ),
        lang="en",
    )


def _version() -> str:
    try:
        return version("mocobot")
    except PackageNotFoundError:
        return "from source"
