"""``mocobot diagnose`` on bad input: one sentence, exit code 2, nothing written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from diagnose_run import (
    Edit,
    changed,
    of_longer_links,
    refused,
    unlabelled_and_heavier,
    with_metadata,
    with_nan,
    without_robots,
)


def still(v: np.ndarray) -> np.ndarray:
    """A channel at its first value, with enough noise that no row repeats another."""
    return v[0] + 1e-6 * np.cos(np.arange(len(v)))


@pytest.mark.parametrize(
    ("name", "edit", "words"),
    [
        ("nan.parquet", changed("omnid1.phi2", with_nan), ["nan.parquet", "omnid1.phi2", "row 500"]),
        (
            "gap.parquet",
            lambda t: pa.concat_tables([t.slice(0, 400), t.slice(450)]),
            ["gap.parquet", "gap", "row 400"],
        ),
        ("deg.parquet", changed(".theta", np.rad2deg), ["deg.parquet", "degrees"]),
        ("column.parquet", lambda t: t.drop_columns(["omnid2.tau1"]), ["missing column 'omnid2.tau1'"]),
        ("two.parquet", without_robots(2), ["two.parquet", "is a robot missing"]),
        ("one.parquet", without_robots(1), ["one.parquet has one robot"]),
        ("still.parquet", changed("omnid", still), ["do not determine the grasps"]),
        ("short.parquet", lambda t: t.slice(0, 100), ["short.parquet", "0.0 s are left"]),
        ("brief.parquet", lambda t: t.slice(0, 600), ["brief.parquet", "2.0 s are left", "at least 5 s"]),
    ],
)
def test_bad_recording_is_refused(
    edited: Callable[[str, Edit], str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    edit: Edit,
    words: list[str],
) -> None:
    message = refused(capsys, edited(name, edit), "--out", tmp_path / "verdict", "--jobs", 1)
    for word in words:
        assert word in message
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "edit", "words"),
    [
        ("c.parquet", with_metadata(payload="c"), ["'c'", "'b'"]),
        ("heavy.parquet", unlabelled_and_heavier, ["heavy.parquet says 1", "kg", "of one payload"]),
        ("pair.parquet", without_robots(2), ["has 2 robots", "has 3"]),
        ("links.parquet", of_longer_links, ["links.parquet", "different design"]),
    ],
)
def test_recordings_that_do_not_belong_together(
    biased_trials: list[Path],
    edited: Callable[[str, Edit], str],
    capsys: pytest.CaptureFixture[str],
    name: str,
    edit: Edit,
    words: list[str],
) -> None:
    message = refused(capsys, biased_trials[1], edited(name, edit))
    for word in words:
        assert word in message


@pytest.mark.parametrize("odds", ["0", "-1", "1e4"])
def test_odds_that_are_none_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], odds: str
) -> None:
    message = refused(capsys, tmp_path / "none.parquet", "--odds", odds)
    assert f"odds is {float(odds):g}; it must be greater than 0 and at most 1000" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[sea_bias", ["not a readable file of tolerances"]),
        ("[ghost]\na = 1\n", ["unknown table 'ghost'", "sea_bias"]),
        ("[sea_bias]\nbias = 1\n", ["has no 'bias'", "bias_Nm"]),
        ("[sea_bias]\nbias_Nm = -1\n", ["sea_bias.bias_Nm is -1"]),
        ("[sea_bias]\nbias_Nm = 'much'\n", ["'much'"]),
    ],
)
def test_bad_tolerances_are_refused(
    biased_trials: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: list[str]
) -> None:
    path = tmp_path / "tolerances.toml"
    path.write_text(text)
    message = refused(capsys, *biased_trials, "--tolerances", path)
    for word in ["tolerances.toml", *words]:
        assert word in message
