"""The report's file: whole, the same each time, safe against what files hold, honest about what is missing."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from estimator.leftover.leftover import Leftover
from mocobot_report.blocks.html import data_block, el, raw, to_bytes
from mocobot_report.blocks.palette import DARK, LIGHT
from mocobot_report.folder import read_folder
from mocobot_report.page import write_report
from mocobot_report.sources import sources
from mocobot_sim.paper.published import published_errors
from report_folders import NASTY, diagnosis_folder, estimate_folder, paper_folder, payload_estimate

VOID = {"meta", "link", "input", "img", "br"}


TEXTS = (
    ("text", "page"), ("text", "card"), ("text", "sunk"), ("soft", "page"), ("soft", "card"), ("soft", "sunk"),
    ("link", "page"), ("link", "card"), ("good", "good-card"), ("warn", "warn-card"), ("bad", "bad-card"),
    ("text", "good-card"), ("text", "warn-card"), ("text", "bad-card"), ("good", "card"), ("bad", "card"),
)  # fmt: skip
"""Text and background that meet on the page; WCAG AA asks for a contrast of 4.5."""
MARKS = ("paper", "ideal", "nominal", "uncalibrated", "before", "after", "truth", "c1", "c2", "c3", "r1", "r2", "r3",
         "r4", "r5", "r6", "focus")  # fmt: skip
"""Colours of lines and points on a card; WCAG AA asks for 3."""


class Reader(HTMLParser):
    """The standard library's reading of a page: tags in order, text outside of scripts, JSON blocks by id."""

    def __init__(self, page: bytes) -> None:
        super().__init__()
        self.open: list[tuple[str, dict[str, str | None]]] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.blocks: dict[str, dict] = {}
        """Figures."""
        self.templates: dict[str, dict] = {}
        self.feed(page.decode())
        self.close()
        assert not self.open, self.open
        self.templates = self.blocks.pop("templates", {})

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        tag, attributes = self.open[-1] if self.open else ("", {})
        if tag == "script" and attributes.get("type") == "application/json":
            self.blocks[str(attributes["id"])] = json.loads(data)
        elif tag not in ("script", "style"):
            self.text.append(data)

    def rows(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.text))


@pytest.fixture(scope="module")
def no_pictures() -> pytest.MonkeyPatch:
    """Rendering takes seconds and is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "mocobot_report.blocks.pictures.render_shots", lambda shots, *_: "There is no renderer."
        )
        yield patch


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory, no_pictures: pytest.MonkeyPatch) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("results")
    made = {
        "paper": paper_folder(root / "paper"),
        "estimate": estimate_folder(root / "estimate"),
        "diagnosis": diagnosis_folder(root / "diagnosis"),
        "axis": diagnosis_folder(root / "axis", "consistent", axis=True),
    }
    for folder in made.values():
        write_report(folder)
    return made


@pytest.fixture(scope="module")
def pages(folders: dict[str, Path]) -> dict[str, Reader]:
    return {kind: Reader((folder / "report.html").read_bytes()) for kind, folder in folders.items()}


def test_same_files_same_bytes(folders: dict[str, Path], tmp_path: Path) -> None:
    for folder in folders.values():
        again = write_report(folder, tmp_path / "again.html")
        assert again.read_bytes() == (folder / "report.html").read_bytes()


def test_page_refers_to_nothing_outside(pages: dict[str, Reader]) -> None:
    for page in pages.values():
        for tag, attributes in page.tags:
            for name in ("src", "href", "srcset", "action", "poster", "data"):
                value = attributes.get(name)
                assert value is None or value.startswith(("#", "data:")), (tag, value)
        (policy,) = [a["content"] for t, a in page.tags if a.get("http-equiv") == "Content-Security-Policy"]
        assert policy is not None
        assert policy.startswith("default-src 'none'")
        assert "http" not in policy


def test_every_figure_is_valid_for_plotly(pages: dict[str, Reader]) -> None:
    """Plotly's own schema, from its Python side, with a template and shared arrays put in."""
    for kind, page in pages.items():
        assert len(page.blocks) >= 5, kind
        for block in page.blocks.values():
            shared = [t for t in block["data"] if isinstance(t["x"], int)]
            assert {t["x"] for t in shared} == set(range(len(block["arrays"])))
            data = [t | {"x": block["arrays"][t["x"]]} if t in shared else t for t in block["data"]]
            figure = go.Figure(data, block["layout"] | {"template": page.templates["dark"]})
            assert len(figure.data) == len(block["data"]) > 0
            assert {t["meta"] for t in block["data"]} <= set(LIGHT)  # their colours
            for path in block["narrow"]:
                assert isinstance(figure.layout[path.split(".")[0]], object)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_colours_of_plots_are_those_of_the_theme(pages: dict[str, Reader], theme: str) -> None:
    """A template holds one colour at each place, and nothing else of a figure does."""
    colours = {"light": LIGHT, "dark": DARK}[theme]
    for page in pages.values():
        layout = page.templates[theme]["layout"]
        assert layout["font"]["color"] == colours["text"]
        assert layout["xaxis"]["gridcolor"] == layout["yaxis"]["gridcolor"] == colours["grid"]
        for block in page.blocks.values():
            assert not re.search(r"#[0-9a-f]{6}|rgb", json.dumps(block))


