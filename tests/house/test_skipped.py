"""The line that ends ``make test`` counts the tests that were skipped, by reason."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TESTS = """
import pytest

def test_runs():
    pass

@pytest.mark.parametrize("k", [1, 2])
def test_of_a_browser(k):
    pytest.skip("no browser")

@pytest.mark.skipif(True, reason="no device")
def test_of_a_device():
    pass
"""


def test_the_last_line_says_what_was_skipped_and_why(tmp_path: Path) -> None:
    (tmp_path / "test_some.py").write_text(TESTS, encoding="utf-8")
    line = tmp_path / "line.txt"
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-c",
        ROOT / "pyproject.toml",
        "-p",
        "conftest",
        tmp_path,
    ]
    folders = [str(ROOT / "tests"), str(ROOT / "tests" / "helpers"), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"SKIPPED_TO": str(line), "PYTHONPATH": os.pathsep.join(folders)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert line.read_text() == "Skipped 3 of 4 tests, 2 because: no browser; 1 because: no device.\n"
    assert "1 passed, 3 skipped" in done.stdout.splitlines()[-1]
