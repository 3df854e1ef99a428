"""Two calibrations of a robot's joints side by side: what is said to have changed, and what is not compared."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command import refused, run
from estimator.calibrate.json import calibration_to_dict
from estimator.files import write_json
from invented_calibration import invented_calibration
from made_arm import made, write_chain_log, write_log

PAYLOAD_KG, UPPER_M = 0.5, 0.4
"""Payload, and length of the made arm's upper arm."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Calibrations ``a`` and ``b`` of one arm in two motions, ``c`` with a payload, and of a chain of two joints."""
    root = tmp_path_factory.mktemp("calibrations")
    for name, seed, payload_kg in (("a", 0, 0.0), ("b", 1, 0.0), ("c", 2, PAYLOAD_KG)):
        (root / f"made-{name}").mkdir()
        write_log(root / f"made-{name}", made(seed=seed, payload_kg=payload_kg))
    (root / "made-chain").mkdir()
    write_chain_log(root / "made-chain", 2, 1)
    for name in ("a", "b", "c", "chain"):
        calibrate(root / f"made-{name}", root / name)
    return root


def calibrate(made_in: Path, out: Path) -> None:
    from mocobot.cli import main

    words = ("calibrate", made_in / "log.csv", "--model", made_in / "arm.xml", "--map", made_in / "log.toml")
    main([str(word) for word in (*words, "--out", out)])


def test_another_motion_of_the_same_arm_changes_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, _ = run(capsys, "compare", folder / "a", folder / "b", "--strict")
    assert code == 0
    assert said.startswith("Two joint calibrations: A is ")
    assert "NOTHING CHANGED beyond its errors" in said
    assert "Coulomb friction of joint 2 (shoulder) [N m]" in said
    values = json.loads((folder / "a" / "calibration.json").read_text(encoding="utf-8"))
    undetermined = {
        p["place"] for p in values["parameters"] if p["parameter"] == "mass_kg" and not p["determined"]
    }
    assert undetermined
    assert "mass of" not in said


def test_a_payload_changes_moments_by_what_it_weighs_and_no_friction(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "ac"
    code, said, _ = run(capsys, "compare", folder / "a", folder / "c", "--strict", "--out", out)
    assert code == 1
    assert "CHANGED beyond its errors" in said
    groups = {
        g["name"]: g for g in json.loads((out / "comparison.json").read_text(encoding="utf-8"))["groups"]
    }
    changed = {name for name, group in groups.items() if group["changed"]}
    assert not [name for name in changed if "friction" in name or "torque" in name]
    for name, unit, truth in (
        ("mz(upper) + 0.4 m(fore)", "kg m", UPPER_M * PAYLOAD_KG),
        ("yy(upper) + 0.16 m(fore) + armature_kgm2(shoulder)", "kg m^2", UPPER_M**2 * PAYLOAD_KG),
    ):
        (one,) = groups[name]["quantities"]
        assert groups[name]["unit"] == unit
        assert name in changed
        assert abs(one["difference"] - truth) < 4.0 * one["se"]


def test_a_value_is_matched_by_place_and_name(folder: Path, tmp_path: Path) -> None:
    """The order of parameters in a file does not matter, and a change of one joint is not one of another."""
    import mocobot

    values = json.loads((folder / "a" / "calibration.json").read_text(encoding="utf-8"))
    values["parameters"].reverse()
    joints = [p for p in values["parameters"] if p["parameter"].startswith("zero_")]
    assert len(joints) == 2
    rubbing = next(p for p in values["parameters"] if (p["place"], p["parameter"]) == ("elbow", "coulomb_Nm"))
    rubbing["value"] += 20.0 * rubbing["se"]
    file = tmp_path / "changed.json"
    file.write_text(json.dumps(values), encoding="utf-8")
    (group,) = mocobot.compare(folder / "a", file).changed_groups
    assert group.name.startswith("Coulomb friction of joint")
    assert group.name.endswith("(elbow)")
    assert group.ratio[0] == pytest.approx(20.0 / 2**0.5)


def test_what_one_alone_determines_is_named(folder: Path, tmp_path: Path) -> None:
    import mocobot

    values = json.loads((folder / "a" / "calibration.json").read_text(encoding="utf-8"))
    for p in values["parameters"]:
        if p["parameter"] == "viscous_Nms_per_rad":
            p["determined"] = False
    file = tmp_path / "less.json"
    file.write_text(json.dumps(values), encoding="utf-8")
    found = mocobot.compare(folder / "a", file)
    assert not found.changed
    assert not [group for group in found.groups if "viscous" in group.name]
    assert any(
        note.startswith("A alone determines: viscous friction of joint 1 (turret); ") for note in found.notes
    )


def test_other_robots_kinds_and_damage_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused(capsys, "compare", folder / "a", folder / "chain")
    assert "the calibrations are of different robots: only one of them has elbow, fore, joint2" in said
    write_json(tmp_path / "team.json", calibration_to_dict(invented_calibration()))
    said = refused(capsys, "compare", folder / "a", tmp_path / "team.json")
    assert "a joint calibration and" in said
    assert "team.json a calibration; both must be of one kind" in said
    values = json.loads((folder / "a" / "calibration.json").read_text(encoding="utf-8"))
    values["parameters"][0]["se"] = None
    (tmp_path / "broken.json").write_text(json.dumps(values), encoding="utf-8")
    said = refused(capsys, "compare", tmp_path / "broken.json", folder / "a")
    assert "broken.json: parameters[1]: se is None; it must be a finite number" in said