def test_published_figures_are_in_the_page(pages: dict[str, Reader]) -> None:
    text = pages["paper"].rows()
    shown = re.findall(r"R (12|23|31) deg ([\d.]+) ± ([\d.]+)", text)
    want = [(pair, published_errors(p)[f"R{pair}_deg"]) for p in "ab" for pair in ("12", "23", "31")]
    assert [pair for pair, _, _ in shown] == [pair for pair, _ in want]
    for (_, mean, std), (_, entry) in zip(shown, want, strict=True):
        assert float(mean) == pytest.approx(entry["mean"], rel=0.051)
        assert float(std) == pytest.approx(entry["std"], rel=0.051)
    assert "1 000 to 1 000 times smaller than the paper's" in text.replace("\u00a0", " ")
    assert "2.0 to 2.0 times smaller" in text
    assert "All 3 trials can be trusted" in text


def test_plotted_errors_are_those_of_the_tables(pages: dict[str, Reader]) -> None:
    block = next(
        b for b in pages["paper"].blocks.values() if "R12" in str(b["layout"]["xaxis"].get("ticktext"))
    )
    shown = {trace["name"]: trace for trace in block["data"]}
    want = [published_errors(p)[f"R{pair}_deg"] for p in "ab" for pair in ("12", "23", "31")]
    assert shown["paper"]["y"] == [entry["mean"] for entry in want]
    assert shown["paper"]["error_y"]["array"] == [entry["std"] for entry in want]
    np.testing.assert_allclose(shown["nominal"]["y"], [1e-2 * entry["mean"] for entry in want])
    assert block["layout"]["yaxis"]["type"] == "log"


def test_residuals_of_the_page_are_those_of_the_file(
    folders: dict[str, Path], pages: dict[str, Reader]
) -> None:
    """400 rows are kept one by one; NaN stands in the pause; holds follow as points."""
    import base64

    trace = read_folder(folders["diagnosis"]).diagnosis.traces[0]
    block = next(
        b for b in pages["diagnosis"].blocks.values() if "grasp 2 rotation" in str(b["layout"].get("yaxis"))
    )
    line = block["data"][0]
    y = np.frombuffer(base64.b64decode(line["y"]["bdata"]), dtype="<f4")
    assert np.isnan(y).sum() == 1
    np.testing.assert_allclose(y[~np.isnan(y)], 1e3 * trace.before[: trace.moving, 0], rtol=1e-6)
    holds = np.frombuffer(base64.b64decode(block["data"][3]["y"]["bdata"]), dtype="<f4")
    np.testing.assert_allclose(holds, 1e3 * trace.before[trace.moving :, 0], rtol=1e-6)


