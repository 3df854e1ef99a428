"""Logs of robots that do not move at all, and of encoders that start again after a turn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from estimator.recording.parquet import write_recording
from log_files import write_text
from mocobot_inspect.findings import findings
from mocobot_inspect.inspection import Inspection, inspect_log
from mocobot_logs.open_log import open_log
from omnid_design import DESIGN
from recordings import small_recording

RECORDING = small_recording(rows=1000, ref=False)


def said(found: Inspection) -> list[str]:
    return [finding.sentence for finding in findings(found)]


def test_robots_that_stand_and_read_the_same_all_the_time(tmp_path: Path) -> None:
    """Without any noise rounding errors had passed for motion, and phi and theta for exchanged."""
    still = replace(
        RECORDING,
        phi=np.broadcast_to(RECORDING.phi[:1], RECORDING.phi.shape).copy(),
        theta=np.broadcast_to(RECORDING.theta[:1], RECORDING.theta.shape).copy(),
        tau=np.full_like(RECORDING.tau, 4.0),
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
