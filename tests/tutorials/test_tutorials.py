"""The tutorials run from top to bottom. One is kept with its outputs, to be read; the others without."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from shown_text import in_words

ROOT = Path(__file__).resolve().parents[2]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))
SHOWN = {"find_an_arms_fault"}
"""Those with outputs."""
SAID = {
    "find_an_arms_fault": ("by friction in joint 3 (elbow).", "no findings", "CONSISTENT", "elbow: 6.4"),
    "estimate_and_replay": ("replay.rrd is complete", "flags: none", "holds alone: standard errors"),
    "hide_and_find": ("explained", "Robot 2, joint 1: the torque sensor reads 0.08"),
    "your_own_log": ("robot 2: theta_x has the wrong sign", "nothing to complain about"),
}
"""What each of them must come to say."""

notebooks = pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)


def test_each_must_say_something():
    assert {path.stem for path in TUTORIALS} == set(SAID)


@notebooks
def test_only_one_is_kept_with_outputs(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert cells[0]["cell_type"] == "markdown"
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 4
    kept = [bool(cell["outputs"] or cell["execution_count"]) for cell in code]
    assert any(kept) == (path.stem in SHOWN)


def text_of(book) -> str:
    """All outputs of a notebook."""
    outputs = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    return "".join(output.get("text", "") or str(output.get("data", "")) for output in outputs)


@pytest.mark.slow
@notebooks
def test_a_tutorial_runs(path, tmp_path, monkeypatch):
    """In a kernel of its own, with warnings as they come there; a cell that fails raises here."""
    import nbformat
    from nbclient import NotebookClient

    sources = [str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(part for part in sources if part))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_PREFER_ENV_PATH", "1")
    book = nbformat.read(path, as_version=4)
    kept = text_of(book)
    here = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(book, timeout=600, kernel_name="python3", resources=here).execute()
    text = text_of(book)
    if path.stem in SHOWN:
        assert in_words(kept) == in_words(text)
    for said in SAID[path.stem]:
        assert said in text, text
