import dataclasses
import json
import os

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator.arm.design import OmnidDesign
from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording, write_recording
from omnid_design import DESIGN
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


def test_folder_names_are_not_data(tmp_path):
    path = tmp_path / "payload=a" / "trial.parquet"
    path.parent.mkdir()
    write_recording(small_recording(rows=20), path)
    assert read_recording(path).metadata.robots == 3


# Columns


def test_missing_column(path, table):
    pq.write_table(table.drop_columns("omnid2.tau3"), path)
    message = complaint(path)
    assert message.startswith(
        "missing column 'omnid2.tau3'; the columns are time and, for i = 1..3, omnid{i}."
    )
    assert "theta_z, theta_y, theta_x" in message


def test_missing_time(path, table):
    pq.write_table(table.drop_columns("time"), path)
    assert "missing column 'time'" in complaint(path)


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


def test_column_twice(path, table):
    pq.write_table(table.append_column("omnid1.phi2", table["time"]), path)
    assert "column 'omnid1.phi2' appears 2 times" in complaint(path)


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


def test_no_rows(path, table):
    pq.write_table(table.slice(0, 0), path)
    assert complaint(path) == "the file has no rows"


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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"{", "not valid JSON"),
        (b"\xff\xfe\x00", "not valid JSON"),
        (b"[]", "must be a JSON object"),
        (b"3", "must be a JSON object"),
        (b'{"seed": 1, "seed": 2}', "not valid JSON (key 'seed' appears twice)"),
        (b'{"rate_hz": NaN}', "not valid JSON (NaN is not a JSON number)"),
        (b'{"rate_hz": -Infinity}', "not valid JSON (-Infinity is not a JSON number)"),
        (b"[" * 100_000, "not valid JSON"),
        (b"9" * 10_000, "not valid JSON"),
    ],
    ids=range(9),
)
def test_metadata_that_is_not_an_object(path, table, text, message):
    pq.write_table(table.replace_schema_metadata({b"mocobot": text}), path)
    assert complaint(path).startswith(f"metadata: {message}")


def test_more_robots_than_columns(path, table):
    for robots, missing in ((4, "omnid4.phi1"), (10**12, "omnid4.phi1")):
        pq.write_table(with_metadata(table, robots=robots), path)
        assert f"missing column '{missing}'" in complaint(path)


def test_fewer_robots_than_columns(path, table):
    pq.write_table(with_metadata(table, robots=2), path)
    assert "unknown column 'omnid3.phi1'" in complaint(path)


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


def test_metadata_json_round_trip():
    written = metadata(control={"a": [1, 2.5, None, "x"]}, seed=0, payload="d", source="")
    assert RecordingMetadata.from_json(written.to_json()) == written


# Files


def test_missing_file(path):
    assert complaint(path) == "there is no such file"


def test_directory(tmp_path):
    assert complaint(tmp_path) == "is a directory; it must be a recording file"


def test_special_file(tmp_path):
    """A pipe would wait for a writer for ever."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert complaint(pipe) == "is not a regular file; it must be a recording file"


@pytest.mark.parametrize("name", ["a" * 5000, "nul\0byte"], ids=["long", "nul"])
def test_impossible_names(name):
    with pytest.raises(InputError, match=r"no such file|not a usable file name"):
        read_recording(name)


@pytest.mark.parametrize(
    "content", [b"", b"time,phi\n0,1\n", b"PAR1", b"PAR1PAR1", b"PAR1" + b"\0" * 99 + b"PAR1"]
)
def test_files_that_are_not_parquet(path, content):
    path.write_bytes(content)
    assert complaint(path).startswith("not a readable Parquet file, or a damaged one (")


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_unreadable_file(path, table):
    path.chmod(0)
    assert complaint(path) == "cannot be read (permission denied)"


def test_an_unreadable_file_is_said_to_be_so(path, table, monkeypatch):
    def deny(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(pq, "ParquetFile", deny)
    assert complaint(path) == "cannot be read (permission denied)"


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


def test_targets_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    for target in ("file/trial.parquet", "folder", "a" * 300):
        with pytest.raises(InputError, match=r"cannot be written \(.+\)"):
            write_recording(small_recording(rows=20), tmp_path / target)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder"]


def test_new_files_have_ordinary_permissions(path):
    write_recording(small_recording(rows=20), path)
    path.with_name("other").touch()
    assert path.stat().st_mode == path.with_name("other").stat().st_mode


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


def test_lists_become_float64():
    good = small_recording(rows=20, ref=False)
    recording = Recording(good.time.tolist(), good.phi.tolist(), good.theta, good.tau, None, good.metadata)
    assert recording.phi.dtype == np.float64
    assert np.array_equal(recording.phi, good.phi)
