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

from estimator.estimate.leftover import Leftover
from mocobot_report.blocks.html import data_block, el, raw, to_bytes
from mocobot_report.blocks.numbers import measured, plain
from mocobot_report.blocks.palette import DARK, LIGHT
from mocobot_report.blocks.series import around_zero
from mocobot_report.folder import read_folder
from mocobot_report.glossary import link_terms
from mocobot_report.page import write_report
from mocobot_report.sources import sources
from mocobot_sim.paper.scoring import published_errors
from report_folders import (
    NASTY,
    calibration_folder,
    diagnosis_folder,
    estimate_folder,
    paper_folder,
    payload_estimate,
)

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
        self.code = ""
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
            self.code += f" {data}" if tag == "code" else ""

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
        "robot": diagnosis_folder(root / "robot", "consistent", robot=True),
        "calibration": calibration_folder(root / "calibration"),
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


def test_fits_are_told_in_both_frames(pages: dict[str, Reader]) -> None:
    """R31 of (b) is 1.91 deg in the paper: a quarter of it against the CAD, a thousandth as the encoders have it."""
    text = pages["paper"].rows().replace("\u00a0", " ")
    assert (
        "uncalibrated, transfer (the uncalibrated team as one payload has calibrated it, carrying the others): "
        "in the frames that the encoders define, grasps within 0.0019 deg and 0.039 mm, centre of mass within "
        "0.018 mm; mass and inertia within 0.030 % beyond the springs' common scale (0.64 %). Against the CAD, "
        "grasps are off by up to 0.48 deg"
    ) in text
    assert "calibrated teams are truth / (1 + mean stiffness ratio of their springs), here -0.64 %" in text
    block = next(b for b in pages["paper"].blocks.values() if "R31" in str(b["layout"]["xaxis"].get("ticktext")) and
                 b["data"][0]["y"][0] is None)  # fmt: skip
    shown = {trace["name"]: trace["y"] for trace in block["data"]}
    want = [1e-3 * published_errors(p)[f"R{pair}_deg"]["mean"] for p in "ab" for pair in ("12", "23", "31")]
    np.testing.assert_allclose(shown["uncalibrated, self-calibrated"], want)
    assert shown["uncalibrated, transfer"] == [None, None, None, *shown["uncalibrated, self-calibrated"][3:]]
    assert shown["paper"] == shown["nominal"] == [None] * 6


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


