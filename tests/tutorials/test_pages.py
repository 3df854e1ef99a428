"""The pages to type along: their commands run as they stand there, print what is shown, and are right."""

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
PAGE, BAGS = (ROOT / "docs" / "tutorials" / name for name in ("arm.md", "paper_bag.md"))
BLOCK = re.compile(r"^```console\n\$ (.+)\n((?:.*\n)*?)```$", re.MULTILINE)
MOST_COMMANDS = 10


def shown(page: Path) -> list[tuple[list[str], list[str]]]:
    """Words of each command of a page, and the lines that it prints there."""
    text = page.read_text(encoding="utf-8")
    found = [(shlex.split(command), output.splitlines()) for command, output in BLOCK.findall(text)]
    assert len(found) == text.count("\n$ ")
    return found


def outputs(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What each command prints in a folder, which has to be what the page shows; none for one that installs."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "src"))
    out = []
    for words, lines in shown(page):
        if words[0] == "pip":
            continue
        line = {"mocobot": [sys.executable, "-m"], "python": [sys.executable]}.get(words[0], [])
        line += words[words[0] == "python" :]
        done = subprocess.run(line, cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, (words, done.stderr)
        out.append(done.stdout + done.stderr)
        printed = iter([in_words(line) for line in out[-1].splitlines()])
        for line in lines:  # in this order; "..." stands for any lines
            assert line == "..." or in_words(line) in printed, (words, line, out[-1])
    return out


def test_a_newcomer_types_few_commands():
    assert 5 < len(shown(PAGE)) <= MOST_COMMANDS


@pytest.mark.slow
def test_the_page_tells_the_truth(tmp_path, monkeypatch):
    said = outputs(PAGE, tmp_path, monkeypatch)
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


@pytest.mark.slow
def test_bags_come_to_table_v(tmp_path, monkeypatch):
    script = re.findall(r"```python\n(.*?)```", BAGS.read_text(encoding="utf-8"), re.DOTALL)[0]
    (tmp_path / "errors.py").write_text(script, encoding="utf-8")
    said = outputs(BAGS, tmp_path, monkeypatch)
    errors = next(out for out in said if "true, error" in out)
    percent = [float(x) for x in re.findall(r"error +(-?[\d.]+) %", errors)]
    assert len(percent) == 7
    assert max(map(abs, percent)) < 0.5
    own = re.findall(r"I[xyz]{2} \[%\] +[\d.]+ \+- [\d.]+ +([\d.]+) \+-", said[-1])
    assert len(own) == 3
    assert max(map(float, own)) < 0.3
