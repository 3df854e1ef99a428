"""The report's file: whole, the same each time, safe against what files hold, honest about what is missing."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from estimator.estimate.leftover import Leftover
from mocobot_report.folder import read_folder, sources
from mocobot_report.numbers import measured, plain
from mocobot_report.page import write_report
from mocobot_report.palette import DARK, LIGHT
from mocobot_sim.paper.scoring import published_errors
from report_folders import (
    NASTY,
    calibration_folder,
    diagnosis_folder,
    estimate_folder,
    paper_folder,
    payload_estimate,
    rolled,
)

VOID = {"meta", "link", "input", "img", "br", "path", "circle", "rect"}
MOST_BYTES = 2.5e6


class Reader(HTMLParser):
    """The standard library's reading of a page: tags in order, text outside of scripts, figures by id."""

    def __init__(self, page: bytes) -> None:
        super().__init__()
        self.open: list[tuple[str, dict[str, str | None]]] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.code = ""
        self.blocks: dict[str, dict] = {}
        self.templates: dict[str, dict] = {}
        self.feed(page.decode())
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        tag, attributes = self.open[-1] if self.open else ("", {})
        if attributes.get("id") == "figures":
            packed = base64.b85decode(data.replace(",", "<"))
            values = json.loads(gzip.decompress(packed), parse_constant=pytest.fail)
            self.blocks, self.templates = values["figures"], values["templates"]
        elif tag not in ("script", "style"):
            self.text.append(data)
            self.code += f" {data}" if tag == "code" else ""

    def rows(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.text))

    def block(self, words: str) -> dict:
        """The first figure that holds words."""
        return next(block for block in self.blocks.values() if words in json.dumps(block, ensure_ascii=False))


def written(folder: Path) -> Reader:
    return Reader(write_report(folder).read_bytes())


def edit(folder: Path, change: Callable[[dict], object]) -> Path:
    """Change a folder's diagnosis."""
    values = json.loads((folder / "diagnosis.json").read_text())
    change(values)
    (folder / "diagnosis.json").write_text(json.dumps(values))
    return folder


@pytest.fixture(scope="module", autouse=True)
def no_pictures() -> pytest.MonkeyPatch:
    """Rendering takes seconds and is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mocobot_report.page.render_shots", lambda shots, *_: "There is no renderer.")
        yield patch


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
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


def test_same_files_same_bytes_and_few(folders: dict[str, Path], tmp_path: Path) -> None:
    for folder in folders.values():
        again = write_report(folder, tmp_path / "again.html").read_bytes()
        assert again == (folder / "report.html").read_bytes()
        assert len(again) < MOST_BYTES


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


def test_every_figure_is_valid_for_plotly_and_has_no_colour_of_its_own(pages: dict[str, Reader]) -> None:
    """Plotly's own schema, from its Python side, with a template and shared arrays put in."""
    for kind, page in pages.items():
        assert len(page.blocks) >= 5, kind
        for theme, colours in (("light", LIGHT), ("dark", DARK)):
            layout = page.templates[theme]["layout"]
            assert layout["font"]["color"] == colours["text"]
            assert layout["xaxis"]["gridcolor"] == layout["yaxis"]["gridcolor"] == colours["grid"]
        for block in page.blocks.values():
            shared = [t for t in block["data"] if isinstance(t["x"], int)]
            assert {t["x"] for t in shared} == set(range(len(block["arrays"])))
            data = [t | {"x": block["arrays"][t["x"]]} if t in shared else t for t in block["data"]]
            figure = go.Figure(data, block["layout"] | {"template": page.templates["dark"]})
            assert len(figure.data) == len(block["data"]) > 0
            assert {t["meta"] for t in block["data"]} <= set(LIGHT)  # their colours
            assert not re.search(r"#[0-9a-f]{6}|rgb", json.dumps(block))
            for path in block["narrow"]:
                assert isinstance(figure.layout[path.split(".")[0]], object)


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

    block = pages["paper"].block("R12<br>")
    traces = {trace["name"]: trace for trace in block["data"]}
    assert traces["paper"]["y"] == [entry["mean"] for _, entry in want]
    assert traces["paper"]["error_y"]["array"] == [entry["std"] for _, entry in want]
    np.testing.assert_allclose(traces["nominal"]["y"], [1e-2 * entry["mean"] for _, entry in want])
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
    blocks = [b for b in pages["paper"].blocks.values() if "R31" in str(b["layout"]["xaxis"].get("ticktext"))]
    (block,) = [b for b in blocks if b["data"][0]["y"][0] is None]
    shown = {trace["name"]: trace["y"] for trace in block["data"]}
    want = [1e-3 * published_errors(p)[f"R{pair}_deg"]["mean"] for p in "ab" for pair in ("12", "23", "31")]
    np.testing.assert_allclose(shown["uncalibrated, self-calibrated"], want)
    assert shown["uncalibrated, transfer"] == [None, None, None, *shown["uncalibrated, self-calibrated"][3:]]
    assert shown["paper"] == shown["nominal"] == [None] * 6