def test_labels_and_names_stay_text(pages: dict[str, Reader]) -> None:
    shown = "".join(pages["estimate"].text)
    assert NASTY in shown
    assert "alert" in "".join(pages["diagnosis"].text)
    for page in pages.values():
        scripts = [attributes for tag, attributes in page.tags if tag == "script"]
        assert len(scripts) == 3 + len(page.blocks)


def test_plots_do_not_read_names_as_markup(pages: dict[str, Reader]) -> None:
    texts = [str(b) for b in pages["diagnosis"].blocks.values()]
    assert any("&lt;/script&gt;" in text for text in texts)
    assert not any("</scr" in text or "<scr" in text for text in texts)


def test_json_cannot_leave_its_element() -> None:
    block = data_block("x", {"name": NASTY, "other": "]]> <!-- \u2029"})
    page = to_bytes(el("html", el("body", block, el("p", NASTY, title=NASTY)), lang="en"))
    assert page.count(b"</script>") == 1
    read = Reader(page)
    assert read.blocks["x"]["name"] == NASTY
    assert next(a["title"] for t, a in read.tags if t == "p") == NASTY
    with pytest.raises(ValueError, match="must not hold"):
        raw("script", "x</SCRIPT>")
    with pytest.raises(ValueError, match="JSON compliant"):
        data_block("x", {"value": float("nan")})


def test_characters_that_html_forbids_are_replaced() -> None:
    page = to_bytes(el("p", "a\x00b\x1b\ud800c\ufffe", title="\x07"))
    assert (
        page
        == b'<!doctype html>\n<p title="\xef\xbf\xbd">a\xef\xbf\xbdb\xef\xbf\xbd\xef\xbf\xbdc\xef\xbf\xbd</p>\n'
    )


@pytest.mark.parametrize("theme", [LIGHT, DARK])
def test_contrast_of_the_palette(theme: dict[str, str]) -> None:
    for text, back in TEXTS:
        assert _contrast(theme[text], theme[back]) >= 4.5, (text, back)
    for mark in MARKS:
        for back in ("card", "sunk"):
            assert _contrast(theme[mark], theme[back]) >= 3.0, (mark, back)


def test_contrast_is_that_of_wcag() -> None:
    """Values from WebAIM's contrast checker."""
    assert _contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert _contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)
    assert _contrast("#ff0000", "#ffffff") == pytest.approx(4.0, abs=0.005)


def test_moved_and_changed_recordings_are_named(
    tmp_path: Path, no_pictures: pytest.MonkeyPatch, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = estimate_folder(tmp_path / "a", "b")
    moved = tmp_path / "elsewhere"
    shutil.move(folder, moved)  # together with its recording
    (found,) = sources(read_folder(moved).estimates[0].provenance, moved)
    assert found.path == moved / "a b.parquet"
    text = Reader(write_report(moved).read_bytes()).rows()
    assert "Flanges and grasps apart" in text

    recording = moved / "a b.parquet"
    recording.write_bytes(recording.read_bytes() + b" ")
    assert (
        "a b.parquet is no longer the file that the result was made from"
        in Reader(write_report(moved).read_bytes()).rows()
    )
    recording.unlink()
    text = Reader(write_report(moved).read_bytes()).rows()
    assert "a b.parquet is no longer where it was" in text
    assert "Flanges and grasps apart" not in text
    assert "Grasp frames from each other" in text


def test_errors_against_the_truth(pages: dict[str, Reader], folders: dict[str, Path]) -> None:
    estimate = read_folder(folders["estimate"]).estimates[0].estimate
    error = estimate.mass.mass - 11.672
    text = pages["estimate"].rows()
    match = re.search(r"mass kg 11\.672 (\S+(?: × 10\S+)?) ", text.replace("\u00a0", " "))
    assert match
    shown = match[1].replace("\u2212", "-").split(" × 10")
    power = int(shown[1].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))) if len(shown) > 1 else 0
    assert float(shown[0]) * 10.0**power == pytest.approx(error, rel=0.05)


