"""Exit codes: what scripts go by."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from command import run
from estimator.recording.parquet import write_recording
from recordings import small_recording


@pytest.fixture
def brief(tmp_path: Path) -> Path:
    """A recording too short for anything."""
    path = tmp_path / "brief.parquet"
    write_recording(small_recording(rows=150), path)
    return path


def test_a_log_that_is_ready_for_nothing(brief: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "inspect", brief)
    assert (code, err) == (0, "")
    code, again, err = run(capsys, "inspect", brief, "--strict")
    assert (code, again) == (1, out)
    assert err == f"mocobot: {out.splitlines()[-1]}"
    assert "ready for: nothing (" in err


@pytest.mark.parametrize(
    ("verdict", "strict"),
    [("consistent", 0), ("miscalibrated", 1), ("explained", 0), ("partly_explained", 1), ("unexplained", 1)],
)
def test_a_verdict(
    brief: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    verdict: str,
    strict: int,
) -> None:
    class Found(SimpleNamespace):
        def __str__(self) -> str:
            return "what was found"

    found = Found(to_dict=lambda: {"verdict": verdict})
    monkeypatch.setattr("mocobot.api.diagnosis.diagnose_team", lambda *_, **__: found)
    assert run(capsys, "diagnose", brief) == (0, "what was found\n", "")
    said = f"mocobot: the verdict is {verdict.replace('_', ' ')}" if strict else ""
    assert run(capsys, "diagnose", brief, "--strict") == (strict, "what was found\n", said)


def test_an_estimate_that_says_nothing(
    brief: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Flagged ones: test_cli."""
    nothing = SimpleNamespace(flags=(), mass=None, grasps=None)
    monkeypatch.setattr("mocobot.estimate", lambda *_, **__: nothing)
    assert run(capsys, "estimate", brief)[0] == 0
    code, _, err = run(capsys, "estimate", brief, "--strict")
    assert (code, err) == (1, "mocobot: the recordings determine neither mass nor grasps")


def test_a_full_disk_for_what_is_printed() -> None:
    """Interruptions: test_diagnose_cli; closed pipes: test_hostile_input."""
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "mocobot", "--help"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr == "mocobot: standard output: cannot be written (No space left on device)\n"
