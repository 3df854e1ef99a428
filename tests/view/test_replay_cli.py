"""``mocobot replay`` as a user meets it: what it writes, what it says, and bad input in one sentence."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import command
from diagnosed import small_diagnosis
from mocobot.cli import main
from replay_case import Replayed

Change = Callable[[dict[str, Any]], object]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording with its truth, and an estimate of it."""
    folder = tmp_path_factory.mktemp("replay")
    main(["simulate", "--vias", "6", "--seed", "3", "--out", str(folder / "rec.parquet")])
    main(["estimate", str(folder / "rec.parquet"), "--out", str(folder / "est.json")])
    return folder


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "RERUN"):
        monkeypatch.delenv(name, raising=False)


def replay(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    return command.run(capsys, "replay", *arguments)


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    return command.refused(capsys, "replay", *arguments)


def diagnosis(folder: Path, change: Change = lambda values: None) -> Path:
    folder.mkdir()
    values = small_diagnosis()
    change(values)
    (folder / "diagnosis.json").write_text(json.dumps(values), encoding="utf-8")
    return folder


def test_everything_at_once(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "out.rrd"
    told = diagnosis(tmp_path / "verdict")
    code, out, err = replay(
        capsys, folder / "rec.parquet", "--estimate", folder / "est.json", "--truth", "--diagnosis", told,
        "--payload", "a", "--save", target,
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert "The diagnosis was made from other recordings (one, two), not from this one." in out
    assert f"{target}: " in out
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["out.rrd", "verdict"]
    file = Replayed(target)
    entities = file.entities()
    assert {"rec/payload/estimate/inertia", "rec/payload/truth/com", "rec/payload/shape"} <= entities
    assert file.texts("rec/omnid2/base/leg1/proximal/cause/name", "Points3D:labels") == ["! sea_bias"]
    (text,) = file.texts("rec/summary", "TextDocument:text")
    assert "**Diagnosis: Explained.**" in text
    assert "- **sea\\_bias**: Robot 2, joint 1: the torque sensor reads" in text


def test_several_recordings_side_by_side(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also of the same name, each with its own root, on one timeline."""
    (tmp_path / "rec.parquet").write_bytes((folder / "rec.parquet").read_bytes())
    code, _, err = replay(
        capsys, folder / "rec.parquet", tmp_path / "rec.parquet", "--save", tmp_path / "two.rrd"
    )
    assert (code, err) == (0, "")
    file = Replayed(tmp_path / "two.rrd")
    first, second = (file.column(f"{name}/series/phi", "Scalars:scalars") for name in ("rec", "rec-2"))
    assert len(first[0]) > 500
    assert (first[0] == second[0]).all()
    assert (first[1] == second[1]).all()
    assert {name.split("/")[0] for name in file.entities()} == {"rec", "rec-2", "__properties"}


def test_existing_targets_are_replaced_whole(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A truncated file of an earlier run is no obstacle; a run that fails leaves what is there."""
    target = tmp_path / "out.rrd"
    assert replay(capsys, folder / "rec.parquet", "--save", target)[0] == 0
    whole = target.read_bytes()
    target.write_bytes(whole[: len(whole) // 2])
    assert "exists; give --force" in refused(capsys, folder / "rec.parquet", "--save", target)
    assert replay(capsys, folder / "rec.parquet", "--save", target, "--force")[0] == 0
    assert len(Replayed(target).entities()) > 50

    def broken(stream: Any, **_: object) -> None:
        stream.log("half", __import__("rerun").TextLog("of it"))
        raise OSError(28, "No space left on device")

    before = target.read_bytes()
    monkeypatch.setattr("mocobot_view.stream.log_replay", broken)
    message = refused(capsys, folder / "rec.parquet", "--save", target, "--force")
    assert f"{target}: cannot be written (No space left on device)" in message
    assert target.read_bytes() == before
    assert list(tmp_path.iterdir()) == [target]


def test_without_rerun(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = folder / "rec.parquet", "--save", tmp_path / "out.rrd"
    monkeypatch.setattr("rerun.__version__", "0.40.2")
    assert "needs the Rerun SDK 0.41; this is 0.40.2" in refused(capsys, *command)
    monkeypatch.setitem(sys.modules, "rerun", None)
    message = refused(capsys, *command)
    assert "is not installed" in message
    assert "pip install 'mocobot[replay]'" in message


def drop(*keys: str) -> Change:
    def change(values: dict[str, Any]) -> None:
        for key in keys[:-1]:
            values = values[key]
        del values[keys[-1]]

    return change


def put(value: object, *keys: Any) -> Change:
    def change(values: Any) -> None:
        for key in keys[:-1]:
            values = values[key]
        values[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (drop("mass"), "not a complete estimate (KeyError: 'mass')"),
        (drop("grasps", "pairs"), "KeyError: 'pairs'"),
        (drop("com", "covariance_m2"), "KeyError: 'covariance_m2'"),
        (put("other", "format"), "must have format 'mocobot-estimate'"),
        (put(2, "robots"), "not a complete estimate (IndexError"),
        (put(0, "robots"), "IndexError: index 1 is out of bounds for axis 0 with size 0"),
        (put("three", "robots"), "invalid literal for int() with base 10: 'three'"),
        (put(4, "robots"), "cannot reshape"),
        (put([1.0, 2.0], "com", "p_1c_m"), "com.p_1c_m must hold 3 finite numbers"),
        (put("heavy", "mass", "m_kg"), "mass.m_kg must hold a finite number"),
        (put([1.0, None, 2.0], "inertia", "principal_kgm2"), "inertia.principal_kgm2 must hold 3"),
        (put(["a", 0.0, 0.0], "grasps", "pairs", 0, "p_m"), "not a complete estimate (ValueError"),
        (put([[1.0]], "grasps", "angular_residual_radps"), "grasps.angular_residual_radps must hold 3 x 3"),
    ],
)
def test_bad_estimates(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: Change, words: str
) -> None:
    values = json.loads((folder / "est.json").read_text(encoding="utf-8"))
    change(values)
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps(values), encoding="utf-8")
    message = refused(capsys, folder / "rec.parquet", "--estimate", bad, "--save", tmp_path / "out.rrd")
    assert message.startswith(f"mocobot: {bad}: ")
    assert words in message


@pytest.mark.parametrize(("content", "words"), [
    (None, "there is no such file; it would be an estimate"),
    ("", "not valid JSON"),
    ("[1, 2]", "must be a JSON object"),
    ("\x80", "not valid JSON"),
])  # fmt: skip
def test_files_that_are_no_estimate(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str | None, words: str
) -> None:
    if content is not None:
        (tmp_path / "bad.json").write_bytes(content.encode("latin-1"))
    command = folder / "rec.parquet", "--estimate", tmp_path / "bad.json", "--save", tmp_path / "out.rrd"
    assert words in refused(capsys, *command)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (None, "there is no such file"),
        (put([], "grasps"), "has 0 grasps"),
        (drop("mass_kg"), "missing key 'mass_kg'"),
        (put([0.0, "x", 0.0], "p_1c_m"), "p_1c_m is [0.0, 'x', 0.0]; it must be 3 finite numbers"),
        (
            put([0.0, 0.0], "grasps", 1, "p_1i_m"),
            "grasps[1]: p_1i_m is [0.0, 0.0]; it must be 3 finite numbers",
        ),
        (put(float("inf"), "mass_kg"), "not valid JSON (Infinity is not a JSON number)"),
        (put(10**301, "mass_kg"), "it must be a finite number"),
    ],
)
def test_bad_truth(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: Change | None, words: str
) -> None:
    rec = tmp_path / "rec.parquet"
    rec.write_bytes((folder / "rec.parquet").read_bytes())
    if change is not None:
        values = json.loads((folder / "rec.truth.json").read_text(encoding="utf-8"))
        change(values)
        (tmp_path / "rec.truth.json").write_text(json.dumps(values), encoding="utf-8")
    message = refused(capsys, rec, "--truth", "--save", tmp_path / "out.rrd")
    assert str(tmp_path / "rec.truth.json") in message
    assert words in message


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (put("estimate", "format"), "not a diagnosis"),
        (
            put("maybe", "verdict"),
            "verdict is 'maybe'; it must be one of consistent, miscalibrated, explained",
        ),
        (drop("causes"), "not a complete diagnosis (KeyError: 'causes')"),
        (put({}, "causes", 0), "not a complete diagnosis (KeyError: 'cause')"),
        (put(4, "causes", 0, "joint"), "joint is 4"),
        (put(-1, "causes", 0, "robot"), "robot is -1"),
        (put(7, "causes", 0, "robot"), "the diagnosis names robot 7"),
    ],
)
def test_bad_diagnoses(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: Change, words: str
) -> None:
    told = diagnosis(tmp_path / "verdict", change)
    command = folder / "rec.parquet", "--diagnosis", told, "--save", tmp_path / "out.rrd"
    assert words in refused(capsys, *command)
