"""What a recording tells of its robots' samples, and which version of the metadata has it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimator.arm.unit import COUNT, ArmUnit
from estimator.calibrate.rows import Resolution
from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata, Sampling
from recordings import DESIGN, metadata, small_recording

TOLD = Sampling(
    400.0, 0.25, 2e-4, 0.02, False, "interpolated", "joint", (1e-4,) * 3 + (2e-4,) * 3 + (0.01, 0.0, 0.02)
)


def test_it_is_written_and_read() -> None:
    values = json.loads(json.dumps(TOLD.to_dict()))
    assert Sampling.from_dict(values, "m") == TOLD
    whole = values | {"native_hz": 400, "first_s": 0, "jitter_s": 0, "missing": 0, "steps": [0] * 9}
    found = Sampling.from_dict(whole, "m")
    assert [type(x) for x in (found.native_hz, found.first_s, found.jitter_s, found.missing)] == [float] * 4
    assert {type(step) for step in found.steps} == {float}


def test_steps_of_each_kind() -> None:
    assert [TOLD.steps_of(kind) for kind in range(3)] == [(1e-4,) * 3, (2e-4,) * 3, (0.01, 0.0, 0.02)]
    wrist = replace(TOLD, level="wrist")
    assert [wrist.steps_of(kind) for kind in range(3)] == [(0.0,) * 3, (2e-4,) * 3, (0.0,) * 3]


def test_a_part_begins_later() -> None:
    assert TOLD.later(1.5) == replace(TOLD, first_s=-1.25)


@pytest.mark.parametrize(
    ("key", "good", "bad", "allowed"),
    [
        ("native_hz", [1e-3, 9.9e8], [0, -1.0, 1e9, "400", None],
         "a number of hertz, greater than 0 and less than 1e9"),
        ("first_s", [-1e6, 1e6], [-1.1e6, 1.1e6, None], "a number of seconds, between -1e6 and 1e6"),
        ("jitter_s", [0.0, 1.0], [-1e-9, 1.01, True], "a number of seconds, from 0 to one"),
        ("missing", [0.0, 0.999], [-1e-9, 1.0, "0"], "a share, at least 0 and less than 1"),
        ("aligned", [True, False], [0, 1, None], "true or false"),
        ("method", ["untouched", "filtered", "fitted"], ["", "thinned", 1],
         "one of untouched, filtered, interpolated, fitted"),
        ("level", ["joint", "wrist"], ["", "base", 1], "one of joint, wrist"),
        ("steps", [[0] * 9, [1.0] * 9], [[0] * 8, [0] * 10, [0] * 8 + [-1e-9], [0] * 8 + ["0"], None],
         "9 numbers, none negative"),
    ],
)  # fmt: skip
def test_values_and_what_they_must_be(key: str, good: list[Any], bad: list[Any], allowed: str) -> None:
    values = TOLD.to_dict()
    for value in good:
        read = Sampling.from_dict(values | {key: value}, "m")
        assert getattr(read, key) == (tuple(value) if key == "steps" else value)
    for value in bad:
        with pytest.raises(InputError) as error:
            Sampling.from_dict(values | {key: value}, "m")
        assert str(error.value) == f"m: {key} is {value!r:.60}; it must be {allowed}"


@pytest.mark.parametrize(
    ("changes", "version"),
    [
        ({}, 1),
        ({"level": "wrist"}, 2),
        ({"sampling": (TOLD,) * 3}, 3),
        ({"trial": "free", "sampling": (TOLD,) * 3}, 4),
        ({"trial": "free"}, 4),
        ({"units": ArmUnit(DESIGN, np.full((3, COUNT), 1e-4))}, 5),
    ],
)
def test_versions(changes: dict[str, Any], version: int) -> None:
    """Each is written where it is needed, and every one is read."""
    made = metadata(**changes)
    text = made.to_json()
    assert json.loads(text)["version"] == version
    found = RecordingMetadata.from_json(text)
    assert (found.level, found.trial, found.sampling) == (made.level, made.trial, made.sampling)
    for other in (0, 6):
        with pytest.raises(InputError, match=r"^there: .*version"):
            RecordingMetadata.from_json(json.dumps(json.loads(text) | {"version": other}), "there")


def test_readings_that_a_sample_is_made_of() -> None:
    """At 100 Hz of 400 and of 50 Hz: a quarter of a reading's variance, and twice."""
    slow, untold = replace(TOLD, native_hz=50.0), small_recording()
    found = Resolution.of(small_recording(sampling=(TOLD, slow, TOLD)))
    np.testing.assert_allclose(found.share, [[0.25], [2.0], [0.25]])
    np.testing.assert_allclose(found.step, np.tile(TOLD.steps, (3, 1)))
    np.testing.assert_allclose(Resolution.of(untold).share, np.ones((3, 1)))
