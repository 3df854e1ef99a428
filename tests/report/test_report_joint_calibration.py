"""The page of a robot calibrated from joint logs: what it predicts, what the logs determine, and what is refused."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from command import refused, run
from discrepancy.joints.calibrated import from_dict, gain, to_dict, to_text
from made_arm import JOINTS, made, write_log
from test_report_page import Reader

SIDES = {
    "given model": "model",
    "least squares": "least_squares",
    "calibrated": "calibrated",
    "noise": "noise",
}
COULOMB_NM, VISCOUS = (1.5, 2.0, 1.0), (1.0, 1.5, 0.5)
"""Friction of the made arm [N m, N m s/rad]."""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with log, model, map and the calibration ``cal``."""
    folder = tmp_path_factory.mktemp("calibrated")
    log = write_log(folder, made())
    calibrate(folder, log, folder / "cal")
    return folder


def calibrate(folder: Path, log: Path, out: Path, *more: str) -> None:
    from mocobot.cli import main

    words = (
        "calibrate",
        log,
        "--model",
        folder / "arm.xml",
        "--map",
        folder / "log.toml",
        "--out",
        out,
        *more,
    )
    main([str(word) for word in words])


def read(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "calibration.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def page(arm: Path) -> Reader:
    from mocobot.cli import main

    main(["report", str(arm / "cal"), "--out", str(arm / "page.html")])
    return Reader((arm / "page.html").read_bytes())


def test_the_file_holds_all_that_the_text_says(arm: Path) -> None:
    values = read(arm / "cal")
    told = from_dict(values, "calibration.json")
    assert to_dict(told.found) == {key: value for key, value in values.items() if key != "provenance"}
    assert to_text(told.found) + "\n" == (arm / "cal" / "report.txt").read_text(encoding="utf-8")


def test_the_gain_comes_first_and_charts_hold_the_file(arm: Path, page: Reader) -> None:
    values, text = read(arm / "cal"), page.rows()
    first = gain(from_dict(values, "calibration.json").found)
    assert " ".join((arm / "cal" / "report.txt").read_text(encoding="utf-8").split()).startswith(first)
    assert (
        text.index(first) < text.index("torque left, calibrated") < text.rindex("The calibration in detail")
    )
    (chart,) = page.blocks.values()
    assert chart["layout"]["xaxis"]["type"] == "log"
    assert chart["layout"]["yaxis"]["ticktext"] == [f"{joint} [N m]" for joint in JOINTS]
    shown = {trace["name"]: trace["x"] for trace in chart["data"]}
    for side, key in SIDES.items():
        np.testing.assert_allclose(shown[side], [values["held_out"][joint][key] for joint in JOINTS])
    assert "arm.xml" in page.code
    assert "these parameters stay near the given values" in text.lower()
    for note in values["notes"]:
        assert note in text


def test_what_is_determined_is_that_of_the_made_arm(arm: Path, page: Reader) -> None:
    text = page.rows()
    with (arm / "cal" / "parameters.csv").open(encoding="utf-8") as file:
        rows = {(row["place"], row["parameter"]): row for row in csv.DictReader(file)}
    for k, joint in enumerate(JOINTS):
        for words, name, truth in (
            ("Coulomb", "coulomb_Nm", COULOMB_NM[k]),
            ("viscous", "viscous_Nms_per_rad", VISCOUS[k]),
        ):
            row = rows[joint, name]
            assert abs(float(row["found"]) - truth) < 4.0 * float(row["se"])
            label = f"friction of joint {k + 1} ({joint})"
            cells = text.split(f"{words} {label}", 1)[1].split()
            shown = [cell for cell in cells if cell[0].isdigit()][:2]
            assert float(shown[0]) == 0.0
            assert float(shown[1]) == pytest.approx(float(row["found"]), abs=float(row["se"]))
    assert "friction of joint 4" not in text
    assert "Determined in combination only" in text
    assert "mz(upper) + 0.4 m(fore) kg m" in text.replace("\u00a0", " ")


def _without(key: str) -> Callable[[dict], object]:
    return lambda values: values.pop(key)


DAMAGE: dict[str, tuple[Callable[[dict], object], str]] = {
    "no key": (_without("combinations"), "missing key 'combinations'"),
    "unknown key": (lambda v: v.update(more=1), "unknown key 'more'"),
    "later version": (lambda v: v.update(version=2), "version is 2; it must be 1"),
    "no joints": (lambda v: v.update(held_out={}), "held_out is {}; it must be"),
    "another joint": (lambda v: v["held_out"].update(wrist=v["held_out"]["elbow"]), "held_out is"),
    "no noise": (lambda v: v["held_out"]["elbow"].pop("noise"), "held_out: elbow: missing key 'noise'"),
    "negative": (lambda v: v["held_out"]["elbow"].update(noise=-1.0), "noise is -1.0; it must be"),
    "no error": (lambda v: v["parameters"][3].update(se=0.0), "parameters[4]: se is 0.0; it must be greater than 0"),
    "text": (lambda v: v["parameters"][0].update(value="1"), "parameters[1]: value is '1'; it must be a finite"),
    "no unit": (lambda v: v["parameters"][0].update(parameter="mass"), "parameter is 'mass'; it must be"),
    "no terms": (lambda v: v["combinations"][0].update(terms=[]), "combinations[1]: terms is []; it must be"),
    "other term": (lambda v: v["combinations"][0]["terms"][0].update(parameter="q_x"), "parameter is 'q_x'"),
    "number": (lambda v: v.update(validated=1), "validated is 1; it must be true or false"),
}  # fmt: skip


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_file_is_refused(
    case: str, arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, why = DAMAGE[case]
    values = read(arm / "cal")
    change(values)
    (tmp_path / "calibration.json").write_text(json.dumps(values), encoding="utf-8")
    said = refused(capsys, "report", tmp_path)
    assert f"{tmp_path / 'calibration.json'}: " in said
    assert why in said
    assert not (tmp_path / "report.html").exists()


def test_a_diagnosis_beside_it_is_on_the_same_page(
    arm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "both"
    code, _, said = run(
        capsys, "diagnose", arm / "log.csv", "--model", arm / "arm.xml", "--map", arm / "log.toml", "--out", out,
        "--no-closed-loop",
    )  # fmt: skip
    assert code == 0, said
    shutil.copy(arm / "cal" / "calibration.json", out)
    assert run(capsys, "report", out)[0] == 0
    both = Reader((out / "report.html").read_bytes())
    names = [attributes.get("href") for tag, attributes in both.tags if tag == "a"]
    assert {"#diagnosis-1", "#joint-calibration-1"} <= set(names)
    text = both.rows()
    assert text.index("The diagnosis in detail") < text.rindex("The calibration in detail")
    assert "Measured and modelled torques" in text
    assert "Calibration of arm.xml from 1 log of its joints" in text


@pytest.mark.pictures
def test_pictures_are_drawn_if_asked_for(arm: Path, tmp_path: Path) -> None:
    calibrate(arm, arm / "log.csv", tmp_path / "cal", "--pictures")
    with Image.open(tmp_path / "cal" / "torques.png") as picture:
        colours = picture.convert("RGB").getcolors(1 << 20)
    assert colours is not None
    assert len(colours) > 20  # marks and text, not a blank page
    assert not (arm / "cal" / "torques.png").exists()
