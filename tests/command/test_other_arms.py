"""Robots of other than three joints, through every command that shows what was found of them."""

from __future__ import annotations

import json

import pytest
from rerun.chunk import RrdReader

from command import refused, run
from discrepancy.cause_names import JOINTS
from made_arm import write_chain_log


@pytest.mark.slow
@pytest.mark.parametrize("joints", [1, 7])
def test_every_command_takes_a_cause_at_the_last_joint(tmp_path, capsys, joints) -> None:
    log, model, found = write_chain_log(tmp_path, joints, joints), tmp_path / "arm.xml", tmp_path / "found"
    others = [name for name in JOINTS if name != "friction"]
    code, _, _ = run(
        capsys, "diagnose", log, "--model", model, "--out", found, "--no-closed-loop", "--exclude", *others,
    )  # fmt: skip
    assert code == 0
    (cause,) = json.loads((found / "diagnosis.json").read_text())["causes"]
    assert (cause["cause"], cause["robot"], cause["joint"]) == ("friction", None, joints)
    code, _, _ = run(capsys, "report", found, "--out", tmp_path / "page.html")
    assert code == 0
    assert f"friction in joint {joints}" in (tmp_path / "page.html").read_text()
    code, said, _ = run(capsys, "compare", found, found)
    assert code == 0
    assert f"friction in joint {joints}, coulomb_Nm" in said
    code, _, _ = run(capsys, "replay", log, "--model", model, "--save", tmp_path / "log.rrd")
    assert code == 0
    entities = {str(path) for path in RrdReader(tmp_path / "log.rrd").store().schema().entity_paths()}
    assert f"/log/series/joint{joints}/torque/model" in entities


@pytest.mark.parametrize("joint", [0, 4, 1.5, "1"])
def test_a_team_s_robots_have_three_joints(tmp_path, capsys, joint) -> None:
    """In a file that somebody has changed; a robot of a team is numbered, any other is not."""
    cause = {"cause": "friction", "robot": 1, "joint": joint, "sentence": "", "kind": "", "name": ""}
    values = {
        "format": "mocobot-diagnosis",
        "version": 2,
        "verdict": "explained",
        "recordings": [],
        "causes": [cause],
    }
    path = tmp_path / "diagnosis.json"
    path.write_text(json.dumps(values))
    assert f"diagnosis.json: not a complete diagnosis (ValueError: joint is {joint!r})" in refused(
        capsys, "compare", path, path
    )


@pytest.mark.parametrize("command", [("watch",), ("inspect",), ("convert", "x.parquet")])
def test_a_map_of_joints_where_a_team_is_meant(tmp_path, capsys, command) -> None:
    log = write_chain_log(tmp_path, 1, 1, seconds=1.0)
    said = refused(capsys, command[0], log, "--map", tmp_path / "log.toml", *command[1:])
    assert "log.toml: is of one robot's joints, not of a team" in said
    assert "read its log with --model" in said
