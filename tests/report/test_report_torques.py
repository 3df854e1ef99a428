"""The page of a robot of joints: measured and modelled torques, and what each cause explains of every joint."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from command import run
from discrepancy.result.traces import load_traces
from joint_logs import write_csv
from made_arm import JOINTS, made, write_log
from mocobot_report.folder import read_folder
from mocobot_report.page import write_report
from mocobot_report.residuals import torques

TITLE = "Measured and modelled torques"


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> tuple[Path, dict[str, np.ndarray]]:
    """The folder of an arm and its diagnosis, and the columns of its log."""
    folder, values = tmp_path_factory.mktemp("arm"), made(seconds=6.0)
    log = write_log(folder, values)
    run_quietly("diagnose", log, "--model", folder / "arm.xml", "--out", folder / "v", "--no-closed-loop")
    return folder, values


def run_quietly(*arguments: object) -> None:
    from mocobot.cli import main

    main([str(argument) for argument in arguments])


def test_the_parts_of_the_torque_are_those_of_the_made_arm(arm):
    folder, values = arm
    causes = json.loads((folder / "v" / "diagnosis.json").read_text())["causes"]
    traces, channels = load_traces(folder / "v" / "residuals.npz")
    assert [channel.name for channel in channels] == [f"{joint} torque" for joint in JOINTS]
    friction = [cause["cause"] for cause in causes].index("friction")
    for trace in traces:
        assert trace.measured is not None
        assert len(trace.causes) == len(causes)
        inside = (trace.time > values["time"][0] + 0.4) & (trace.time < values["time"][-1] - 0.4)  # they fade
        for j, (joint, dry, viscous) in enumerate(zip(JOINTS, (1.5, 2.0, 1.0), (1.0, 1.5, 0.5), strict=True)):
            raw = np.interp(trace.time, values["time"], values[f"{joint} torque"])
            assert np.sqrt(np.mean((trace.measured[:, j] - raw)[inside] ** 2)) < 0.2 * np.std(raw)
            dq = np.interp(trace.time, values["time"], values[f"{joint} dq"])
            truth = dry * np.tanh(dq / 0.01) + viscous * dq
            off = trace.causes[friction][:, j] - truth
            assert np.sqrt(np.mean(off[inside] ** 2)) < 0.2 * np.sqrt(np.mean(truth[inside] ** 2))


def test_shares_add_up_and_the_page_has_them(arm):
    folder, _ = arm
    (result,) = read_folder(folder / "v")
    found = torques(result.found, [trace.name for trace in result.found.traces])
    assert found is not None
    chart = found["shares"].to_json()["data"]
    assert len(chart) == len(result.found.values["causes"]) + 2
    heads = found["head"]
    assert heads[:4] == ["rms", "measured", "before", "after"]
    assert heads[4].startswith("friction in all joints")
    for joint, row in zip(JOINTS, found["rows"], strict=True):
        assert row[0].split() == [joint, "[N", "m]"]
        shares = [float(str(cell.text).replace("\u2212", "-")) for cell in row[4:]]
        assert sum(shares) == pytest.approx(100.0, abs=2.0)
        assert shares[0] > 30.0
        assert shares[-1] < 1.0
    page = write_report(folder / "v", folder / "page.html").read_text(encoding="utf-8")
    assert page.count(TITLE) >= 1
    assert "model with causes and tolerances" in page


def test_a_diagnosis_against_a_reference_makes_a_page_and_claims_no_test_of_one_trial(arm, tmp_path, capsys):
    folder, _ = arm
    today = write_csv(tmp_path / "today.csv", made(seconds=5.0, seed=7, payload_kg=0.5))
    out, reference = tmp_path / "v", ("--reference", folder / "log.csv")
    model = ("--model", folder / "arm.xml", "--map", folder / "log.toml")
    code, said, _ = run(capsys, "diagnose", today, *model, *reference, "--out", out)
    assert code == 0
    text = " ".join(said.split())
    assert (
        "one finding accounts for what has changed in the trial. The robot differs from the reference by payload"
        in text
    )
    assert "so the findings are not tested on data left out of the fit" in text
    values = json.loads((out / "diagnosis.json").read_text())
    assert (values["recordings"], values["reference"]) == (["today"], ["log"])
    assert values["gain"]["held_out"]["after"]["chi2_per_n"] < 2.0
    assert run(capsys, "report", out)[0] == 0
    (result,) = read_folder(out)
    found = torques(result.found, ["today"])
    assert found is not None
    assert "in the reference, too" in " ".join(found["head"])
    assert all(row[4].text != "" for row in found["rows"])


def test_two_trials_are_tested_on_each_other_for_what_has_changed_alone(arm, tmp_path, capsys):
    folder, _ = arm
    logs = [
        write_csv(tmp_path / f"today{k}.csv", made(seconds=5.0, seed=7 + k, payload_kg=0.5)) for k in (1, 2)
    ]
    model = ("--model", folder / "arm.xml", "--map", folder / "log.toml", "--json", tmp_path / "v.json")
    assert run(capsys, "diagnose", *logs, *model, "--reference", folder / "log.csv")[0] == 0
    gain = json.loads((tmp_path / "v.json").read_text())["gain"]
    weight, largest = 9.81 * 0.5 * 0.7, 0.0
    for trial in gain["trials"]:  # friction and masses, which the reference has, too, are no change
        largest = max(largest, trial["before"]["shoulder torque_rms"])
    assert largest < weight
    assert gain["removed"]["share"] > 0.9
