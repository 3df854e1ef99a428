"""Options from a file are those of the command line, and what is wrong with them is one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from command import refused
from mocobot.cli import parse, with_config

TOML = """
[diagnose]
out = "verdict"
exclude = ["drag", "push"]
jobs = 3
closed_loop = false
strict = true
force = false
[simulate]
effect = ["drag:coefficient=1", "sea_bias:robot=1,joint=1,bias=0.1"]
out-dir = "trials"
vias = 4
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(TOML)
    return path


def parsed(*words: object):
    return parse(with_config([str(word) for word in words]).words)


def test_a_file_says_what_the_command_line_would(file):
    assert parsed("diagnose", "a.parquet", "b.parquet", "--config", file) == parsed(
        "diagnose", "a.parquet", "b.parquet", "--out", "verdict", "--exclude", "drag", "push", "--jobs", 3,
        "--no-closed-loop", "--strict",
    )  # fmt: skip
    simulate = parsed("simulate", f"--config={file}", "--trials", "random")
    assert simulate.effects == ("drag:coefficient=1", "sea_bias:robot=1,joint=1,bias=0.1")
    assert (simulate.out, simulate.vias) == (Path("trials"), 4)


def test_the_command_line_goes_before_the_file(file):
    options = parsed(
        "diagnose", "a.parquet", "--config", file, "--jobs=1", "--closed-loop", "--exclude", "slosh"
    )
    assert (options.jobs, options.closed_loop, options.exclude) == (1, True, ("slosh",))
    assert options.strict


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[diagnoes]\n", "there is no command 'diagnoes'; did you mean 'diagnose'?"),
        ("jobs = 2\n", "there is no command 'jobs'; its tables are named after commands"),
        ("[diagnose]\njbos = 2\n", "[diagnose] has no option 'jbos'; did you mean 'jobs'?"),
        ("[diagnose]\nrec = ['a']\n", "[diagnose] has no option 'rec'"),
        (
            "[diagnose]\njobs = true\n",
            "[diagnose] jobs is true; it is not an option that is switched on or off",
        ),
        ("[diagnose]\njobs = 'many'\n", "mine.toml: [diagnose] --jobs is 'many'; it must be a whole number"),
        ("[diagnose]\nodds = -3\n", "mine.toml: [diagnose] --odds is -3; it must be greater than 0"),
        ("[diagnose]\nexclude = [['drag']]\n", "it must be a value, or a list of values"),
        ("[diagnose\n", "mine.toml"),
    ],
)
def test_refusals(file, capsys, text, said):
    file.write_text(text)
    assert said in refused(capsys, "diagnose", "a.parquet", "--config", file)


def test_what_the_command_line_says_is_not_said_of_the_file(file, capsys):
    file.write_text("[diagnose]\njobs = 2\nodds = 0.1\n")
    said = refused(capsys, "diagnose", "a.parquet", "--config", file, "--odds", "-3")
    assert said == "mocobot: --odds is -3; it must be greater than 0 and at most 1000"
    assert "mine.toml" not in said


def test_a_file_that_is_not_there(capsys, tmp_path):
    assert "none.toml" in refused(capsys, "diagnose", "a.parquet", "--config", tmp_path / "none.toml")
    assert "needs a file" in refused(capsys, "diagnose", "a.parquet", "--config")
    assert "given twice" in refused(capsys, "diagnose", "a.parquet", "--config", "a", "--config=b")