def test_characters_that_html_forbids_are_shown_escaped() -> None:
    page = to_bytes(el("p", "a\x00b\x1b\ud800c\ufffe", title="\x07"))
    assert (
        page
        == rb"""<!doctype html>
<p title="\x07">a\x00b\x1b\ud800c\ufffe</p>
"""
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


@pytest.mark.parametrize("simulated", [0, 1])
def test_not_every_trial_was_simulated_again(simulated: int, tmp_path: Path) -> None:
    """Of a long recording only the first part is; a dot has the name of its own trial."""
    folder = diagnosis_folder(tmp_path / "long")
    values = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    values["gain"]["trials"] = [values["gain"]["trials"][simulated]]
    (folder / "diagnosis.json").write_text(json.dumps(values), encoding="utf-8")
    text = write_report(folder).read_text(encoding="utf-8")
    names = {match for match in re.findall(r'"([^"]*), with the causes: ', text)}
    assert len(names) == 1
    assert ("one" in names.pop()) == (simulated == 0)


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


def test_how_a_result_was_made_can_be_read(pages: dict[str, Reader], folders: dict[str, Path]) -> None:
    """The texts, not only the names in front of them: an element without children once counted as nothing."""
    files = {"paper": "provenance.json", "diagnosis": "diagnosis.json", "estimate": "est.json"}
    for kind, file in files.items():
        values = json.loads((folders[kind] / file).read_text())
        made = values if kind == "paper" else values["provenance"]
        text = pages[kind].rows()
        assert f"command mocobot {made['command']} mocobot {made['mocobot']} commit {made['commit']}" in text
        assert f"Python {made['python']} on {made['platform']} packages" in text


def test_options_are_shown_as_they_were_given(pages: dict[str, Reader]) -> None:
    """0 is a number, and no "no"."""
    assert "option seed 0" in pages["paper"].rows()
    assert "option closed_loop yes" in pages["diagnosis"].rows()
    assert "option closed_loop no" in pages["robot"].rows()


def test_a_robots_page_is_not_called_a_teams(pages: dict[str, Reader]) -> None:
    text = pages["robot"].rows()
    assert "Diagnosis of a robot: consistent" in text
    assert "2 trials of a robot's joints are held against the simulation" in text.replace("’", "'")
    assert "recordings of a team that carries one payload are held" in pages["diagnosis"].rows()


def test_causes_are_read_in_words(pages: dict[str, Reader]) -> None:
    """What the command line calls them stands softly behind, as code; nowhere else."""
    page = pages["diagnosis"]
    text = page.rows()
    assert re.search(r"Torque zero of joint 1 of robot 2 sea_bias 0\.0500 ± 0\.0010 N m bias", text)
    assert "Spring stiffness of joint 1 of robot 2 sea_scale cannot be told apart" in text
    assert "Encoder zero of a gimbal axis theta_zero zero 0.60 mrad 1 of 2" in text
    assert "Encoder zero of a driven joint phi_zero zero 0.040 mrad everywhere" in text  # the same unit
    for name in ("sea_bias", "sea_scale", "theta_zero", "slosh"):
        assert "".join(page.text).count(name) == page.code.count(name) > 0
    plots = json.dumps(list(page.blocks.values()))
    assert "torque zero of joint 1 of robot 2" in plots
    assert "sea_" not in plots


def test_shares_of_causes_add_up(tmp_path: Path, no_pictures: pytest.MonkeyPatch) -> None:
    folder = diagnosis_folder(tmp_path / "two")
    values = json.loads((folder / "diagnosis.json").read_text())
    first = values["causes"][0] | {"explained": {"in_sample": 0.7, "held_out": 0.65}}
    values["causes"] = [first, first | {"explained": {"in_sample": 0.2, "held_out": 0.25}}]
    (folder / "diagnosis.json").write_text(json.dumps(values))
    text = Reader(write_report(folder).read_bytes()).rows()
    assert "All together 90 90" in text
    assert "beyond those above it, so that shares add up" in text


def test_a_number_of_a_form_that_a_cause_does_not_have_is_left_out(
    tmp_path: Path, no_pictures: pytest.MonkeyPatch
) -> None:
    folder = diagnosis_folder(tmp_path / "one")
    values = json.loads((folder / "diagnosis.json").read_text())
    for value, shown in ((0.0, False), (0.002, True)):
        values["causes"][0]["parameters"]["presliding_rad"] = {"value": value, "se": None}
        (folder / "diagnosis.json").write_text(json.dumps(values))
        assert ("presliding" in Reader(write_report(folder).read_bytes()).rows()) == shown


def test_models_to_take_away_are_told_where_they_are(tmp_path: Path, no_pictures: pytest.MonkeyPatch) -> None:
    folder = diagnosis_folder(tmp_path / "one")
    assert "--model as_found" not in write_report(folder).read_text(encoding="utf-8")
    (folder / "as_found").mkdir()
    (folder / "as_found" / "team.xml").write_text("<mujoco/>")
    page = write_report(folder).read_text(encoding="utf-8")
    for name in ("extended", "as_found"):
        assert f"mocobot simulate --model {name}" in page
        assert f"{name}/team.xml" in page


def test_what_fits_much_worse_is_folded_away_and_parts_as_found_are_told(
    tmp_path: Path, no_pictures: pytest.MonkeyPatch
) -> None:
    folder = diagnosis_folder(tmp_path / "one")
    values = json.loads((folder / "diagnosis.json").read_text())
    cause = values["causes"][0]
    rival = cause["alternatives"][0]
    others = [{**rival, "name": f"rival {k}", "evidence_gap": 9.0 + k, "ambiguous": False} for k in range(7)]
    likely = {**rival, "name": "a rare rival", "evidence_gap": 7.0, "ambiguous": False, "probability": 0.002}
    cause["alternatives"] = [rival, *({**one, "probability": 1e-5} for one in others), likely]
    cause["sentence"] = "The grasp is loose by +-(196.6 +- 3.9 um) along each axis."
    values["gain"]["held_out"]["as_found"] = values["gain"]["held_out"]["after"] | {"chi2_per_n": 4.321}
    (folder / "diagnosis.json").write_text(json.dumps(values))
    page = write_report(folder).read_text(encoding="utf-8")
    assert "loose by ±(196.6\u00a0±\u00a03.9 µm) along" in page
    assert "is 4.32 with every part as far off as it is found" in page
    shown, folded = page.split("What fits worse still")
    table = shown.split("What else it might be")[-1]
    for name in ("Rival 0", "Rival 3", "A rare rival", "Spring stiffness of joint 1 of robot 2"):
        assert name in table
    assert "Rival 4" not in table
    for k in range(7):
        assert (f"Rival {k}" in folded) == (k >= 4)


def test_terms_are_explained_where_they_stand(pages: dict[str, Reader]) -> None:
    for page in pages.values():
        entries = {a["id"] for tag, a in page.tags if tag == "dt" and "id" in a}
        links = [a for tag, a in page.tags if tag == "a" and a.get("class") == "term"]
        assert {a["href"] for a in links} == {f"#{name}" for name in entries}
        assert all(a["title"] for a in links)
    terms = {a["id"] for tag, a in pages["diagnosis"].tags if tag == "dt" and "id" in a}
    assert {"term-nat", "term-chi-n-misfit", "term-whitened", "term-held-out", "term-in-sample"} <= terms
    assert "5 nats are a factor of 150" in pages["diagnosis"].rows()
    assert "term-frame-grasp-frame" in {a.get("id") for _, a in pages["estimate"].tags}
    section = el(
        "section", el("p", "A nat, two nats, <rms>"), el("h3", "nats"), el("section", el("td", "nat"))
    )
    assert [term.name for term in link_terms([section])] == ["nat", "rms"]
    shown = to_bytes(section).decode()
    assert shown.count('class="term"') == 3  # once in every section, never in a heading
    assert "</a>, two nats, &lt;<a" in shown


def test_evidence_is_dots_on_one_scale(pages: dict[str, Reader]) -> None:
    """A bar would need a zero, which a logarithmic axis has not; what has less than 1 nat is not drawn."""
    shown = [b for b in pages["diagnosis"].blocks.values() if "evidence [nats]" in json.dumps(b)]
    (before,) = shown  # with the cause in the model nothing is left that has 1
    assert {trace["type"] for trace in before["data"]} == {"scatter"}
    rings, *dots = before["data"]
    assert rings["x"] == [7.0, 7.0, 7.0]
    assert sorted(x for trace in dots for x in trace["x"]) == [1.4, 150.0, 180.0]
    assert before["layout"]["xaxis"]["range"][0] == pytest.approx(np.log10(1.4) - 0.15)


def test_one_plot_per_robot(pages: dict[str, Reader]) -> None:
    block = next(b for b in pages["estimate"].blocks.values() if "robot 3: gap" in json.dumps(b))
    assert [trace["yaxis"] for trace in block["data"]] == ["y", "y2", "y3", "y4", "y5", "y6"]
    ranges = [block["layout"][f"yaxis{k}"]["range"] for k in ("", 2, 3)]
    assert ranges[0] == ranges[1] == ranges[2]
    assert "robot 2: gap angle" in block["layout"]["yaxis5"]["title"]["text"]


def test_band_follows_the_noise_of_every_row() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0, np.nan, 6.0, 7.0])
    half = np.array([4.0, 1.0, 1.0, 1.0, np.nan, 2.0, 2.0])
    assert around_zero(time, half) == "M0,4L1,1L3,1L3,-1L1,-1L0,-4ZM6,2L7,2L7,-2L6,-2Z"


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