@pytest.mark.parametrize(
    ("missing", "said"),
    [
        ({"mass": None}, "The recordings do not give: mass."),
        ({"inertia": None, "grasps": None, "recordings": ()}, "The recordings do not give: inertia, grasps."),
        ({"flags": ("Robot 2 pulls.",)}, "Robot 2 pulls."),
        ({}, "Nothing speaks against these numbers"),
    ],
)
def test_what_is_not_known_is_said_first(
    missing: dict, said: str, tmp_path: Path, no_pictures: pytest.MonkeyPatch
) -> None:
    estimate = replace(payload_estimate(), **missing)
    (tmp_path / "est.json").write_text(json.dumps(estimate.to_dict()))
    text = Reader(write_report(tmp_path).read_bytes()).rows()
    answer = text.partition("The estimate in detail")[2].partition("The estimate in detail")[0]
    assert said in answer
    assert ("Nothing speaks against these numbers" in answer) == (missing == {})


def test_robots_that_contradict_each_other_are_the_first_thing_said(
    tmp_path: Path, no_pictures: pytest.MonkeyPatch
) -> None:
    estimate = payload_estimate()
    assert estimate.contradicts is False
    (recording,) = estimate.recordings
    wrong = replace(recording, leftovers=(Leftover("force", "N", 3.1, 0.05),))
    wrong = replace(estimate, recordings=(wrong,), flags=("The robots contradict each other beyond noise.",))
    (tmp_path / "est.json").write_text(json.dumps(wrong.to_dict()))
    text = Reader(write_report(tmp_path).read_bytes()).rows()
    assert "do not trust the standard errors" in text
    assert "Nothing speaks against these numbers" not in text
    assert re.search(r"rec.parquet random .* 62", text.replace("\u00a0", " "))


def test_provenance_lists_what_was_read(pages: dict[str, Reader], folders: dict[str, Path]) -> None:
    for kind, name in (("paper", "paper.json"), ("diagnosis", "residuals.npz"), ("estimate", "est.json")):
        text = pages[kind].rows()
        assert hashlib.sha256((folders[kind] / name).read_bytes()).hexdigest() in text, kind
        assert "numpy 2." in text
    assert (
        hashlib.sha256((folders["estimate"] / "a b.parquet").read_bytes()).hexdigest()
        in pages["estimate"].rows()
    )


def test_options_are_shown_as_they_were_given(pages: dict[str, Reader]) -> None:
    """0 is a number, and no "no"."""
    assert "option seed 0" in pages["paper"].rows()
    assert "option closed_loop yes" in pages["diagnosis"].rows()
    assert "option closed_loop no" in pages["axis"].rows()


def test_one_page_for_several_results(tmp_path: Path, no_pictures: pytest.MonkeyPatch) -> None:
    folder = diagnosis_folder(tmp_path / "all", "unexplained")
    source = estimate_folder(tmp_path / "one", "b")
    for k in (1, 2):
        shutil.copy(source / "est.json", folder / f"est{k}.json")
    (folder / "diagnosis.txt").write_text("not read")
    page = Reader(write_report(folder).read_bytes())
    text = page.rows()
    assert "3 results" in text
    assert "Estimate est1.json" in text
    assert "Estimate est2.json" in text
    assert "no cause of the catalogue accounts for it" in text
    identities = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(identities) == len(set(identities))


def _contrast(one: str, other: str) -> float:
    """Contrast ratio of two colours ``#rrggbb`` as WCAG 2.2 defines it."""
    light, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _luminance(colour: str) -> float:
    parts = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    red, green, blue = (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue
