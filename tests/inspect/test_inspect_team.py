"""``mocobot inspect``: text, JSON and exit codes, on good logs, broken ones and ones that cannot be read."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator.arrays import Array
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from joint_logs import write_table
from log_files import write_text
from miswired import miswire
from mocobot.cli import main
from mocobot_inspect.findings import findings
from mocobot_inspect.report import ready_line
from mocobot_inspect.team import QUANTITIES, Inspection, Readiness, Standing, inspect_log
from mocobot_inspect.team_wiring import Misfit, Wiring
from mocobot_logs.bag.write import write_bag
from mocobot_logs.open_log import open_log
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.trial_log import TrialLog
from omnid_design import DESIGN
from recorded_team import Sines, carry
from recordings import small_recording

ENCODER = 2 * np.pi / 2**16


@pytest.fixture(scope="module")
def recording(random_a: TrialLog) -> Recording:
    return measure(random_a, PRESETS["nominal"], np.random.default_rng(1), payload="a")


@pytest.fixture(scope="module")
def good(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("inspect") / "rec.parquet"
    write_recording(recording, path)
    return path


@pytest.fixture
def look(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., tuple[str, dict]]:
    """Run the command with --json; what it prints and writes."""

    def run(log: Path, *arguments: object) -> tuple[str, dict]:
        target = tmp_path / "report.json"
        main(["inspect", str(log), "--json", str(target), "--force", *map(str, arguments)])
        out, err = capsys.readouterr()
        assert err == ""

        def refuse(name: str) -> None:
            raise AssertionError(f"{name} in the JSON")

        return out, json.loads(target.read_text(), parse_constant=refuse)

    return run


def sentences(report: dict) -> list[str]:
    return [finding["sentence"] for finding in report["findings"]]


def test_a_good_recording(look: Callable[..., tuple[str, dict]], good: Path, recording: Recording) -> None:
    out, report = look(good)
    assert report["findings"] == []
    lines = out.splitlines()
    assert lines[0] == f"[[Log {good}]]  3 robots, joint level, 12 channels each"
    assert "[[Wrong]]  nothing found" in lines
    assert lines[-1] == "ready for: grasps yes, mass yes, centre of mass yes, inertia yes"
    assert report["ready"] == lines[-1]
    assert (report["format"], report["version"]) == ("mocobot-inspection", 1)
    assert report["log"]["assumed_design"] is False
    assert [s["rate_hz"] for s in report["streams"]] == pytest.approx([100.0] * 3, rel=1e-9)
    assert [s["samples"] for s in report["streams"]] == [len(recording.time)] * 3
    for of_robot in report["channels"]:
        for name in ("phi1", "phi3", "theta_y", "theta_x"):
            assert of_robot[name]["step"] == pytest.approx(ENCODER, rel=1e-6)
        for name in ("tau1", "tau2", "tau3"):
            assert of_robot[name]["step"] == pytest.approx(0.01, rel=1e-6)
            assert of_robot[name]["noise"] == pytest.approx(0.01 * np.sqrt(13 / 12), rel=0.25)
    assert report["channels"][1]["tau2"]["highest"] == recording.tau[:, 1, 1].max()
    total = report["segments"]["still_s"] + report["segments"]["moving_s"]
    assert total == pytest.approx(recording.time[-1] - 2.0, abs=1.0)
    assert all(abs(clock["offset_s"]) < 1e-4 and not clock["differs"] for clock in report["clocks"])
    wiring = report["wiring"]
    assert wiring["misfit"]["total"] < 0.05
    assert wiring["found"] == []
    assert wiring["misfit"]["mass_kg"] == pytest.approx(11.67, rel=0.01)
    steps = {step["step"]: step for step in report["excitation"]["as_it_is"]["steps"]}
    assert steps["inertia"]["rank"] == 6
    assert report["excitation"]["undone"] is None


@pytest.mark.parametrize("name", ["log.csv", "log.mcap", "wrist.parquet"])
def test_other_formats_and_levels_say_the_same(
    look: Callable[..., tuple[str, dict]], good: Path, recording: Recording, tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    if name.endswith(".csv"):
        write_text(path, recording.columns())
    elif name.endswith(".mcap"):
        write_bag(recording, path, level="joint", storage="mcap")
    else:
        write_recording(replace(recording, metadata=replace(recording.metadata, level="wrist")), path)
    out, report = look(path)
    assert report["findings"] == []
    assert out.splitlines()[-1] == "ready for: grasps yes, mass yes, centre of mass yes, inertia yes"
    assert report["log"]["assumed_design"] is name.endswith(".csv")
    assert report["log"]["level"] == ("wrist" if name.startswith("wrist") else "joint")
    _, joint = look(good)
    assert report["wiring"]["misfit"]["mass_kg"] == pytest.approx(
        joint["wiring"]["misfit"]["mass_kg"], rel=1e-4
    )


def test_motion_without_yaw_is_not_ready_for_an_inertia(
    look: Callable[..., tuple[str, dict]], tmp_path: Path
) -> None:
    """The payload rolls and pitches a little, seen by ordinary encoders."""
    rng = np.random.default_rng(2)
    path = Sines.draw(rng, [*np.deg2rad([1.5, 1.5, 0.0]), 0.01, 0.01, 0.01], 3, 0.3, 0.7)
    carried = carry(path, Sines.draw(rng, [5.0] * 3, 8, 0.1, 1.5), 20.0).recording
    noisy = {
        name: getattr(carried, name) + sigma * rng.standard_normal(carried.phi.shape)
        for name, sigma in (("phi", 3e-5), ("theta", 1e-4), ("tau", 0.01))
    }
    write_recording(replace(carried, **noisy), tmp_path / "flat.parquet")
    out, report = look(tmp_path / "flat.parquet")
    assert report["findings"] == []
    assert out.splitlines()[-1] == (
        "ready for: grasps yes, mass yes, centre of mass yes, inertia no (yaw not excited)"
    )


def test_a_mistake_its_evidence_and_what_there_is_without_it(
    look: Callable[..., tuple[str, dict]], recording: Recording, tmp_path: Path
) -> None:
    def edit(phi: np.ndarray, theta: np.ndarray, tau: np.ndarray) -> None:
        phi *= 180 / np.pi
        theta *= 180 / np.pi
        tau[:, 1] *= -1

    columns = miswire(recording, edit).columns()
    table = pa.table(columns).replace_schema_metadata({"mocobot": recording.metadata.to_json()})
    pq.write_table(table, tmp_path / "bad.parquet")
    out, report = look(tmp_path / "bad.parquet")
    found = {f["sentence"]: f for f in report["wiring"]["found"]}
    assert set(found) == {
        "all robots: phi is in degrees, not radians",
        "all robots: theta is in degrees, not radians",
        "robot 2: tau has the wrong sign",
    }
    torque = found["robot 2: tau has the wrong sign"]
    assert (torque["kind"], torque["robots"], torque["channels"]) == (
        "torque_sign",
        [2],
        ["tau1", "tau2", "tau3"],
    )
    assert torque["misfit_before"] > 100 * torque["misfit_after"]
    assert found["all robots: phi is in degrees, not radians"]["factor"] == pytest.approx(np.pi / 180)
    # Ranges that the mistakes explain are not told again.
    assert len(report["findings"]) == 3
    assert all("misfit from" in sentence for sentence in sentences(report))
    assert out.splitlines()[-1] == (
        "ready for: nothing as it is; with the 3 mistakes above undone: "
        "grasps yes, mass yes, centre of mass yes, inertia yes"
    )
    assert report["excitation"]["as_it_is"]["steps"] == []


def test_a_broken_log_is_reported_and_not_refused(
    look: Callable[..., tuple[str, dict]], recording: Recording, tmp_path: Path
) -> None:
    columns = {name: values.copy() for name, values in recording.columns().items()}
    columns["omnid3.phi2"][900:1000] = columns["omnid3.phi2"][900]
    columns["omnid2.theta_x"][400:405] = np.nan
    columns["omnid1.tau3"] = np.minimum(columns["omnid1.tau3"], np.quantile(columns["omnid1.tau3"], 0.9))
    keep = np.ones(len(columns["time"]), bool)
    keep[1200:1230] = False
    columns = {name: values[keep] for name, values in columns.items()}
    columns["time"][50] = columns["time"][49]
    table = pa.table(columns).replace_schema_metadata({"mocobot": recording.metadata.to_json()})
    pq.write_table(table, tmp_path / "broken.parquet")
    out, report = look(tmp_path / "broken.parquet")
    text = "\n".join(sentences(report))
    assert "robots 1, 2 and 3: a stamp is repeated 1 time" in text
    assert "missing in 2 gaps, the longest of 0.31 s from 11.99 s on" in text
    assert "omnid3.phi2 is stuck from 9.00 s for 1.00 s while others move" in text
    assert "omnid2.theta_x: 5 NaN of" in text
    assert "omnid1.tau3 is cut off at" in text
    assert report["wiring"]["found"] == []
    assert len(report["excerpt"]["stretches"]) >= 2
    value = pytest.approx(columns["omnid3.phi2"][900])
    assert report["channels"][2]["phi2"]["stuck"] == [
        {
            "start_s": pytest.approx(9.0),
            "duration_s": pytest.approx(1.0, abs=0.02),
            "value": value,
            "jumps": True,
        }
    ]
    last = out.splitlines()[-1]
    assert last.startswith("ready for: nothing as it is; with the ")
    assert "s left out in which omnid1.tau3 and others stand still: grasps yes" in last


def test_a_stuck_channel_is_not_ready_and_a_dead_one_never(
    look: Callable[..., tuple[str, dict]], recording: Recording, tmp_path: Path
) -> None:
    """An estimate takes the whole log: two seconds without a sensor are enough to spoil it."""

    phi = recording.phi.copy()
    phi[900:1100, 1, 1] = phi[900, 1, 1]
    write_recording(replace(recording, phi=phi), tmp_path / "stuck.parquet")
    assert look(tmp_path / "stuck.parquet")[0].splitlines()[-1] == (
        "ready for: nothing as it is; with the 2 s left out in which omnid2.phi2 stands still: "
        "grasps yes, mass yes, centre of mass yes, inertia yes"
    )
    dead: Any = SimpleNamespace(
        free=False,
        unchecked=None,
        ready=1,
        wiring=1,
        skewed=False,
        standing=(Standing("omnid2.phi2", 19.0, mostly=True),),
    )
    assert ready_line(dead) == "ready for: nothing (omnid2.phi2 stands still)"


def test_a_robot_that_the_log_lacks(
    look: Callable[..., tuple[str, dict]], recording: Recording, tmp_path: Path
) -> None:
    """Two of three robots: they move alike, and their forces are not all that carries."""
    parts = {name: getattr(recording, name)[:, :2] for name in ("phi", "theta", "tau", "ref")}
    labels = replace(recording.metadata, robots=2, control=None)
    write_recording(replace(recording, metadata=labels, **parts), tmp_path / "two.parquet")
    out, report = look(tmp_path / "two.parquet")
    assert report["wiring"]["found"] == []
    assert "so does the log lack a robot" in sentences(report)[0]
    assert out.splitlines()[-1].startswith("ready for: nothing (the channels do not fit robots")


def test_clocks_that_differ(
    look: Callable[..., tuple[str, dict]], recording: Recording, tmp_path: Path
) -> None:
    """Robot 3 stamps every sample 20 ms too late, as a column of time of its own says."""
    late, time = 0.02, recording.time
    columns = {name: values.copy() for name, values in recording.columns().items()}
    for name, values in columns.items():
        if name.startswith("omnid3."):
            columns[name] = np.interp(time - late, time, values)
    write_text(tmp_path / "skewed.csv", columns)
    out, report = look(tmp_path / "skewed.csv")
    clock = report["clocks"][2]
    assert clock["differs"]
    assert clock["offset_s"] == pytest.approx(late, abs=1e-4)
    (sentence,) = sentences(report)
    assert sentence.startswith("the clock of robot 3 is 20 +- ")
    assert "ahead of that of robot 1" in sentence
    assert report["wiring"]["misfit"]["total"] < 0.05
    assert out.splitlines()[-1].endswith("inertia yes; clocks to be corrected")


# Logs that are refused as they are, and robots that do not move

RECORDING = small_recording(rows=1000, ref=False)
FITS = Misfit({}, {}, (), determined=False)
HEALTHY = Wiring(FITS, (), FITS, (), 0)
READY = Readiness((), 0, None, dict.fromkeys(QUANTITIES), ())
"""In place of those of robots that carry something, which these do not."""


GOOD = "grasps yes, mass yes, centre of mass yes, inertia yes"
ABSURD = "nothing as it is; with absurd values left out (convert --drop): "


def said(found: Inspection) -> list[str]:
    return [finding.sentence for finding in findings(found)]


def test_robots_that_stand_and_read_the_same_all_the_time(tmp_path: Path) -> None:
    """Without any noise rounding errors had passed for motion, and phi and theta for exchanged."""
    still = replace(
        RECORDING,
        phi=np.broadcast_to(RECORDING.phi[:1], RECORDING.phi.shape).copy(),
        theta=np.broadcast_to(RECORDING.theta[:1], RECORDING.theta.shape).copy(),
        tau=4.0 + 1e-9 * np.random.default_rng(0).normal(size=RECORDING.tau.shape),  # or it is one reading
    )
    write_recording(still, tmp_path / "rec.parquet")
    found = inspect_log(open_log(tmp_path / "rec.parquet"), DESIGN)
    assert found.wiring is not None
    assert not found.wiring.as_is.determined
    assert found.wiring.found == ()


def test_encoders_that_start_again_after_a_turn(tmp_path: Path) -> None:
    columns = {
        name: np.mod(x - x.mean(), 2 * np.pi) if "theta" in name else x
        for name, x in RECORDING.columns().items()
    }
    found = inspect_log(open_log(write_text(tmp_path / "log.csv", columns)), DESIGN)
    assert any("do they jump by a full turn" in sentence for sentence in said(found))


@pytest.mark.parametrize(
    ("spoil", "what"),
    [
        (lambda t, x: (t, x), ""),
        (lambda t, x: (np.where(t >= 5.0, t - 0.015, t), x), "; time that runs back to be mended"),
        (
            lambda t, x: (np.where(t >= 5.0, t + 1.0, t), x),
            "; the parts between gaps to be taken (convert --split-at-gaps)",
        ),
        (lambda t, x: (t, np.where(t == t[400], np.inf, x)), ABSURD),
        (lambda t, x: (t, np.where(t == t[400], 1e300, x)), ABSURD),
        (lambda t, x: (t, np.where(t == t[400], -2e4, x)), ABSURD),
        (lambda t, x: (t, np.where(t == t[400], np.nan, x)), "; missing values to be filled in (convert)"),
        (
            lambda t, x: (t, np.where((t > 8.0) & (t < 8.5), np.nan, x)),
            "; missing values to be filled in (convert); the parts between gaps to be taken (convert --split-at-gaps)",
        ),
    ],
    ids=["nothing", "back", "gap", "infinite", "1e300", "far", "NaN", "half a second of NaN"],
)
def test_what_is_refused_as_it_is_is_said_in_the_last_line(
    tmp_path: Path, spoil: Callable[[Array, Array], tuple[Array, Array]], what: str
) -> None:
    columns = RECORDING.columns()
    columns["time"], columns["omnid2.tau1"] = spoil(columns["time"], columns["omnid2.tau1"])
    found = inspect_log(open_log(write_table(tmp_path / "log.parquet", columns)), DESIGN)
    line = ready_line(replace(found, wiring=HEALTHY, ready=READY))
    assert line == (f"ready for: {what}{GOOD}" if what == ABSURD else f"ready for: {GOOD}{what}")
