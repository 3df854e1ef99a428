"""Recordings of robots that hold nothing: version 4, strict both ways, and refused where a payload is asked for."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from discrepancy.team.diagnosis import diagnose_team
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.recording.metadata import RecordingMetadata, Sampling
from estimator.recording.parquet import read_recording, write_recording
from recordings import metadata, small_recording

SAMPLING = tuple(Sampling(100.0, 0.0, 0.0, 0.0, False, "filtered", "joint", (0.01,) * 9) for _ in range(3))


@pytest.mark.parametrize("level", ["joint", "wrist"])
@pytest.mark.parametrize("sampling", [None, SAMPLING])
def test_round_trip(tmp_path: Path, level: str, sampling: tuple[Sampling, ...] | None) -> None:
    written = small_recording(rows=40, trial="free", level=level, sampling=sampling, seed=3)
    write_recording(written, tmp_path / "free.parquet")
    read = read_recording(tmp_path / "free.parquet")
    assert read.metadata == written.metadata
    np.testing.assert_allclose(read.phi, written.phi, rtol=0, atol=1e-12)
    np.testing.assert_allclose(read.tau, written.tau, rtol=0, atol=1e-10)
    told = json.loads(pq.read_schema(tmp_path / "free.parquet").metadata[b"mocobot"])
    assert (told["version"], told["trial"], told["payload"], told["level"]) == (4, "free", None, level)
    assert ("sampling" in told) == (sampling is not None)


@pytest.mark.parametrize(
    ("changes", "version"),
    [({}, 1), ({"level": "wrist"}, 2), ({"sampling": SAMPLING}, 3), ({"trial": "free"}, 4)],
)
def test_a_newer_version_is_written_only_where_it_is_needed(changes: dict[str, object], version: int) -> None:
    text = metadata(**changes).to_json()
    assert json.loads(text)["version"] == version
    assert RecordingMetadata.from_json(text) == metadata(**changes)


def test_a_payload_that_nobody_holds_is_not_written(tmp_path: Path) -> None:
    recording = small_recording(rows=40, trial="free", payload="a")
    with pytest.raises(
        InputError, match="payload is 'a'; it must be null in a free trial, whose robots hold nothing"
    ):
        write_recording(recording, tmp_path / "free.parquet")
    assert not list(tmp_path.iterdir())


def test_nothing_of_a_payload_comes_out_of_it() -> None:
    carried = small_recording()
    free = replace(carried, metadata=replace(carried.metadata, trial="free"), name="free.parquet")
    sentence = (
        "free.parquet: trial is 'free': the robots hold nothing, so nothing can be {}; "
        "mocobot calibrate --free takes it"
    )
    for recordings in ([free], [carried, free]):
        with pytest.raises(InputError) as caught:
            estimate_payload(recordings)
        assert str(caught.value) == sentence.format("estimated")
        with pytest.raises(InputError) as caught:
            diagnose_team(recordings)
        assert str(caught.value) == sentence.format("diagnosed")
