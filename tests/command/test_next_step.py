"""The line to type next, which ends a diagnosis: the right one for the verdict, and one that works."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import run
from joint_logs import write_csv
from made_arm import JOINTS, made, write_log, write_map, write_model
from mocobot.cli import parse
from mocobot.next_step import next_step


def last_line(out: str) -> str:
    return out.rstrip().splitlines()[-1].strip()


@pytest.fixture
def arm(tmp_path, monkeypatch) -> Path:
    """Two logs of an arm, model and map beside them; the current folder."""
    monkeypatch.chdir(tmp_path)
    for number in (1, 2):
        write_log(tmp_path, made(seconds=4.0, seed=number), f"run {number}.csv")
    return tmp_path


def test_an_explained_arm_is_calibrated_with_the_users_own_files(arm, capsys):
    (arm / "calibrated").mkdir()
    logs = ["run 1.csv", "run 2.csv"]
    code, out, _ = run(
        capsys, "diagnose", *logs, "--model", "arm.xml", "--map", "log.toml", "--no-closed-loop"
    )
    assert code == 0
    assert out.startswith("EXPLAINED")
    expected = [
        "mocobot",
        "calibrate",
        *logs,
        "--model",
        "arm.xml",
        "--map",
        "log.toml",
        "--out",
        "calibrated-2",
    ]
    assert shlex.split(last_line(out)) == expected


def test_a_clean_arm_becomes_the_reference_of_next_weeks_log(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_model(tmp_path)
    write_map(tmp_path)
    values = of_the_model(made(seconds=4.0), tmp_path)
    write_csv(tmp_path / "monday.csv", values)
    _, out, _ = run(capsys, "diagnose", "monday.csv", "--model", "arm.xml", "--out", "v", "--no-closed-loop")
    assert out.startswith("CONSISTENT")
    line = shlex.split(last_line(out))
    assert shlex.join(line) == "mocobot diagnose NEW.csv --model arm.xml --reference monday.csv --out v-2"
    later = values | {"elbow torque": values["elbow torque"] + 1.5 * np.tanh(values["elbow dq"] / 0.01)}
    write_csv(tmp_path / "NEW.csv", later)
    code, out, _ = run(capsys, *line[1:])
    assert code == 0
    assert "The robot differs from the reference by friction in joint 3 (elbow)" in " ".join(out.split())
    assert last_line(out) == "mocobot diagnose NEW-2.csv --model arm.xml --reference monday.csv --out v-3"


def of_the_model(values: dict[str, np.ndarray], folder: Path) -> dict[str, np.ndarray]:
    """The same motion with the torques that MuJoCo asks of the model, and noise."""
    import mujoco

    model, rng = mujoco.MjModel.from_xml_path(str(folder / "arm.xml")), np.random.default_rng(9)
    data = mujoco.MjData(model)
    q, dq = (np.column_stack([values[f"{joint} {what}"] for joint in JOINTS]) for what in ("q", "dq"))
    ddq = np.gradient(dq, values["time"], axis=0)
    torque = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(model, data)
        torque[k] = data.qfrc_inverse
    noise = 0.05 * rng.standard_normal(q.shape)
    return values | {f"{joint} torque": torque[:, j] + noise[:, j] for j, joint in enumerate(JOINTS)}


def told(verdict: str, *causes: dict[str, Any], finished: bool = True) -> dict[str, Any]:
    """The values of a verdict that decide what comes next."""
    return {"verdict": verdict, "causes": list(causes), "finished": finished}


def cause(
    name: str, place: str = "joint 2", several: bool = False, separate: str = "Move slowly."
) -> dict[str, Any]:
    one = {"cause": name, "place": place, "name": name}
    return one | {"told": [one, one] if several else [one], "separate": separate, "event": None}


ARM, TEAM = "diagnose a.csv b.csv --model arm.xml", "diagnose a.parquet"
LINES = {
    "undecided": (
        f"{ARM} --out v", told("explained", cause("friction", several=True)),
        "mocobot diagnose a.csv b.csv NEW.csv --model arm.xml --out v-2",
    ),
    "undecided, with a reference": (
        f"{ARM} --reference c.csv", told("explained", cause("friction", several=True)),
        "mocobot diagnose a.csv b.csv NEW.csv --model arm.xml --reference c.csv",
    ),
    "stopped": (
        f"{ARM} --seconds 3 --exclude payload", told("explained", cause("friction"), finished=False),
        "mocobot diagnose a.csv b.csv --model arm.xml --exclude payload",
    ),
    "unlisted": (
        ARM, told("unexplained", cause("unlisted")), "mocobot diagnose a.csv b.csv NEW.csv --model arm.xml"
    ),
    "unexplained": (f"{ARM} --out v", told("unexplained"), "mocobot report v"),
    "nothing has changed": (f"{ARM} --reference c.csv", told("consistent"), ""),
    "corrected": (
        "diagnose a.csv --model old/extended/robot.xml --out v", told("consistent"), "mocobot compare old v"
    ),
    "a miscalibrated team": (TEAM, told("miscalibrated"), "mocobot calibrate a.parquet --out calibrated"),
    "a miscalibrated, calibrated team": (f"{TEAM} --calibration c.json", told("miscalibrated"), ""),
    "a clean team": (TEAM, told("consistent"), ""),
    "an explained team": (
        f"{TEAM} --out v", told("explained", cause("sea_bias")),
        "mocobot simulate --model v/extended --out v-simulated.parquet",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", list(LINES))
def test_each_verdict_has_its_next_line_which_the_command_line_reads(tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    for folder in ("v/extended", "old/extended"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "old" / "diagnosis.json").touch()
    typed, values, line = LINES[case]
    said = next_step(parse(typed.split()), values)
    assert (last_line(said) if said else "") == line
    if line:
        parse(line.split()[1:])


def test_the_experiment_at_something_unlisted_is_told_with_its_place():
    said = next_step(parse(ARM.split()), told("unexplained", cause("unlisted", "joint 2 (elbow)")))
    assert "Next, at joint 2 (elbow): move slowly; log it as NEW.csv" in said


def test_a_missing_map_is_drafted_by_the_line_that_the_refusal_names(arm, capsys):
    (arm / "log.toml").unlink()
    code, _, err = run(capsys, "diagnose", "run 1.csv", "--model", "arm.xml")
    assert code == 2
    line = shlex.split(err.partition("draft one with ")[2])
    assert run(capsys, *line[1:])[0] == 0
    assert run(capsys, "inspect", "run 1.csv", "--model", "arm.xml")[0] == 0
