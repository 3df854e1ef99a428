"""HTML report of a result folder: answer, one part per result, provenance and glossary."""

import base64
import gzip
import io
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import Any

from markupsafe import Markup

from discrepancy.evidence.settings import SETTINGS
from estimator.errors import InputError
from estimator.files import add_written, check_target, file_facts, whole_file
from estimator.inputs import printable
from mocobot_report import (
    NAME,
    SUFFIX,
    calibration,
    campaign,
    diagnosis,
    estimate,
    joint_calibration,
    paper,
    two_bodies,
)
from mocobot_report.charts import Chart
from mocobot_report.folder import Result, complete, read_folder
from mocobot_report.numbers import counted, size
from mocobot_report.palette import DARK, LIGHT, template
from mocobot_report.tables import Entry, Num, templates
from mocobot_view.render import Shot, render_shots

Say = Callable[[str], object]
Context = dict[str, Any]
PARTS: Mapping[str, Callable[[Result, Say], Context]] = {
    "paper": paper.context, "estimate": estimate.context, "calibration": calibration.context,
    "diagnosis": diagnosis.context, "joint-calibration": joint_calibration.context, "campaign": campaign.context,
    "two-bodies": two_bodies.context,
}  # fmt: skip
"""Function per kind of result that returns the data of its template: ``title``, ``pictures`` and further names."""


def write_report(folder: Path, out: Path | None = None, say: Say = lambda _: None) -> Path:
    """Write the report of a result folder to ``report.html`` there, or to ``out``, and return its path.

    ``say`` is called with the name of each stage that begins. An existing file is replaced.
    """
    results = read_folder(folder)
    out = folder / NAME if out is None else out
    check_target(out, SUFFIX)
    with whole_file(out) as temporary:
        temporary.write_bytes(make_page(folder, results, say))
    if out.parent == folder:
        add_written(out)
    return out


@dataclass
class _Part:
    """Part of the page below the answer, with ids and titles of its sections."""

    id: str
    name: str
    content: Markup = field(default_factory=Markup)
    sections: list[tuple[str, str]] = field(default_factory=list)


@dataclass
class _Page:
    """State that the templates share: counters of ids, figures, and the parts so far."""

    parts: list[_Part] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)

    def identity(self, kind: str) -> str:
        """Make an id that is unique on the page and reproducible."""
        self.counts[kind] = self.counts.get(kind, 0) + 1
        return f"{kind}-{self.counts[kind]}"

    def section(self, title: str, name: str | None) -> str:
        """Add a section to the last part and return its id."""
        name = name or self.identity("part")
        self.parts[-1].sections.append((name, title))
        return name

    def figure(self, chart: Chart) -> str:
        """Add a chart to the page and return its id."""
        name = self.identity("figure")
        self.figures[name] = chart.to_json()
        return name

    def link(self, section: Markup) -> Markup:
        """Add links to the glossary to a section."""
        return link_terms(section)


def make_page(folder: Path, results: Sequence[Result], say: Say = lambda _: None) -> bytes:
    """Make the page of a folder's results as UTF-8 HTML; equal files give equal bytes."""
    contexts: list[Context] = []
    for result in results:
        with complete(result.path):
            contexts.append(PARTS[result.kind](result, say))
    say("pictures")
    render_pictures(contexts)
    say("page")
    page, answers = _Page(), Markup("")
    for result, context in zip(results, contexts, strict=True):
        several = sum(one.kind == result.kind for one in results) > 1
        detail = f"The {_word(result.kind)} in detail"
        name = f"{_word(result.kind).capitalize()} {result.path.name}" if several else detail
        page.parts.append(_Part(page.identity(result.kind), name))
        with complete(result.path):
            part = templates().get_template(f"{result.kind}.html")
            module: Any = part.make_module(context | {"page": page})
            page.parts[-1].content = module.sections()
            heading = f"{context['title']}: {result.path.name}" if several else context["title"]
            answers += Markup("<h2>{}</h2>").format(heading) if len(results) > 1 else ""
            answers += module.answer()
    page.parts.append(_Part("provenance", "Provenance"))
    read = dict.fromkeys(path for result in results for path in result.files)
    provenance = templates().get_template("provenance.html").render(
        page=page, rows_of=_files, option=_option, results=[(_called(one), one.provenance) for one in results],
        read=[file_facts(path) | {"path": path.relative_to(folder).as_posix()} for path in read],
    )  # fmt: skip
    page.parts[-1].content = Markup(provenance)
    answer = link_terms(answers)
    of_kind = zip(results, contexts, strict=True)
    titles = [context["title"] for _, context in sorted(of_kind, key=lambda one: one[0].kind != "diagnosis")]
    if met := glossary_of([answer, *(part.content for part in page.parts)]):
        page.parts.append(_Part("glossary", "Glossary", met))
    return _whole(page, title_of(titles), answer)


