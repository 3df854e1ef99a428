"""The tutorials run from top to bottom, and are kept without outputs."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))
SAID = {
    "estimate_and_replay": ("replay.rrd is complete", "flags: none", "holds alone: standard errors"),
    "hide_and_find": ("explained", "Robot 2, joint 1: the torque sensor reads 0.08"),
    "your_own_log": ("robot 2: theta_x has the wrong sign", "nothing to complain about"),
}
"""What each of them must come to say."""

notebooks = pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)


def test_there_are_three():
    assert {path.stem for path in TUTORIALS} == set(SAID)


@notebooks
def test_a_tutorial_is_kept_without_outputs(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert cells[0]["cell_type"] == "markdown"
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 4
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)


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
    here = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(book, timeout=600, kernel_name="python3", resources=here).execute()
    outputs = [output for cell in book.cells if cell.cell_type == "code" for output in cell.outputs]
    text = "".join(output.get("text", "") or str(output.get("data", "")) for output in outputs)
    for said in SAID[path.stem]:
        assert said in text, text