def test_numbers_of_a_calibration_are_in_its_page(pages: dict[str, Reader], folders: dict[str, Path]) -> None:
    values = json.loads((folders["calibration"] / "calibration.json").read_text(encoding="utf-8"))
    text = pages["calibration"].rows()
    for robot, deviations in enumerate(values["deviations"], start=1):
        assert f"Robot {robot}" in text
        value, se = (deviations["rod_length_m"][key][1] for key in ("value", "se"))
        assert " ± ".join(measured(1e3 * value, 1e3 * se)) in text
    payload = values["payloads"][0]
    assert " ± ".join(measured(payload["m_kg"], payload["m_se_kg"])) in text
    assert " ± ".join(measured(1e3 * payload["p_1c_m"][1], 1e3 * payload["p_1c_se_m"][1])) in text
    assert "Nothing speaks against these numbers" in text
    assert "held as designed" in text  # the springs' scale
    for trial in values["trials"]:
        fits = [fit for fit in trial["chi2_per_n"].values() if fit is not None]
        assert all(plain(fit["balance"]) in text for fit in fits)
    # What recordings leave of the whole is the prior's.
    bars = [block for block in pages["calibration"].blocks.values() if block["data"][0].get("type") == "bar"]
    (block,) = bars
    totals = np.sum([trace["x"] for trace in block["data"]], axis=0)
    np.testing.assert_allclose(totals, 100.0)
    assert len(block["data"]) == 5


def test_findings_of_a_calibration_come_first(tmp_path: Path, no_pictures: pytest.MonkeyPatch) -> None:
    folder = calibration_folder(tmp_path / "bad", ("The encoder of phi2 of robot 3 slipped by 1.2 deg.",))
    text = Reader(write_report(folder).read_bytes()).rows()
    assert "What speaks against these numbers" in text
    assert "The encoder of phi2 of robot 3 slipped by 1.2 deg." in text
    assert "Nothing speaks against" not in text


def test_places_of_a_kind_that_scatters_are_told(tmp_path: Path) -> None:
    folder = diagnosis_folder(tmp_path / "diagnosis", "miscalibrated")
    write_report(folder, tmp_path / "page.html")
    page = re.sub(r"<[^>]+>", "", (tmp_path / "page.html").read_text())
    assert (
        "Zero of a gimbal axis: farthest off are robot 2, joint 3 (−9.1 mrad), robot 1, joint 1 (7.2 mrad)"
        in page
    )
    assert "What it is worth to know the robots" in page
    assert "The payload's estimate before and after" in page