LONGEST_TITLE = 160


def title_of(titles: Sequence[str]) -> str:
    """Join the distinct titles of the results, up to ``LONGEST_TITLE`` characters."""
    first, *others = dict.fromkeys(titles)
    shown = [first]
    for title in others:
        if sum(map(len, shown)) + len(title) <= LONGEST_TITLE:
            shown.append(title[:1].lower() + title[1:])
    more = len(titles) - len(shown)
    return "; ".join([*shown, f"and {counted(more, 'more result')}"] if more else shown)


def _whole(page: _Page, title: str, answer: Markup) -> bytes:
    from plotly.offline import get_plotlyjs

    data = {"figures": page.figures, "templates": {"light": template(LIGHT), "dark": template(DARK)}}
    text = templates().get_template("page.html").render(
        title=title, answer=answer, parts=page.parts, version=_version(), light=_variables(LIGHT),
        dark=_variables(DARK), plotly=_packed(get_plotlyjs()), figures=_packed(json.dumps(data, allow_nan=False)),
    )  # fmt: skip
    return _NOT_HTML.sub(lambda found: printable(found[0]), text).encode() + b"\n"


_NOT_HTML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]")
"""Characters that HTML does not allow."""


def _packed(text: str) -> Markup:
    """Compress text for the page's script: gzip in base 85, with commas instead of ``<``, which is markup in HTML."""
    packed = base64.b85encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")
    return Markup(packed.replace("<", ","))


def _variables(colours: Mapping[str, str]) -> Markup:
    """Format colours as CSS custom properties."""
    return Markup("".join(f"--{name}:{value};" for name, value in colours.items()))


def _version() -> str:
    try:
        return version("mocobot")
    except PackageNotFoundError:
        return "from source"


WIDTH, HEIGHT, QUALITY = 1120, 700, 84  # size of a picture [px] and quality of its JPEG


@dataclass(frozen=True)
class Picture:
    """A picture as a data URI; without a source, ``says`` explains why there is none."""

    caption: str
    says: str
    source: str = ""
    width: int = WIDTH
    height: int = HEIGHT


def render_pictures(contexts: Sequence[Context]) -> None:
    """Replace the requested pictures (caption, function that makes a shot) by rendered pictures.

    One process renders all of them. If it cannot render, one sentence replaces the pictures of each part.
    """
    shots: list[Shot] = []
    for context in contexts:
        for k, (caption, make) in enumerate(context.get("pictures", ())):
            try:
                shots.append(make())
                context["pictures"][k] = (caption, len(shots) - 1)
            except InputError as error:
                context["pictures"][k] = Picture(f"No picture: {caption}", str(error))
    made = render_shots(shots, WIDTH, HEIGHT)
    for context in contexts:
        wanted = context.get("pictures", [])
        if isinstance(made, str):
            said = [one for one in wanted if isinstance(one, Picture)]
            context["pictures"] = said + [Picture("No pictures", made)] * (len(said) < len(wanted))
            continue
        for k, one in enumerate(wanted):
            if not isinstance(one, Picture):
                caption, at = one
                wanted[k] = Picture(caption, shots[at].says, _jpeg(made[at]))