def test_residuals_of_the_page_are_those_of_the_file(
    folders: dict[str, Path], pages: dict[str, Reader]
) -> None:
    """400 rows are kept one by one; NaN stands in the pause; holds follow as points."""
    (result,) = read_folder(folders["diagnosis"])
    trace = result.found.traces[0]
    line, _, _, points, *_ = pages["diagnosis"].block("grasp 2 rotation")["data"]
    y, holds = (np.frombuffer(base64.b64decode(one["y"]["bdata"]), dtype="<f4") for one in (line, points))
    assert np.isnan(y).sum() == 1
    np.testing.assert_allclose(y[~np.isnan(y)], 1e3 * trace.before[: trace.moving, 0], rtol=1e-6)
    np.testing.assert_allclose(holds, 1e3 * trace.before[trace.moving :, 0], rtol=1e-6)


def test_labels_and_names_stay_text(pages: dict[str, Reader]) -> None:
    assert NASTY in "".join(pages["estimate"].text)
    assert "alert" in "".join(pages["diagnosis"].text)
    for page in pages.values():
        scripts = [attributes.get("id") for tag, attributes in page.tags if tag == "script"]
        assert scripts == ["plotly", "figures", None]
    texts = [str(b) for b in pages["diagnosis"].blocks.values()]
    assert any("&lt;/script&gt;" in text for text in texts)
    assert not any("</scr" in text or "<scr" in text for text in texts)


