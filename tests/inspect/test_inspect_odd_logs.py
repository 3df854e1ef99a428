"""Logs of robots that do not move at all, and of encoders that start again after a turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator.arrays import Array
from estimator.recording.parquet import write_recording
from joint_logs import write_table
from log_files import write_text
from mocobot_inspect.findings import findings
from mocobot_inspect.readiness import QUANTITIES, Readiness
from mocobot_inspect.report import ready_line
from mocobot_inspect.team import Inspection, inspect_log
from mocobot_inspect.team_wiring import Misfit, Wiring
from mocobot_logs.open_log import open_log
from omnid_design import DESIGN
from recordings import small_recording

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
    ids=["back", "gap", "infinite", "1e300", "far", "NaN", "half a second of NaN"],
)
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_what_is_refused_as_it_is_is_said_in_the_last_line(
    tmp_path: Path, spoil: Callable[[Array, Array], tuple[Array, Array]], what: str, suffix: str
) -> None:
    """It had been ready for all, and convert and estimate refused it."""
    columns = RECORDING.columns()
    columns["time"], columns["omnid2.tau1"] = spoil(columns["time"], columns["omnid2.tau1"])
    found = inspect_log(open_log(write_table(tmp_path / f"log{suffix}", columns)), DESIGN)
    line = ready_line(replace(found, wiring=HEALTHY, ready=READY))
    assert line == (f"ready for: {what}{GOOD}" if what == ABSURD else f"ready for: {GOOD}{what}")
    unspoilt = inspect_log(open_log(write_table(tmp_path / f"good{suffix}", RECORDING.columns())), DESIGN)
    assert ready_line(replace(unspoilt, wiring=HEALTHY, ready=READY)).endswith(f": {GOOD}")


def test_too_many_missing_values_are_ready_for_nothing(tmp_path: Path) -> None:
    columns = RECORDING.columns()
    columns["omnid2.tau1"] = np.where(np.arange(1000) % 5 == 2, np.nan, columns["omnid2.tau1"])
    found = inspect_log(open_log(write_text(tmp_path / "log.csv", columns)), DESIGN)
    line = ready_line(replace(found, wiring=HEALTHY, ready=READY))
    assert line == "ready for: nothing (robot 2 lacks 200 samples, too many to be filled in)"


def test_where_time_runs_back_is_said(tmp_path: Path) -> None:
    columns = RECORDING.columns()
    columns["time"] = np.where(columns["time"] >= 5.0, columns["time"] - 0.5, columns["time"])
    found = inspect_log(open_log(write_text(tmp_path / "log.csv", columns)), DESIGN)
    assert "robots 1, 2 and 3: time runs backwards 1 time by 0.49 s after 4.99 s" in said(found)