def _jpeg(pixels: Any) -> str:
    from PIL import Image  # an optional dependency, present whenever pictures are rendered

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=QUALITY, optimize=True)
    return "data:image/jpeg;base64," + base64.b64encode(file.getvalue()).decode("ascii")


def _word(kind: str) -> str:
    return {"paper": "experiment", "two-bodies": "estimate"}.get(kind, kind.rpartition("-")[2])


def _called(result: Result) -> str:
    word = _word(result.kind)
    return result.path.name if word in ("estimate", "calibration") else f"the {word}"


def _option(value: Any) -> str:
    """Format the value of an option as on the command line."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return " ".join(map(str, value)) or "none"
    return "none" if value is None else str(value)


def _files(listed: Iterable[Any]) -> list[list[Entry]]:
    """Tabulate name, size and hash of files."""
    rows: list[list[Entry]] = []
    for entry in listed:
        if isinstance(entry, Mapping):
            count, name = entry.get("bytes"), str(entry.get("path", entry.get("name", "")))
            shown = Num(size(count) if isinstance(count, int) else "")
            digest = Markup('<span class="hash">{}</span>').format(str(entry.get("sha256", "")))
            rows.append([Markup("<code>{}</code>").format(name), shown, digest])
    return rows


@cache
def terms() -> list[dict[str, Any]]:
    """Read the glossary ``assets/glossary.toml``, and give each term an id."""
    file = files("mocobot_report").joinpath("assets/glossary.toml")
    found = tomllib.loads(file.read_text(encoding="utf-8"))["term"]
    filled = {"{clean_chi2}": f"{SETTINGS.clean_chi2:g}", "{named}": f"{100 * SETTINGS.named:g}"}
    for term in found:
        term["id"] = "term-" + re.sub(r"[^a-z]+", "-", term["name"].lower()).strip("-")
        for name, number in filled.items():
            term["meaning"] = term["meaning"].replace(name, number)
    return sorted(found, key=lambda term: term["name"].lower())


UNLINKED = ("a", "button", "code", "h1", "h2", "h3", "h4", "label", "legend", "style", "svg", "summary")
"""HTML elements whose text gets no links to the glossary."""


@cache
def _spelled() -> tuple[dict[str, dict[str, Any]], re.Pattern[str]]:
    """Return the glossary terms by spelling, and a pattern that matches any spelling."""
    known = {spelling.lower(): term for term in terms() for spelling in term["spellings"]}
    longest_first = sorted(map(re.escape, known), key=len, reverse=True)
    return known, re.compile(rf"(?<!\w)(?:{'|'.join(longest_first)})(?!\w)", re.IGNORECASE)


def link_terms(html: Markup) -> Markup:
    """Link the first occurrence of every glossary term in a section's HTML."""
    known, spelled = _spelled()
    done: set[str] = set()

    def link(match: re.Match[str]) -> str:
        term = known[match[0].lower()]
        if term["id"] in done:
            return match[0]
        done.add(term["id"])
        marked = Markup('<a href="#{id}" title="{meaning}" class="term">{text}</a>')
        return marked.format(**term, text=Markup(match[0]))

    pieces, inside = re.split(r"(<[^>]*>)", html), ""
    for k, piece in enumerate(pieces):
        if k % 2:  # a tag
            name = re.split(r"[\s/>]", piece.strip("</"))[0]
            if piece.startswith("</"):
                inside = "" if name == inside else inside
            elif not inside and name in UNLINKED:
                inside = name
        elif not inside:
            pieces[k] = spelled.sub(link, piece)
    return Markup("".join(pieces))


def glossary_of(pieces: Sequence[str]) -> Markup:
    """Make the list of the linked terms with their meanings."""
    linked = {name for piece in pieces for name in re.findall(r'href="#(term-[^"]*)"', piece)}
    entries = [
        Markup('<dt id="{}">{}</dt><dd>{}</dd>').format(term["id"], term["name"], term["meaning"])
        for term in terms()
        if term["id"] in linked
    ]
    return Markup('<dl class="list">{}</dl>').format(Markup("").join(entries)) if entries else Markup("")
