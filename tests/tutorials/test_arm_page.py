"""The page of an arm's first minutes: its commands run as they stand there, print what it shows, and are right."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

from shown_text import in_words

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "tutorials" / "arm.md"
BLOCK = re.compile(r"^```console\n\$ (.+)\n((?:.*\n)*?)```$", re.MULTILINE)
MOST_COMMANDS = 10


def shown() -> list[tuple[list[str], list[str]]]:
    """Words of each command of the page, and the lines that it prints there."""
    text = PAGE.read_text(encoding="utf-8")
    found = [(shlex.split(command), output.splitlines()) for command, output in BLOCK.findall(text)]
    assert len(found) == text.count("\n$ ")
    return found


def outputs(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What each command prints in a folder; the first one installs and is left out."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "src"))
    (install, _), *others = shown()
    assert install[:2] == ["pip", "install"]
    out = []
    for words, _ in others:
        line = [sys.executable, "-m", *words] if words[0] == "mocobot" else words
        done = subprocess.run(line, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, (words, done.stderr)
        out.append(done.stdout + done.stderr)
    return out


def test_a_newcomer_types_few_commands():
    assert 5 < len(shown()) <= MOST_COMMANDS


@pytest.mark.slow
def test_the_page_tells_the_truth(tmp_path, monkeypatch):
    said = outputs(tmp_path, monkeypatch)
    for (words, lines), out in zip(shown()[1:], said, strict=True):
        printed = iter([in_words(line) for line in out.splitlines()])
        for line in lines:  # in this order; "..." stands for any lines
            assert line == "..." or in_words(line) in printed, (words, line, out)
    example = tmp_path / "mocobot-example"
    answer = (example / "answer.txt").read_text(encoding="utf-8")
    true = {log: float(size) for size, log in re.findall(r"([\d.]+) N m in (\w+)", answer)}
    verdict = next(out for out in said if out.startswith("EXPLAINED: one finding"))
    changed = next(out for out in said if "what has changed" in out)
    given = mujoco.MjModel.from_xml_path(str(example / "arm.xml"))
    found = mujoco.MjModel.from_xml_path(str(example / "calibrated" / "as_found.xml"))
    today, before = true["today"], true["last_week"]
    for out, wanted in ((verdict, today - given.joint("elbow").frictionloss[0]), (changed, today - before)):
        assert "by friction in joint 3 (elbow)." in " ".join(out.split())
        size, error = map(float, re.findall(r"Coulomb ([\d.]+) \+- ([\d.]+) N m", out)[0])
        assert abs(size - wanted) < max(4.0 * error, 0.02), (size, error, wanted)
    assert found.joint("elbow").frictionloss[0] == pytest.approx(today, abs=0.1)
    assert found.nv == given.nv == 6
    table = dict(
        re.findall(
            r"^\| (today .*?) \| .*? \| ([\d.]+) N m \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE
        )
    )
    assert float(table["today against last week"]) == pytest.approx(today - before, abs=0.01)
    assert float(table["today against the model"]) == pytest.approx(today - 2.5, abs=0.01)
