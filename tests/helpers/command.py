"""Run the ``mocobot`` command in a test."""

from __future__ import annotations

import pytest

from mocobot.cli import main


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error (without its last line break)."""
    capsys.readouterr()
    try:
        main([str(argument) for argument in arguments])
        code = 0
    except SystemExit as stop:
        code = int(stop.code or 0)
    out, err = capsys.readouterr()
    return code, out, err.removesuffix("\n")


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one sentence on standard error of a command that must exit with 2 and print nothing else."""
    code, out, err = run(capsys, *arguments)
    assert code == 2, (out, err)
    assert out == ""
    assert err.startswith("mocobot: ")
    assert err.isprintable(), err  # one line, no control characters
    assert "Traceback" not in err
    return err
