"""The report of a result folder: the answer, a part for every result, provenance."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from estimator.files import check_target, whole_file
from estimator.written import add_written
from mocobot_report.blocks.book import Book
from mocobot_report.blocks.html import el, to_bytes
from mocobot_report.calibration import part as calibration_part
from mocobot_report.campaign import part as campaign_part
from mocobot_report.diagnosis import part as diagnosis_part
from mocobot_report.document import document
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
from mocobot_report.provenance_part import provenance_part
from mocobot_report.sought import NAME, SUFFIX

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
