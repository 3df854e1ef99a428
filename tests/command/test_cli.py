"""The command line as a user meets it: what it writes, what it says, and its exit code on bad input."""

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

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from command import refused, run
from mocobot.cli import main

Edit = Callable[[pa.Table], pa.Table]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
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
def test_bad_recording_is_refused(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], edit: Edit, words: list[str]
) -> None:
    bad, out = tmp_path / "bad.parquet", tmp_path / "est.json"
    pq.write_table(edit(pq.read_table(recording)), bad)
    message = refused(capsys, "estimate", str(bad), "--out", str(out))
    for word in ["bad.parquet", *words]:
        assert word in message
    assert not out.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["bad.parquet"]


def test_exchanged_robots_in_one_of_two_recordings(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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


def test_torques_of_two_robots_exchanged_are_flagged(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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


def test_no_motion_gives_no_number(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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


def test_estimate_of_a_simulated_trial(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
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


def test_same_seed_same_bytes_in_place_of_others(recording: Path, tmp_path: Path) -> None:
    """Into folders that are made, and over a file only if asked (refusals: test_first_trial)."""
    path = tmp_path / "new" / "folder" / "rec.parquet"
    for seed, force in (("4", ()), ("3", ("--force",))):
        main(["simulate", "--payload", "b", "--vias", "8", "--seed", seed, "--out", str(path), *force])
        assert (path.read_bytes() == recording.read_bytes()) is (seed == "3")
    truth = path.with_suffix(".truth.json")
    assert truth.read_bytes() == recording.with_suffix(".truth.json").read_bytes()
    assert sorted(path.parent.iterdir()) == [path, truth]


COMMANDS = ("paper", "estimate", "diagnose", "simulate", "convert", "inspect", "replay", "report")


def test_help_of_the_installed_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mocobot", "--help"], capture_output=True, text=True, check=True
    )
    assert "usage: mocobot" in done.stdout
    assert all(name in done.stdout for name in COMMANDS)
    assert done.stderr == ""


@pytest.mark.parametrize("arguments", [("--version",), ("estimate", "--version")])
def test_version(capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]) -> None:
    written = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]["version"]
    assert run(capsys, *arguments) == (0, f"mocobot {written}\n", "")


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command(capsys: pytest.CaptureFixture[str], name: str) -> None:
    code, out, err = run(capsys, name, "--help")
    assert (code, err) == (0, "")
    assert f"usage: mocobot {name}" in out


@pytest.mark.parametrize("terminal", [True, False])
def test_a_simulation_shows_how_much_there_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], terminal: bool
) -> None:
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


def test_a_pool_that_renews_its_workers_says_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
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
