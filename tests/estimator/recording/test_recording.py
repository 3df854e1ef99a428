"""Recordings in files: bits, columns, metadata, levels, versions, and files that are none."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator.arm.delta import forward_kinematics
from estimator.arm.design import OmnidDesign
from estimator.arm.unit import COUNT, ArmUnit
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.recording.metadata import RecordingMetadata, Sampling
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from omnid_design import DESIGN
from recorded_team import MASS, Sines, carry
from recordings import metadata, small_recording

FIELDS = ("time", "phi", "theta", "tau", "ref")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "trial.parquet"


@pytest.fixture
def table(path):
    """The Arrow table of a good file, to be spoiled."""
    write_recording(small_recording(rows=50), path)
    return pq.read_table(path)


def complaint(path):
    with pytest.raises(InputError) as caught:
        read_recording(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message[len(f"{path}: ") :]


def with_metadata(table, **changes):
    values = json.loads(table.schema.metadata[b"mocobot"]) | changes
    kept = {key: value for key, value in values.items() if value is not ...}
    return table.replace_schema_metadata({"mocobot": json.dumps(kept)})


# Round trip and contract


@pytest.mark.parametrize("robots", [1, 2, 3, 12])
@pytest.mark.parametrize("ref", [True, False])
def test_round_trip_keeps_every_bit(path, robots, ref):
    control = {"stiffness_N_per_m": [400.0, 400.0, 400.0], "inner": {"rate_hz": 1000}}
    written = small_recording(
        robots=robots, ref=ref, trial="periodic", source="Zürich, π", payload="a", seed=2**60, control=control
    )
    write_recording(written, path)
    read = read_recording(path)
    assert read.metadata == written.metadata
    assert read.name == str(path)
    for field in FIELDS:
        a, b = getattr(read, field), getattr(written, field)
        assert (a is None and b is None) or np.array_equal(a, b), field


def test_the_file_is_the_documented_one(path):
    """Written here, read with pyarrow alone: names, order, types, metadata, and which number is where."""
    recording = small_recording(robots=2, rows=20, trial="static", seed=3, source="rig")
    write_recording(recording, path)
    table = pq.read_table(path)
    of_one = ["phi1", "phi2", "phi3", "theta_z", "theta_y", "theta_x"]
    of_one += ["tau1", "tau2", "tau3", "ref_x", "ref_y", "ref_z"]
    assert table.column_names == ["time"] + [f"omnid{i}.{name}" for i in (1, 2) for name in of_one]
    assert set(table.schema.types) == {pa.float64()}
    assert table.num_rows == 20
    assert json.loads(table.schema.metadata[b"mocobot"]) == {
        "format": "mocobot-recording",
        "version": 1,
        "robots": 2,
        "rate_hz": 100.0,
        "trial": "static",
        "source": "rig",
        "payload": None,
        "seed": 3,
        "design": DESIGN.to_dict(),
    }
    assert table["omnid2.theta_x"].to_pylist() == recording.theta[:, 1, 2].tolist()
    assert table["omnid1.theta_z"].to_pylist() == recording.theta[:, 0, 0].tolist()
    assert table["omnid2.tau3"].to_pylist() == recording.tau[:, 1, 2].tolist()


def test_foreign_files_may_have_other_order_types_and_chunks(path, table):
    shuffled = table.select(sorted(table.column_names))
    narrow = shuffled.set_column(0, "omnid1.phi1", shuffled["omnid1.phi1"].cast(pa.float32()))
    whole = narrow.set_column(
        narrow.column_names.index("omnid2.tau1"), "omnid2.tau1", pa.array(range(-25, 25), pa.int16())
    )
    pq.write_table(whole, path, row_group_size=7, compression="gzip")
    read, expected = read_recording(path), small_recording(rows=50)
    assert read.phi[:, 0, 0] == pytest.approx(expected.phi[:, 0, 0], rel=1e-7)
    assert read.tau[:, 1, 0].tolist() == list(range(-25, 25))
    assert np.array_equal(read.theta, expected.theta)


# Columns


def test_missing_column(path, table):
    pq.write_table(table.drop_columns("omnid2.tau3"), path)
    message = complaint(path)
    assert message.startswith(
        "missing column 'omnid2.tau3'; the columns are time and, for i = 1..3, omnid{i}."
    )
    assert "theta_z, theta_y, theta_x" in message


def test_ref_for_some_robots_only(path, table):
    pq.write_table(table.drop_columns("omnid3.ref_z"), path)
    assert "missing column 'omnid3.ref_z'" in complaint(path)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("omnid2.tua3", " (did you mean 'omnid2.tau3'?)"),
        ("omnid2.theta_w", " (did you mean 'omnid2.theta_"),
        ("Omnid2.tau3", " (did you mean 'omnid2.tau3'?)"),
        ("omnid4.tau3", " (did you mean 'omnid"),
        ("omnid0.phi1", " (did you mean 'omnid"),
        ("temperature", ""),
        ("", ""),
    ],
)
def test_unknown_columns(path, table, name, hint):
    pq.write_table(table.append_column(name, table["time"]), path)
    message = complaint(path)
    assert message.startswith(f"unknown column {name!r}{hint}")
    assert "the columns are time and, for i = 1..3" in message
    assert ("did you mean" in message) == bool(hint)


@pytest.mark.parametrize(
    "values",
    [
        pa.array(["0.5"] * 50),
        pa.array([True] * 50),
        pa.array([[0.5]] * 50),
        pa.nulls(50),
        pa.array([b"x"] * 50),
    ],
    ids=["text", "bool", "list", "null", "binary"],
)
def test_columns_that_do_not_hold_numbers(path, table, values):
    pq.write_table(table.set_column(1, table.column_names[1], values), path)
    assert "column 'omnid1.phi1' holds" in complaint(path)


def test_empty_cells(path, table):
    values = table["omnid3.tau2"].to_pylist()
    values[5] = values[9] = None
    index = table.column_names.index("omnid3.tau2")
    pq.write_table(table.set_column(index, "omnid3.tau2", pa.array(values)), path)
    assert "column 'omnid3.tau2' is nan in 2 of 50 rows, first in row 5" in complaint(path)


# Metadata


def test_no_metadata(path, table):
    pq.write_table(table.replace_schema_metadata(None), path)
    assert complaint(path) == "not a recording, the schema metadata has no key 'mocobot'"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "format is 'other'; it must be 'mocobot-recording'"),
        ({"version": 6}, "version is 6; this program reads versions 1, 2, 3, 4 and 5"),
        ({"version": "1"}, "version is '1'; this program reads versions 1, 2, 3, 4 and 5"),
        ({"version": True}, "version is True; this program reads versions 1, 2, 3, 4 and 5"),
        (
            {"version": 6, "robots": ..., "units": 1},
            "version is 6; this program reads versions 1, 2, 3, 4 and 5",
        ),
        ({"version": 3}, "missing key 'level'; required are format, version"),
        ({"version": 3, "level": "joint"}, "missing key 'sampling'; required are format, version"),
        (
            {"version": 3, "level": "joint", "sampling": []},
            "sampling is []; it must be a list with one object",
        ),
        ({"version": 4, "trial": "free"}, "missing key 'level'; required are format, version"),
        (
            {"version": 4, "level": "joint", "sampling": []},
            "sampling is []; it must be a list with one object for each robot",
        ),
        (
            {"trial": "free"},
            "trial is 'free'; it must be one of random, periodic, static in version 1 (4 has free trials)",
        ),
        (
            {"version": 2, "level": "joint", "trial": "free"},
            "trial is 'free'; it must be one of random, periodic, static in version 2 (4 has free trials)",
        ),
        (
            {"version": 4, "level": "joint", "trial": "rest"},
            "trial is 'rest'; it must be one of random, periodic, static, free",
        ),
        (
            {"version": 4, "level": "joint", "trial": "free", "payload": "a"},
            "payload is 'a'; it must be null in a free trial, whose robots hold nothing",
        ),
        ({"version": 2}, "missing key 'level'; required are format, version"),
        ({"level": "wrist"}, "unknown key 'level'; the keys are format, version, robots"),
        ({"version": 2, "level": "Wrist"}, "level is 'Wrist'; it must be one of joint, wrist"),
        ({"version": 2, "level": None}, "level is None; it must be one of joint, wrist"),
        ({"version": 2, "level": ["wrist"]}, "level is ['wrist']; it must be one of joint, wrist"),
        ({"robots": 0}, "robots is 0; it must be a whole number, at least 1"),
        ({"robots": 3.0}, "robots is 3.0; it must be a whole number"),
        ({"robots": True}, "robots is True; it must be a whole number"),
        ({"rate_hz": 0}, "rate_hz is 0; it must be a number of hertz"),
        ({"rate_hz": "100"}, "rate_hz is '100'; it must be a number of hertz"),
        ({"rate_hz": 10**400}, "rate_hz is 1000"),
        ({"trial": "walk"}, "trial is 'walk'; it must be one of random, periodic, static"),
        ({"trial": ["random"]}, "trial is ['random']; it must be one of random, periodic, static"),
        ({"source": None}, "source is None; it must be text"),
        ({"payload": 1}, "payload is 1; it must be text or null"),
        ({"seed": 1.5}, "seed is 1.5; it must be a whole number or null"),
        ({"design": None}, "design is None; it must be an object"),
        ({"control": None}, "control is None; it must be an object (leave it out if unknown)"),
        ({"gain": 1}, "unknown key 'gain'; the keys are format, version, robots,"),
        ({"design": {}}, "design: missing key 'base_radius_m'"),
        ({"design": DESIGN.to_dict() | {"mass": 1}}, "design: unknown key 'mass'"),
        (
            {"design": DESIGN.to_dict() | {"rod_length_m": -0.4}},
            "design.rod_length_m is -0.4; it must be greater",
        ),
        ({"design": DESIGN.to_dict() | {"rod_length_m": 10**400}}, "design.rod_length_m is 1000"),
    ]
    + [
        ({key: ...}, f"missing key '{key}'; required are format, version")
        for key in ("format", "version", "robots", "rate_hz", "trial", "source", "payload", "seed", "design")
    ],
    ids=str,
)
def test_metadata_is_strict(path, table, changes, message):
    pq.write_table(with_metadata(table, **changes), path)
    assert complaint(path).startswith(f"metadata: {message}")


def test_metadata_that_could_not_be_read_back_is_not_written(path):
    for changes in (
        {"trial": "walk"},
        {"rate_hz": -1.0},
        {"control": {"gain": np.nan}},
        {"control": {"a": object}},
    ):
        with pytest.raises(InputError, match="recording metadata"):
            write_recording(small_recording(rows=20, **changes), path)
    assert not path.exists()


@pytest.mark.parametrize("value", [np.nan, np.inf, True, "0.4", None])
def test_design_numbers_that_json_or_toml_could_smuggle_in(value):
    with pytest.raises(InputError, match=r"design.rod_length_m is .*; it must be a finite number"):
        OmnidDesign.from_dict(DESIGN.to_dict() | {"rod_length_m": value})


# Files


@pytest.mark.parametrize(
    "content", [b"", b"time,phi\n0,1\n", b"PAR1", b"PAR1PAR1", b"PAR1" + b"\0" * 99 + b"PAR1"]
)
def test_files_that_are_not_parquet(path, content):
    path.write_bytes(content)
    assert complaint(path).startswith("not a readable Parquet file, or a damaged one (")


def test_truncated_at_every_sort_of_place(path, table):
    content = path.read_bytes()
    cuts = {*range(12), *range(0, len(content), 199), *range(len(content) - 40, len(content))}
    assert len(cuts) > 100
    for cut in sorted(cuts):
        path.write_bytes(content[:cut])
        assert complaint(path).startswith("not a readable Parquet file, or a damaged one ("), cut


def test_flipped_bits_are_found_or_harmless(path, table):
    """The pages carry checksums, so no flip may change a sample; the footer has none but is mostly vital."""
    content = path.read_bytes()
    original = small_recording(rows=50)
    rng = np.random.default_rng(2)
    sentences = []
    for position in rng.choice(len(content), 400, replace=False):
        damaged = bytearray(content)
        damaged[position] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        try:
            read = read_recording(path)
        except InputError as error:
            sentences.append(str(error))
        else:
            for field in FIELDS:
                assert np.array_equal(getattr(read, field), getattr(original, field)), (position, field)
    assert len(sentences) > 200
    assert all(sentence.startswith(f"{path}: ") for sentence in sentences)


# Writing


def test_writing_replaces_the_old_file_and_leaves_nothing_else(path):
    path.write_text("old")
    other_name = path.with_name("other name of the old file")
    os.link(path, other_name)
    write_recording(small_recording(rows=20), path)
    assert len(read_recording(path).time) == 20
    assert other_name.read_text() == "old"  # replaced as a whole, not written over
    assert sorted(os.listdir(path.parent)) == sorted([path.name, other_name.name])


def test_a_failed_write_keeps_the_old_file(path, monkeypatch):
    write_recording(small_recording(rows=20), path)

    def fail(table, where, **options):
        where.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq, "write_table", fail)
    with pytest.raises(InputError, match=r"trial.parquet: cannot be written \(No space left on device\)"):
        write_recording(small_recording(rows=30), path)
    assert len(read_recording(path).time) == 20
    assert os.listdir(path.parent) == [path.name]


# The class


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"phi": np.zeros((20, 2, 3))}, r"phi has shape \(20, 2, 3\); it must be \(20, 3, 3\)"),
        ({"tau": np.zeros((19, 3, 3))}, r"tau has shape \(19, 3, 3\); it must be \(20, 3, 3\)"),
        ({"time": np.zeros((20, 1))}, r"time has shape \(20, 1\); it must be \(20,\)"),
        ({"ref": np.zeros((20, 3))}, r"ref has shape \(20, 3\); it must be \(20, 3, 3\)"),
        ({"metadata": metadata(robots=2)}, r"phi has shape \(20, 3, 3\); it must be \(20, 2, 3\)"),
    ],
)
def test_shapes_must_agree(changes, message):
    with pytest.raises(InputError, match=message):
        dataclasses.replace(small_recording(rows=20), **changes)


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


TOLD = Sampling(
    400.0, 0.25, 2e-4, 0.02, False, "interpolated", "joint", (1e-4,) * 3 + (2e-4,) * 3 + (0.01, 0.0, 0.02)
)


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


def at_wrist(recording: Recording) -> Recording:
    return dataclasses.replace(recording, metadata=dataclasses.replace(recording.metadata, level="wrist"))


@pytest.fixture
def wrist_path(tmp_path):
    return tmp_path / "trial.parquet"


@pytest.mark.parametrize("ref", [True, False])
def test_the_file_at_wrist_level_is_the_documented_one(wrist_path, ref: bool) -> None:
    recording = at_wrist(small_recording(rows=20, robots=2, ref=ref))
    write_recording(recording, wrist_path)
    table = pq.read_table(wrist_path)
    of_one = ["h_x", "h_y", "h_z", "theta_z", "theta_y", "theta_x", "force_x", "force_y", "force_z"]
    of_one += ["ref_x", "ref_y", "ref_z"] if ref else []
    assert table.column_names == ["time"] + [f"omnid{i}.{name}" for i in (1, 2) for name in of_one]
    values = json.loads(table.schema.metadata[b"mocobot"])
    assert (values["version"], values["level"]) == (2, "wrist")
    h = np.array([table[f"omnid2.h_{axis}"].to_pylist() for axis in "xyz"]).T
    assert h == pytest.approx(forward_kinematics(recording.phi[:, 1], DESIGN), abs=1e-15)
    read = read_recording(wrist_path)
    assert read.metadata == recording.metadata
    assert np.array_equal(read.theta, recording.theta)
    assert read.phi == pytest.approx(recording.phi, abs=1e-12)
    assert read.tau == pytest.approx(recording.tau, abs=1e-10)
    assert (read.ref is not None) == ref


def spoiled(wrist_path, column: str, change) -> str:
    """What is said about a file of 50 rows whose row 7 is changed in one column."""
    write_recording(at_wrist(small_recording(rows=50)), wrist_path)
    table = pq.read_table(wrist_path)
    values = table[column].to_numpy().copy()
    values[7] = change(values[7])
    table = table.set_column(table.column_names.index(column), column, pa.array(values))
    pq.write_table(table, wrist_path)
    with pytest.raises(InputError) as caught:
        read_recording(wrist_path)
    message = str(caught.value)
    assert message.startswith(f"{wrist_path}: ")
    assert "\n" not in message
    return message[len(f"{wrist_path}: ") :]


def test_millimetres_are_recognised(wrist_path) -> None:
    write_recording(at_wrist(small_recording(rows=20)), wrist_path)
    table = pq.read_table(wrist_path)
    for name in table.column_names:
        if ".h_" in name:
            index = table.column_names.index(name)
            table = table.set_column(index, name, pa.array(1e3 * table[name].to_numpy()))
    pq.write_table(table, wrist_path)
    with pytest.raises(InputError, match=r"omnid1.h_x, .h_y, .h_z in row 0: leg .* - .* millimetres$"):
        read_recording(wrist_path)


def test_what_has_no_wrist_position_is_not_written(wrist_path) -> None:
    recording = at_wrist(small_recording(rows=20))
    recording.phi[4, 1] = [3.0, 0.6, 0.6]
    with pytest.raises(
        InputError,
        match=r"recording: omnid2: a leg is folded past its stretched position at phi = \(3, 0\.6, 0\.6\) rad",
    ):
        write_recording(recording, wrist_path)
    assert not wrist_path.exists()


def test_estimates_are_those_of_the_joint_level(wrist_path) -> None:
    """Exact sensors; what differs is the rounding of the conversion, through differences and least squares."""
    rng = np.random.default_rng(4)
    motion = Sines.draw(rng, [0.05, 0.06, 0.04, 0.02, 0.02, 0.02], 20, 0.1, 1.5)
    carried = carry(motion, Sines.draw(rng, [5.0] * 3, 8, 0.1, 1.5), 30.0)
    wrist, joint = at_wrist(carried.recording), carried.recording
    write_recording(wrist, wrist_path)
    wrist, joint = estimate_payload([read_recording(wrist_path)]), estimate_payload([joint])
    assert wrist.flags == joint.flags
    assert wrist.mass.mass == pytest.approx(joint.mass.mass, rel=1e-9)
    assert wrist.p_1c == pytest.approx(joint.p_1c, abs=1e-9)
    assert wrist.grasps.p_1i == pytest.approx(joint.grasps.p_1i, abs=1e-9)
    assert wrist.inertia.inertia == pytest.approx(joint.inertia.inertia, abs=1e-7)
    assert joint.mass.mass == pytest.approx(MASS, rel=1e-3)
