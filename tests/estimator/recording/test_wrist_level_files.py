"""Recordings laid out at wrist level: the file, its faults, and estimates from it."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator.arm.delta import forward_kinematics
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from omnid_design import DESIGN
from recorded_team import MASS, Sines, carry
from recordings import small_recording


def at_wrist(recording: Recording) -> Recording:
    return dataclasses.replace(recording, metadata=dataclasses.replace(recording.metadata, level="wrist"))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "trial.parquet"


@pytest.mark.parametrize("ref", [True, False])
def test_the_file_is_the_documented_one(path, ref: bool) -> None:
    recording = at_wrist(small_recording(rows=20, robots=2, ref=ref))
    write_recording(recording, path)
    table = pq.read_table(path)
    of_one = ["h_x", "h_y", "h_z", "theta_z", "theta_y", "theta_x", "force_x", "force_y", "force_z"]
    of_one += ["ref_x", "ref_y", "ref_z"] if ref else []
    assert table.column_names == ["time"] + [f"omnid{i}.{name}" for i in (1, 2) for name in of_one]
    values = json.loads(table.schema.metadata[b"mocobot"])
    assert (values["version"], values["level"]) == (2, "wrist")
    h = np.array([table[f"omnid2.h_{axis}"].to_pylist() for axis in "xyz"]).T
    assert h == pytest.approx(forward_kinematics(recording.phi[:, 1], DESIGN), abs=1e-15)
    read = read_recording(path)
    assert read.metadata == recording.metadata
    assert np.array_equal(read.theta, recording.theta)
    assert read.phi == pytest.approx(recording.phi, abs=1e-12)
    assert read.tau == pytest.approx(recording.tau, abs=1e-10)
    assert (read.ref is not None) == ref


def test_joint_level_may_be_said_in_version_2(path) -> None:
    write_recording(small_recording(rows=20), path)
    table = pq.read_table(path)
    values = json.loads(table.schema.metadata[b"mocobot"]) | {"version": 2, "level": "joint"}
    pq.write_table(table.replace_schema_metadata({"mocobot": json.dumps(values)}), path)
    assert np.array_equal(read_recording(path).phi, small_recording(rows=20).phi)


def spoiled(path, column: str, change) -> str:
    """What is said about a file of 50 rows whose row 7 is changed in one column."""
    write_recording(at_wrist(small_recording(rows=50)), path)
    table = pq.read_table(path)
    values = table[column].to_numpy().copy()
    values[7] = change(values[7])
    table = table.set_column(table.column_names.index(column), column, pa.array(values))
    pq.write_table(table, path)
    with pytest.raises(InputError) as caught:
        read_recording(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message[len(f"{path}: ") :]


@pytest.mark.parametrize(
    ("column", "change", "words"),
    [
        (
            "omnid2.h_z",
            lambda _: 0.7,
            "omnid2.h_x, .h_y, .h_z in row 7: leg 1 cannot reach the wrist position (",
        ),
        ("omnid2.h_z", lambda _: -0.2, "omnid2.h_x, .h_y, .h_z in row 7: the wrist position ("),
        ("omnid3.h_x", lambda _: np.nan, "column 'omnid3.h_x' is nan in 1 of 50 rows, first in row 7"),
        (
            "omnid3.force_x",
            lambda _: np.inf,
            "column 'omnid3.force_x' is inf in 1 of 50 rows, first in row 7",
        ),
        (
            "omnid1.force_z",
            lambda _: 1e4,
            "tau1 of omnid1, which follows from its force_x, force_y, force_z and",
        ),
        ("omnid1.theta_y", lambda _: 1.2, "column 'omnid1.theta_y' reaches 1.2 rad"),
        ("time", lambda _: 0.0, "time goes back in row 7"),
    ],
)
def test_faults_name_the_files_own_columns(path, column: str, change, words: str) -> None:
    assert words in spoiled(path, column, change)


def test_driven_angles_out_of_range_are_said_of_the_position(path) -> None:
    recording = at_wrist(small_recording(rows=20))
    recording.phi[3, 1, 2] = -0.9
    write_recording(recording, path)
    with pytest.raises(
        InputError, match=r"phi3 of omnid2, which follows from its h_x, h_y, h_z, reaches -0\.9 rad"
    ):
        read_recording(path)


def test_millimetres_are_recognised(path) -> None:
    write_recording(at_wrist(small_recording(rows=20)), path)
    table = pq.read_table(path)
    for name in table.column_names:
        if ".h_" in name:
            index = table.column_names.index(name)
            table = table.set_column(index, name, pa.array(1e3 * table[name].to_numpy()))
    pq.write_table(table, path)
    with pytest.raises(InputError, match=r"omnid1.h_x, .h_y, .h_z in row 0: leg .* - .* millimetres$"):
        read_recording(path)


def test_columns_of_the_other_level_are_unknown(path) -> None:
    write_recording(at_wrist(small_recording(rows=20)), path)
    table = pq.read_table(path)
    names = [name.replace("h_x", "phi1") for name in table.column_names]
    pq.write_table(table.rename_columns(names).replace_schema_metadata(table.schema.metadata), path)
    with pytest.raises(
        InputError, match=r"unknown column 'omnid1.phi1'.*; the columns at wrist level are .* h_x"
    ):
        read_recording(path)


def test_what_has_no_wrist_position_is_not_written(path) -> None:
    recording = at_wrist(small_recording(rows=20))
    recording.phi[4, 1] = [3.0, 0.6, 0.6]
    with pytest.raises(
        InputError,
        match=r"recording: omnid2: a leg is folded past its stretched position at phi = \(3, 0\.6, 0\.6\) rad",
    ):
        write_recording(recording, path)
    assert not path.exists()


def test_estimates_are_those_of_the_joint_level(path) -> None:
    """Exact sensors; what differs is the rounding of the conversion, through differences and least squares."""
    rng = np.random.default_rng(4)
    motion = Sines.draw(rng, [0.05, 0.06, 0.04, 0.02, 0.02, 0.02], 20, 0.1, 1.5)
    carried = carry(motion, Sines.draw(rng, [5.0] * 3, 8, 0.1, 1.5), 30.0)
    wrist, joint = at_wrist(carried.recording), carried.recording
    write_recording(wrist, path)
    wrist, joint = estimate_payload([read_recording(path)]), estimate_payload([joint])
    assert wrist.flags == joint.flags
    assert wrist.mass.mass == pytest.approx(joint.mass.mass, rel=1e-9)
    assert wrist.p_1c == pytest.approx(joint.p_1c, abs=1e-9)
    assert wrist.grasps.p_1i == pytest.approx(joint.grasps.p_1i, abs=1e-9)
    assert wrist.inertia.inertia == pytest.approx(joint.inertia.inertia, abs=1e-7)
    assert joint.mass.mass == pytest.approx(MASS, rel=1e-3)