def test_moved_and_changed_recordings_are_named(tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere"
    shutil.move(estimate_folder(tmp_path / "a", "b"), moved)  # together with its recording
    recording = moved / "a b.parquet"
    (result,) = read_folder(moved)
    assert [found.path for found in sources(result)] == [recording]
    assert "Flanges and grasps apart" in written(moved).rows()

    recording.write_bytes(recording.read_bytes() + b" ")
    assert "a b.parquet is no longer the file that the result was made from" in written(moved).rows()
    recording.unlink()
    text = written(moved).rows()
    assert "a b.parquet is no longer where it was" in text
    assert "Flanges and grasps apart" not in text
    assert "Grasp frames from each other" in text


LEFTOVER = (Leftover("force", "N", 3.1, 0.05),)


@pytest.mark.parametrize(
    ("missing", "said"),
    [
        ({"mass": None}, ["The recordings do not give: mass."]),
        (
            {"inertia": None, "grasps": None, "recordings": ()},
            ["The recordings do not give: inertia, grasps."],
        ),
        ({"flags": ("Robot 2 pulls.",)}, ["Robot 2 pulls."]),
        ({"flags": ("They contradict.",), "recordings": LEFTOVER}, ["do not trust the standard errors"]),
        ({}, ["Nothing speaks against these numbers"]),
    ],
)
def test_what_is_not_known_is_said_first(missing: dict, said: list[str], tmp_path: Path) -> None:
    estimate = payload_estimate()
    if missing.get("recordings") == LEFTOVER:
        missing = missing | {"recordings": (replace(estimate.recordings[0], leftovers=LEFTOVER),)}
    (tmp_path / "est.json").write_text(json.dumps(replace(estimate, **missing).to_dict()))
    text = written(tmp_path).rows().replace("\u00a0", " ")
    answer = text.partition("The estimate in detail")[2].partition("The estimate in detail")[0]
    assert all(words in answer for words in said)
    assert ("Nothing speaks against these numbers" in answer) == (missing == {})
    if getattr(next(iter(missing.get("recordings", ())), None), "leftovers", None) == LEFTOVER:
        assert re.search(r"rec.parquet random .* 62", text)


def test_provenance_lists_what_was_read_and_how(pages: dict[str, Reader], folders: dict[str, Path]) -> None:
    """The texts, not only the names in front of them: an element without children once counted as nothing."""
    for kind, name in (
        ("paper", "provenance.json"),
        ("diagnosis", "diagnosis.json"),
        ("estimate", "est.json"),
    ):
        text, values = pages[kind].rows(), json.loads((folders[kind] / name).read_text())
        made = values if kind == "paper" else values["provenance"]
        assert f"command mocobot {made['command']} mocobot {made['mocobot']} commit {made['commit']}" in text
        assert f"Python {made['python']} on {made['platform']} packages" in text
        assert "numpy 2." in text
        assert hashlib.sha256((folders[kind] / name).read_bytes()).hexdigest() in text
    for kind, name in (("paper", "paper.json"), ("diagnosis", "residuals.npz"), ("estimate", "a b.parquet")):
        assert hashlib.sha256((folders[kind] / name).read_bytes()).hexdigest() in pages[kind].rows()
    assert "option seed 0" in pages["paper"].rows()  # 0 is a number, and no "no"
    assert "option closed_loop yes" in pages["diagnosis"].rows()
    assert "option closed_loop no" in pages["robot"].rows()


def test_results_are_named_by_what_they_are(pages: dict[str, Reader], tmp_path: Path) -> None:
    named = "Diagnosis of 2 trials: torque zero of joint 1 of robot 2"
    assert named in pages["diagnosis"].rows()
    assert "Diagnosis of a robot in 2 trials: consistent" in pages["robot"].rows()
    assert "Calibration of 3 robots from 4 recordings" in pages["calibration"].rows()
    assert "2 trials of a robot's joints are held against the simulation" in pages["robot"].rows()
    assert "recordings of a team that carries one payload are held" in pages["diagnosis"].rows()

    folder = diagnosis_folder(tmp_path / "all")
    source = estimate_folder(tmp_path / "one", "b")
    for k in (1, 2, 3):
        shutil.copy(source / "est.json", folder / f"est{k}.json")
    (folder / "diagnosis.txt").write_text("not read")
    page = written(folder)
    text = page.rows()
    assert f"{named}; payload (b), estimated from 1 recording; and 2 more results" in text
    for k in (1, 2, 3):
        assert f"Estimate est{k}.json" in text
        assert f"Payload (b), estimated from 1 recording: est{k}.json" in text
    identities = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(identities) == len(set(identities))


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


def as_found(folder: Path) -> Path:
    (folder / "as_found").mkdir()
    (folder / "as_found" / "team.xml").write_text("<mujoco/>")
    return folder


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
    (block,) = [b for b in pages["calibration"].blocks.values() if b["data"][0].get("type") == "bar"]
    np.testing.assert_allclose(np.sum([trace["x"] for trace in block["data"]], axis=0), 100.0)
    assert len(block["data"]) == 5


def test_rollouts_have_every_joint(tmp_path: Path) -> None:
    folder = diagnosis_folder(tmp_path / "robot", robot=True)
    page = written(edit(folder, lambda values: values.update(rollouts=rolled(), machine="joints")))
    assert page.block("speed [typical\u00a0speeds]")  # no metres per second, as of a team
    text = page.rows()
    for said in ("Simulated from measured states", "30 of 40", "Not in the rollouts: elasticity of joint 1"):
        assert said in text
    assert re.search(r"hip \[mrad\] 0\.10 50\.0 10\.0 80.% 40", text)
    assert re.search(r"lift \[mm\] 2\.00 1\.00 50.%", text)
    bare = written(edit(folder, lambda values: values.update(rollouts=rolled(named=False)))).rows()
    assert "removed" not in bare.partition("Simulated from measured states")[2].partition("Residuals")[0]

    def without(values: dict) -> None:
        loop = values["rollouts"]["commanded"] | {"why_not": "the log has no commands"}
        values["rollouts"] |= {"why_not": "no torque of joint hip is known", "commanded": loop}

    text = written(edit(folder, without)).rows()
    assert "Not rolled out freely: no torque of joint hip is known." in text
    assert "The closed loop was not simulated: the log has no commands." in text
