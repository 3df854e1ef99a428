"""The command line as a user meets it: words, files of options, what it says, and its exit codes."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import mocobot
from command import refused, run
from estimator.files import LIST
from estimator.recording.parquet import write_recording
from mocobot.cli import TASKS, main, parse, with_config
from recordings import small_recording

Edit = Callable[[pa.Table], pa.Table]


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    """A short random trial, written by the command itself."""
    path = tmp_path_factory.mktemp("cli") / "rec.parquet"
    main(["simulate", "--payload", "b", "--vias", "8", "--seed", "3", "--out", str(path)])
    return path


def column(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Edit:
    """Edit one column."""

    def edit(table: pa.Table) -> pa.Table:
        values = pa.array(change(table.column(name).to_numpy().copy()))
        return table.set_column(table.column_names.index(name), name, values)

    return edit


def columns(names: list[str], change: Callable[[np.ndarray], np.ndarray]) -> Edit:
    """Edit several columns alike."""

    def edit(table: pa.Table) -> pa.Table:
        for name in names:
            table = column(name, change)(table)
        return table

    return edit


def exchange(pairs: list[tuple[str, str]]) -> Edit:
    """Exchange the contents of columns."""

    def edit(table: pa.Table) -> pa.Table:
        names = list(table.column_names)
        for a, b in pairs:
            i, j = names.index(a), names.index(b)
            names[i], names[j] = names[j], names[i]
        return table.rename_columns(names).replace_schema_metadata(table.schema.metadata)

    return edit


def with_value(row: int, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(values: np.ndarray) -> np.ndarray:
        values[row] = value
        return values

    return change


THETA = [f"omnid{i}.theta_{axis}" for i in (1, 2, 3) for axis in "zyx"]
PHI = [f"omnid{i}.phi{k}" for i in (1, 2, 3) for k in (1, 2, 3)]
TAU = [f"omnid{i}.tau{k}" for i in (1, 2, 3) for k in (1, 2, 3)]


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda t: t.drop_columns(["omnid2.tau1"]), ["missing column", "omnid2.tau1"]),
        (column("omnid1.phi2", with_value(500, np.nan)), ["omnid1.phi2", "nan", "row 500"]),
        (column("omnid3.tau2", with_value(7, np.inf)), ["omnid3.tau2", "inf", "row 7"]),
        (column("time", with_value(300, 1.0)), ["time goes back", "row 300"]),
        (lambda t: pa.concat_tables([t.slice(0, 200), t.slice(199)]), ["time repeats", "row 200"]),
        (lambda t: pa.concat_tables([t.slice(0, 400), t.slice(450)]), ["gap", "row 400", "0.51 s"]),
        (columns(PHI + THETA, np.rad2deg), ["degrees", "range"]),
        (columns(THETA, lambda v: 10.0 * np.rad2deg(v)), ["omnid", "theta", "range"]),
        (lambda t: t.slice(0, 0), ["no rows"]),
        (lambda t: t.slice(0, 100), ["samples", "too few"]),
        (
            lambda t: t.replace_schema_metadata({}).rename_columns([f"my {n}" for n in t.column_names]),
            ["missing column 'omnid1.phi1'", "No map was given", "`mocobot map "],
        ),
        (
            exchange([(f"omnid1.{c}", f"omnid2.{c}") for c in ("phi1", "phi2", "phi3")]),
            ["robots 1 and 2", "rigid body"],
        ),
    ],
)
def test_bad_recording_is_refused(recording, tmp_path, capsys, edit, words):
    bad, out = tmp_path / "bad.parquet", tmp_path / "est.json"
    pq.write_table(edit(pq.read_table(recording)), bad)
    message = refused(capsys, "estimate", str(bad), "--out", str(out))
    for word in ["bad.parquet", *words]:
        assert word in message
    assert not out.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["bad.parquet"]


def test_exchanged_robots_in_one_of_two_recordings(recording, tmp_path, capsys):
    bad = tmp_path / "swapped.parquet"
    suffixes = [
        name.split(".")[1] for name in pq.read_table(recording).column_names if name.startswith("omnid1.")
    ]
    pq.write_table(
        exchange([(f"omnid1.{c}", f"omnid2.{c}") for c in suffixes])(pq.read_table(recording)), bad
    )
    message = refused(capsys, "estimate", str(recording), str(bad))
    assert "disagree" in message
    assert "robots 1 and 2" in message


def test_torques_of_two_robots_exchanged_are_flagged(recording, tmp_path, capsys):
    bad = tmp_path / "tau.parquet"
    pq.write_table(
        exchange([(f"omnid2.tau{k}", f"omnid3.tau{k}") for k in (1, 2, 3)])(pq.read_table(recording)), bad
    )
    code, out, err = run(capsys, "estimate", str(bad), "--strict")
    assert code == 1
    assert err.startswith("mocobot: the estimate is flagged: ")
    assert "p_1c:         not determined" in out
    assert "the wrenches contradict each other" in out
    assert "check the signs and columns of the torques" in out


def test_no_motion_gives_no_number(recording, tmp_path, capsys):
    """Every channel at its first value but for a little noise: a hold, so the mass is known, and nothing else."""
    still, out = tmp_path / "still.parquet", tmp_path / "est.json"
    hold = columns(PHI + THETA, lambda v: np.full_like(v, v[0]))(pq.read_table(recording))
    pq.write_table(columns(TAU, lambda v: v[0] + 1e-6 * np.cos(np.arange(len(v))))(hold), still)
    code, text, _ = run(capsys, "estimate", str(still), "--out", str(out))
    estimate = json.loads(out.read_text())
    assert code == 0
    assert estimate["grasps"] is None
    assert estimate["com"] is None
    assert estimate["inertia"] is None
    assert estimate["mass"]["m_kg"] == pytest.approx(11.672, rel=0.02)
    assert len(estimate["undetermined"]) >= 6
    assert "[[Not determined]]" in text


def test_estimate_of_a_simulated_trial(recording, tmp_path, capsys):
    out = tmp_path / "est.json"
    code, text, _ = run(capsys, "estimate", str(recording), "--out", str(out), "--strict")
    estimate = json.loads(out.read_text())
    truth = json.loads(recording.with_suffix(".truth.json").read_text())
    assert code == 0
    assert estimate["method"] == "fit"
    assert estimate["mass"]["m_kg"] == pytest.approx(truth["mass_kg"], rel=2e-3)
    assert estimate["com"]["p_1c_m"] == pytest.approx(truth["p_1c_m"], abs=2e-3)
    assert estimate["inertia"]["principal_kgm2"] == pytest.approx(truth["principal_inertia_kgm2"], rel=0.02)
    assert "[[Mass and centre of mass" in text


def test_json_for_machines_and_pictures_on_demand(recording, tmp_path, capsys):
    out, values = tmp_path / "est", tmp_path / "est.json"
    assert run(capsys, "estimate", recording, "--json", values, "--out", out, "--pictures")[0] == 0
    assert {path.name for path in out.iterdir()} == {LIST, "estimate.json", "report.txt", "team.png"}
    assert (out / "estimate.json").read_bytes() == values.read_bytes()
    assert mocobot.report(out) == out / "report.html"
    assert "pictures needs --out" in refused(capsys, "estimate", recording, "--pictures")


def test_same_seed_same_bytes_in_place_of_others(recording, tmp_path):
    """Into folders that are made, and over a file only if asked (refusals: test_first_trial)."""
    path = tmp_path / "new" / "folder" / "rec.parquet"
    for seed, force in (("4", ()), ("3", ("--force",))):
        main(["simulate", "--payload", "b", "--vias", "8", "--seed", seed, "--out", str(path), *force])
        assert (path.read_bytes() == recording.read_bytes()) is (seed == "3")
    truth = path.with_suffix(".truth.json")
    assert truth.read_bytes() == recording.with_suffix(".truth.json").read_bytes()
    assert sorted(path.parent.iterdir()) == [path, truth]


COMMANDS = ("paper", "estimate", "diagnose", "simulate", "convert", "inspect", "replay", "report")


def test_help_lists_commands_by_task_with_examples_that_can_be_read():
    """And needs no numpy: test_api."""
    done = subprocess.run(
        [sys.executable, "-m", "mocobot", "--help"], capture_output=True, text=True, check=True
    )
    assert "usage: mocobot" in done.stdout
    assert done.stderr == ""
    words = " ".join(done.stdout.split())
    for task, (commands, example) in TASKS.items():
        assert f"{task}:" in done.stdout
        assert all(f"\n  {name} " in done.stdout for name in commands)
        assert f"$ {example}" in words
        parsed(*example.split()[1:])


@pytest.mark.parametrize("arguments", [("--version",), ("estimate", "--version")])
def test_version(capsys, arguments):
    written = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]["version"]
    assert run(capsys, *arguments) == (0, f"mocobot {written}\n", "")


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command(capsys, name):
    code, out, err = run(capsys, name, "--help")
    assert (code, err) == (0, "")
    assert f"usage: mocobot {name}" in out


@pytest.mark.parametrize("terminal", [True, False])
def test_a_simulation_shows_how_much_there_is(tmp_path, monkeypatch, capsys, terminal):
    """On standard error, on terminals only."""

    class Screen(io.StringIO):
        def isatty(self) -> bool:
            return terminal

    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    main(["simulate", "--vias", "1", "--out", str(tmp_path / "rec.parquet")])
    assert "s of random motion" in capsys.readouterr().out
    shown = screen.getvalue()
    if terminal:
        (seconds,) = set(re.findall(r"random trial: +\d+%\|.*?\| [\d.]+ of ([\d.]+) s \[", shown))
        assert float(seconds) == len(pq.read_table(tmp_path / "rec.parquet")) / 100.0
    else:
        assert shown == ""


def test_a_pool_that_renews_its_workers_says_nothing(capsys, monkeypatch):
    """On a busy machine joblib warns of workers that idled; any other warning is still one."""
    told = "A worker stopped while some jobs were given to the executor. This can be caused by a too short timeout."
    monkeypatch.setattr(
        "mocobot.cli._command", lambda name: lambda options: warnings.warn(told, stacklevel=1)
    )
    main(["effects"])
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(
        "mocobot.cli._command", lambda name: lambda options: warnings.warn("odd", stacklevel=1)
    )
    with pytest.raises(UserWarning, match="odd"):
        main(["effects"])


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
def file(tmp_path) -> Path:
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


def test_earlier_spellings_are_taken(capsys):
    for earlier, now in (
        (
            "simulate --duration 9 --out-dir a --trials static",
            "simulate --duration-s 9 --out a --trials static",
        ),
        ("replay a --save b.rrd", "replay a --out b.rrd"),
        ("convert a --rate 50 b --max-gap=1", "convert a --rate-hz=50 b --max_gap_s 1"),
        ("convert --out b a --force", "convert a b --force"),
    ):
        assert parsed(*earlier.split()) == parsed(*now.split())
    said = refused(capsys, "replay", "a", "--save", "b.rrd", "--out", "c.rrd")
    assert "--save and --out are two names of one option; give one of them" in said
    assert "--duration is for a periodic" in refused(
        capsys, "simulate", "--duration", 9, "--out", "a.parquet"
    )


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
def test_a_file_of_options_is_refused(file, capsys, text, said):
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


@pytest.fixture
def brief(tmp_path) -> Path:
    """A recording too short for anything."""
    path = tmp_path / "brief.parquet"
    write_recording(small_recording(rows=150), path)
    return path


def test_a_log_that_is_ready_for_nothing(brief, capsys):
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
def test_a_verdict(brief, capsys, monkeypatch, verdict, strict):
    class Found(SimpleNamespace):
        def __str__(self) -> str:
            return "what was found"

    found = Found(to_dict=lambda: {"verdict": verdict, "causes": [], "finished": True})
    monkeypatch.setattr("mocobot.api.diagnosis.diagnose_team", lambda *_, **__: found)
    code, out, err = run(capsys, "diagnose", brief)
    assert (code, out.partition("\n")[0], err) == (0, "what was found", "")
    said = f"mocobot: the verdict is {verdict.replace('_', ' ')}" if strict else ""
    assert run(capsys, "diagnose", brief, "--strict") == (strict, out, said)


def test_an_estimate_that_says_nothing(brief, capsys, monkeypatch):
    """Flagged ones: test_cli."""
    nothing = SimpleNamespace(flags=(), mass=None, grasps=None)
    monkeypatch.setattr("mocobot.estimate", lambda *_, **__: nothing)
    assert run(capsys, "estimate", brief)[0] == 0
    code, _, err = run(capsys, "estimate", brief, "--strict")
    assert (code, err) == (1, "mocobot: the recordings determine neither mass nor grasps")


def test_a_full_disk_for_what_is_printed():
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
