"""``mocobot report`` as a user meets it: where the page goes, and one sentence for whatever cannot be."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import command
from estimator.errors import InputError
from estimator.files import holds, list_written
from report_folders import diagnosis_folder, estimate_folder, paper_folder


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    return command.run(capsys, "report", *arguments)


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    return command.refused(capsys, "report", *arguments)


@pytest.fixture
def no_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "no-such-renderer")


@pytest.mark.slow
@pytest.mark.usefixtures("no_renderer")
def test_page_is_written_replaced_and_says_why_there_are_no_pictures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = estimate_folder(tmp_path / "estimate")
    code, out, err = run(capsys, folder)
    page = folder / "report.html"
    assert (code, err) == (0, "")
    assert out == f"{page}: {page.stat().st_size / 1e6:.1f} MB; open it in a browser, or hand it on.\n"
    text = page.read_text()
    assert "No pictures" in text
    assert "no-such-renderer" in text
    assert "<img" not in text.partition("<main")[2].partition("</main>")[0]
    assert page.stat().st_size < 8e6

    before = page.read_bytes()
    assert "report.html: exists; give --force" in refused(capsys, folder)
    assert run(capsys, folder, "--force")[0] == 0  # an earlier report is no input
    assert page.read_bytes() == before
    other = tmp_path / "for you.html"
    assert run(capsys, folder, "--out", other)[0] == 0
    assert other.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["estimate", "for you.html"]


def test_folder_without_a_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("paper.json", "diagnosis.json", "mocobot estimate --out"):
        assert name in refused(capsys, tmp_path)
    assert "there is no such folder" in refused(capsys, tmp_path / "missing")
    file = tmp_path / "est.json"
    file.write_text("{}")
    assert "is a file; name the folder that holds it" in refused(capsys, file)
    (tmp_path / "theirs.json").write_text('{"format": "something else"}')
    assert "holds no result of mocobot" in refused(capsys, tmp_path)
    assert not (tmp_path / "report.html").exists()


def edited(name: str, change: Callable[[dict], object]) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        values = json.loads((folder / name).read_text())
        (folder / name).write_text(json.dumps(change(values)))

    return edit


def cut(name: str, keep: float = 0.6) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(keep * len(content))])

    return edit


def without(key: str) -> Callable[[dict], dict]:
    return lambda values: {k: v for k, v in values.items() if k != key}


PAPER, DIAGNOSIS = "paper.json", "diagnosis.json"
BROKEN = [
    (paper_folder, cut(PAPER), (PAPER, "not valid JSON")),
    (paper_folder, edited(PAPER, lambda _: {}),
     (PAPER, "not the scores")),
    (paper_folder, edited(PAPER, lambda v: {"nominal": {"z": v["nominal"]["a"]}}),
     (PAPER, "'z'")),
    (paper_folder, edited(PAPER, lambda v: {"nominal": {"a": without("R12_deg")(v["nominal"]["a"])}}),
     (PAPER, "'R12_deg' is missing")),
    (paper_folder, edited(PAPER, lambda v: {"nominal": {"a": v["nominal"]["a"] | {"m_kg": "heavy"}}}),
     (PAPER, "numbers of at least 0")),
    (paper_folder, edited(PAPER, lambda v: v | {"bad": {"a": v["nominal"]["a"]}}),
     (PAPER, "'b' is missing")),
    (paper_folder, edited("trials.json", lambda _: {"trials": [{"name": "x"}]}),
     ("trials.json", "rod_error_m")),
    (paper_folder, cut("trials.json"), ("trials.json", "not valid JSON")),
    (paper_folder, cut("provenance.json"), ("provenance.json", "not valid JSON")),
    (paper_folder, cut("estimates/a_ideal.json"), ("a_ideal.json", "not valid JSON")),
    (estimate_folder, cut("est.json"), ("est.json", "not valid JSON")),
    (estimate_folder, edited("est.json", lambda v: v | {"version": 7}), ("est.json", "version 7", "reads version 1")),
    (estimate_folder, edited("est.json", without("mass")), ("est.json", "not a complete estimate")),
    (diagnosis_folder, cut(DIAGNOSIS), (DIAGNOSIS, "not valid JSON")),
    (diagnosis_folder, edited(DIAGNOSIS, lambda v: v | {"version": 1}),
     ("version 1", "reads versions 2 and 3")),
    (diagnosis_folder, edited(DIAGNOSIS, lambda v: v | {"format": "x"}),
     ("not a diagnosis", "mocobot-diagnosis")),
    (diagnosis_folder, edited(DIAGNOSIS, lambda v: v | {"verdict": "guilty"}),
     ("verdict", "guilty")),
    (diagnosis_folder, edited(DIAGNOSIS, without("residual")),
     ("not a complete diagnosis", "'residual'")),
    (diagnosis_folder, edited(DIAGNOSIS, lambda v: v | {"causes": [{}]}),
     ("not a complete diagnosis",)),
    (diagnosis_folder, edited(DIAGNOSIS, lambda v: v | {"detection_limits": [{}]}),
     ("not a complete diagnosis", "'cause' is missing")),
    (diagnosis_folder, edited(DIAGNOSIS, lambda v: v | {"undecidable": 3}),
     ("not a complete diagnosis",)),
    (diagnosis_folder, cut("residuals.npz"), ("residuals.npz", "damaged")),
    (diagnosis_folder, edited(DIAGNOSIS, lambda v: v | {"recordings": ["a", "b"]}),
     ("residuals.npz", "other trials")),
    (diagnosis_folder, lambda folder: shutil.copy(folder / DIAGNOSIS, folder / "second.json"), ("second diagnosis",)),
]  # fmt: skip


@pytest.mark.parametrize(("make", "spoil", "said"), BROKEN)
def test_broken_results(
    make: Callable[[Path], Path],
    spoil: Callable[[Path], None],
    said: tuple[str, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = make(tmp_path / "result")
    spoil(folder)
    before = sorted(path.name for path in folder.iterdir())
    sentence = refused(capsys, folder)
    for words in said:
        assert words in sentence, sentence
    assert sorted(path.name for path in folder.iterdir()) == before


def test_nothing_of_others_is_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = diagnosis_folder(tmp_path / "result")
    theirs = tmp_path / "index.html"
    theirs.write_text("<html>mine</html>")
    named = {
        theirs: "exists; give --force",
        tmp_path: "is a folder; name the file to write",
        folder / "diagnosis.json": "must end in .html",
        tmp_path / "page.txt": "must end in .html",
        theirs / "page.html": "index.html is a file)",
        tmp_path / f"{'x' * 300}.html": "cannot be written",
    }
    for out, words in named.items():
        assert words in refused(capsys, folder, "--out", out)
    (folder / "report.html").write_text("mine, too")
    assert "exists; give --force" in refused(capsys, folder)
    link = tmp_path / "link.html"
    link.symlink_to(folder / "diagnosis.json")
    assert "exists; give --force" in refused(capsys, folder, "--out", link)
    assert theirs.read_text() == "<html>mine</html>"
    assert json.loads((folder / "diagnosis.json").read_text())["version"] == 3


@pytest.mark.usefixtures("no_renderer")
def test_page_lies_beside_what_it_is_of_when_diagnosed_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder that also holds a report is still a diagnosis that may be replaced."""
    folder = diagnosis_folder(tmp_path / "result")
    list_written(folder, "diagnosis")
    assert run(capsys, folder)[0] == 0
    assert holds("diagnosis")(folder)
    (folder / "report.html").write_text("mine")
    with pytest.raises(InputError, match=r"report\.html: was not written by mocobot, or changed since"):
        holds("diagnosis")(folder)
