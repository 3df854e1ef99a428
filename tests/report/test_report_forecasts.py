"""The page, the pictures and the text of a calibration from positions and commands alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from command import refused, run
from discrepancy.joints.calibrated import WIDTH, from_dict, to_dict, to_text
from made_leg import MAP, write_leg
from mocobot_report.plots_calibration import save_left
from test_report_page import MOST_BYTES, Reader

JOINTS = ("hip", "knee")


@pytest.fixture(scope="module")
def leg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with model, map, log and the calibration ``cal``."""
    from mocobot.cli import main

    folder = write_leg(tmp_path_factory.mktemp("leg"), 12.0, 100.0)
    words = (
        "calibrate",
        folder / "log.csv",
        "--model",
        folder / "leg.xml",
        "--out",
        folder / "cal",
        "--pictures",
    )
    main([str(word) for word in words])
    return folder


@pytest.fixture(scope="module")
def values(leg: Path) -> dict[str, Any]:
    return json.loads((leg / "cal" / "calibration.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def page(leg: Path) -> Reader:
    from mocobot.cli import main

    main(["report", str(leg / "cal"), "--out", str(leg / "page.html")])
    return Reader((leg / "page.html").read_bytes())


def test_forecasts_are_of_the_log(leg: Path, values: dict[str, Any]) -> None:
    """Command and measured position are the log's, and errors over all of it are those of the table."""
    log = np.genfromtxt(leg / "log.csv", delimiter=",", names=True)
    told = values["forecasts"]
    rows = np.searchsorted(log["t"], np.array(told["time_s"]) - 1e-6)
    assert 50 < len(rows) <= 300
    for joint in JOINTS:
        own = told["joints"][joint]
        np.testing.assert_allclose(own["measured"], log[f"{joint}_q"][rows], atol=1e-6)
        np.testing.assert_allclose(own["command"], log[f"{joint}_command"][rows], atol=1e-6)
        errors = {name: np.std(np.subtract(own[name], own["measured"])) for name in ("model", "calibrated")}
        assert errors["calibrated"] < 0.5 * errors["model"]
        response = {name: np.array(own["response"][name]) for name in own["response"]}
        slow = response["frequency_Hz"] < 0.6
        assert slow.any()
        np.testing.assert_allclose(response["measured"][slow], 1.0, atol=0.15)
        off = {n: np.mean(np.abs(response[n] - response["measured"])) for n in errors}
        assert off["calibrated"] < off["model"]


def test_the_file_holds_all_that_the_text_says(leg: Path, values: dict[str, Any]) -> None:
    told = from_dict(values, "calibration.json")
    assert to_dict(told.found) == {key: value for key, value in values.items() if key != "provenance"}
    text = (leg / "cal" / "report.txt").read_text(encoding="utf-8")
    assert to_text(told.found) + "\n" == text
    assert max(map(len, text.splitlines())) <= WIDTH


def test_the_page_speaks_of_forecasts(leg: Path, values: dict[str, Any], page: Reader) -> None:
    text = page.rows()
    assert "forecast error, calibrated" in text
    assert "torque left" not in text
    assert "least squares" not in text
    left, *others = page.blocks.values()
    shown = {trace["name"]: trace["x"] for trace in left["data"]}
    assert set(shown) == {"given model", "calibrated", "noise"}
    assert left["layout"]["yaxis"]["ticktext"] == [f"{joint} [mrad]" for joint in JOINTS]
    for side, key in (("given model", "model"), ("calibrated", "calibrated"), ("noise", "noise")):
        np.testing.assert_allclose(shown[side], [1e3 * values["held_out"][joint][key] for joint in JOINTS])
    assert len(others) == 2 * len(JOINTS)
    for over_time, response in zip(others[::2], others[1::2], strict=True):
        assert [trace["name"] for trace in over_time["data"]] == [
            "command", "measured", "given model", "calibrated", "given model", "calibrated",
        ]  # fmt: skip
        assert [trace["name"] for trace in response["data"]] == ["measured", "given model", "calibrated"]
    assert (leg / "page.html").stat().st_size < MOST_BYTES


@pytest.mark.pictures
def test_the_picture_is_of_forecasts(values: dict[str, Any], tmp_path: Path) -> None:
    save_left(from_dict(values, "calibration.json"), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["forecasts.png"]
    with Image.open(tmp_path / "forecasts.png") as picture:
        colours = picture.convert("RGB").getcolors(1 << 20)
    assert colours is not None
    assert len(colours) > 20  # marks and text, not a blank page


def test_two_of_them_compare(leg: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "compare", leg / "cal", leg / "cal", "--strict")[0] == 0


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda f: f["joints"]["hip"]["measured"].pop(), "forecasts: joints: hip: measured is"),
        (lambda f: f["joints"]["hip"]["model"].__setitem__(0, "1"), "a list of finite numbers and null"),
        (lambda f: f["joints"].pop("knee"), "forecasts: joints: missing key 'knee'"),
    ],
)
def test_a_damaged_file_is_refused(values, tmp_path, capsys, change, why) -> None:
    damaged = json.loads(json.dumps(values))
    change(damaged["forecasts"])
    (tmp_path / "calibration.json").write_text(json.dumps(damaged), encoding="utf-8")
    assert why in refused(capsys, "report", tmp_path)


def test_gains_that_are_free_or_rough_are_told_plainly(
    leg: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rough = MAP.replace("velocity_gain = 1.5", 'velocity_gain = "free"\ngain_known_within = 2')
    (tmp_path / "log.toml").write_text(rough, encoding="utf-8")
    code, out, err = run(
        capsys, "calibrate", leg / "log.csv", "--model", leg / "leg.xml", "--map", tmp_path / "log.toml"
    )
    assert code == 0, err
    said = " ".join(out.split())
    assert "The velocity gains are free, so they count as viscous friction." in said
    assert "The gains are known within a factor of 2, and so are these torques." in said
    assert "position gain" in said
    assert "The mean torque gain is held at 1" not in said
