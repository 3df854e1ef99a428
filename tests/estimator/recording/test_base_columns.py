"""Columns of measured base motion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import mocobot


@pytest.fixture(scope="module")
def driven() -> mocobot.SimulatedRecording:
    """A short trial of driving bases."""
    return mocobot.simulate("a", "random", seed=4, vias=12, drive=0.01)


def test_base_motion_survives_the_file(driven: mocobot.SimulatedRecording, tmp_path: Path) -> None:
    driven.write(tmp_path / "rec.parquet")
    read = mocobot.read_recording(tmp_path / "rec.parquet")
    assert driven.base is not None
    assert read.base is not None
    np.testing.assert_array_equal(read.base, driven.base)
    assert np.ptp(read.base[..., 0]) > 0.02


def test_base_columns_are_of_all_robots(driven: mocobot.SimulatedRecording, tmp_path: Path) -> None:
    driven.write(tmp_path / "rec.parquet")
    table = pq.read_table(tmp_path / "rec.parquet")
    pq.write_table(table.drop_columns(["omnid2.base_x"]), tmp_path / "less.parquet")
    with pytest.raises(
        mocobot.InputError, match=r"missing column 'omnid2.base_x'.*base_\* for all robots or for none"
    ):
        mocobot.read_recording(tmp_path / "less.parquet")


def test_grasps_come_out_while_bases_drive(driven: mocobot.SimulatedRecording) -> None:
    true = np.array([grasp["p_1i_m"] for grasp in driven.truth.to_dict()["grasps"]])
    found = mocobot.estimate([driven])
    assert found.method == "fit"
    assert found.grasps is not None
    error = (found.grasps.p_1i - true)[1:]
    se = np.sqrt(np.diag(found.grasps.covariance)).reshape(-1, 2, 3)[:, 1]
    assert np.sqrt(np.mean((error / se) ** 2)) < 2.0
    assert np.abs(error).max() < 1e-3
    blind = mocobot.estimate([replace(driven, base=None)]).grasps
    assert blind is None or np.abs(blind.p_1i - true).max() > 1e-3
