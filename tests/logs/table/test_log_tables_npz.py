"""NPZ logs: arrays as numpy saves them, and archives that claim, hide or lack what they should hold."""

from __future__ import annotations

import io
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimator import inputs
from estimator.inputs import set_max_unpacked
from log_files import assert_same, read_log, refused
from mocobot_logs.maps import TimeMap, builtin_map
from mocobot_logs.open_log import open_log
from mocobot_logs.table import table as tables
from recordings import metadata, small_recording

RECORDING = small_recording(rows=60)
ARRAYS = {name: getattr(RECORDING, name) for name in ("time", "phi", "theta", "tau", "ref")}
GIB = 1 << 30


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "log.npz"


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def npy_header(text: str, version: int = 1, length: int | None = None) -> bytes:
    """Start of an .npy file whose header says what the test wants."""
    raw = text.encode("latin1").ljust(117) + b"\n"
    size = len(raw) if length is None else length
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H" if version == 1 else "<I", size) + raw


def archive(path: Path, members: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, content in members.items():
            file.writestr(name, content)
    return path


def members(**changes: bytes | None) -> dict[str, bytes]:
    """Entries of a good archive, some replaced or taken out."""
    content = {f"{name}.npy": npy(array) for name, array in ARRAYS.items()}
    content |= {f"{name}.npy": value for name, value in changes.items() if value is not None}
    return {name: value for name, value in content.items() if changes.get(name[:-4], b"") is not None}


# What numpy writes


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@pytest.mark.parametrize(
    "change",
    [
        lambda a: a,
        np.asfortranarray,
        lambda a: a.astype(">f8"),
        lambda a: a.astype(np.longdouble),
    ],
    ids=["as it is", "Fortran order", "big-endian", "long double"],
)
def test_arrays_of_a_team(
    path: Path, save: Callable[..., None], change: Callable[[np.ndarray], np.ndarray]
) -> None:
    save(path, **{name: change(array) for name, array in ARRAYS.items()})
    assert_same(read_log(path), RECORDING)


def test_columns_by_name(path: Path) -> None:
    np.savez(path, **RECORDING.columns())  # type: ignore[arg-type]
    assert_same(read_log(path), RECORDING)


def test_without_commands(path: Path) -> None:
    np.savez(path, time=RECORDING.time, phi=RECORDING.phi, theta=RECORDING.theta, tau=RECORDING.tau)
    assert_same(read_log(path), replace(RECORDING, ref=None))


def test_whole_numbers_and_halves(path: Path) -> None:
    """Encoder counts and half floats; stamps as whole nanoseconds, which no float could hold."""
    start, counts = 1_700_000_000_123_456_789, np.arange(540, dtype=np.int16).reshape(60, 3, 3)
    stamps = start + 10_000_000 * np.arange(60)
    np.savez(path, time=stamps, phi=counts, theta=counts.astype(np.float16), tau=counts.astype(np.uint8))
    log = read_log(path, replace(builtin_map("mocobot-arrays"), time=TimeMap("time", "ns")))
    assert np.array_equal(log.streams[2].stamp_ns, stamps)
    assert np.array_equal(log.streams[2].values[:, :3], counts[:, 2])
    assert np.array_equal(log.streams[2].values[:, 3:6], np.float16(counts[:, 2]))
    assert np.array_equal(log.streams[2].values[:, 6:], np.uint8(counts[:, 2] % 256))


def test_metadata_travel_along(path: Path) -> None:
    np.savez(path, mocobot=np.array(metadata(payload="a").to_json()), **ARRAYS)
    log = read_log(path)
    assert log.metadata == metadata(payload="a")
    assert_same(log, RECORDING)


def test_blocks_join_seamlessly(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "CELLS", 1)
    recording = small_recording(rows=333)
    np.savez_compressed(
        path, time=recording.time, phi=recording.phi, theta=recording.theta, tau=recording.tau
    )
    source, steps = open_log(path), []
    assert sum(len(samples.stamp_ns) for _, samples in source.chunks(steps.append)) == 333 * 3
    assert len(steps) == 6
    assert sum(steps) == source.size == 333
    assert_same(read_log(path), replace(recording, ref=None))


# Claims


@pytest.mark.parametrize(
    ("header", "words"),
    [
        (
            "{'descr': '<f8', 'fortran_order': False, 'shape': (1250000000,), }",
            ["10000000000 bytes", "but has 0"],
        ),
        ("{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }", ["claims the shape (-1,)"]),
        (
            "{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000000000000000,), }",
            ["claims the shape"],
        ),
        (
            "{'descr': '|O', 'fortran_order': False, 'shape': (60,), }",
            ["Python objects, which are never loaded"],
        ),
        ("{'descr': 'nonsense', 'fortran_order': False, 'shape': (60,), }", ["damaged"]),
        ("{'descr': '<f8', 'fortran_order': False}", ["damaged"]),
        ("__import__('os').system('true')", ["damaged"]),
        ("", ["damaged"]),
    ],
    ids=range(8),
)
def test_headers_that_lie(path: Path, header: str, words: list[str]) -> None:
    archive(path, members(phi=npy_header(header)))
    message = refused(path)
    for word in words:
        assert word in message


def test_claims_are_refused_before_anything_is_allocated(path: Path) -> None:
    """Ten gigabytes in a header, in the archive's directory, and in zeros that pack a thousandfold."""
    text = "{'descr': '<f8', 'fortran_order': False, 'shape': (1250000000,), }"
    honest = "{'descr': '<f8', 'fortran_order': False, 'shape': (50000000,), }"
    bomb = npy_header(honest) + bytes(400_000_000)
    cases: list[tuple[dict[str, bytes], str]] = [
        (members(time=npy_header(text)), "but has 0"),
        (members(time=npy_header("x" * 100, 2, length=0xFFFFFFF0)), "has a header of 4294967280 bytes"),
        (members(time=bomb), "unpacks to at least 0.3725 GiB; the limit is 0.25 GiB, which --max-unpacked"),
    ]
    for content, words in cases:
        archive(path, content)
        del content
        tracemalloc.start()
        try:
            message = refused(path)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        assert words in message
        assert peak < 4 << 20


def test_arrays_have_one_limit_together(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is within what is free, and packs a thousandfold."""
    monkeypatch.setattr(inputs, "FREE_BYTES", 1 << 20)
    monkeypatch.setattr(inputs, "LARGEST_RATIO", 1)
    rows = 12_000
    shapes = {name: np.zeros((rows, 3, 3)) for name in ("phi", "theta", "tau")} | {
        "time": np.arange(rows) * 0.01
    }
    archive(
        path,
        {f"{name}.npy": npy(values) for name, values in shapes.items()} | {"other.npy": npy(np.zeros(10**7))},
    )
    assert "unpacks to at least 0.0016" in refused(path)
    set_max_unpacked(0.01)
    try:
        assert read_log(path).robots == 3  # what is not read is not counted
    finally:
        set_max_unpacked(None)


@pytest.mark.parametrize("packing", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
def test_packing_that_unpacks_without_a_limit(path: Path, packing: int) -> None:
    archive(path, members(), packing)
    assert "is not packed as numpy does it" in refused(path)


@pytest.mark.parametrize("also_header", [False, True])
def test_a_directory_that_lies_about_an_entry(path: Path, also_header: bool) -> None:
    """The archive's directory claims 3.2 GB for an entry of 480 bytes, with or without the array's header."""
    text = "{'descr': '<f8', 'fortran_order': False, 'shape': (400000000,), }"
    time = npy_header(text) + RECORDING.time.tobytes() if also_header else npy(RECORDING.time)
    archive(path, members(time=time), zipfile.ZIP_STORED)
    content = bytearray(path.read_bytes())
    entry = content.rindex(b"PK\x01\x02", 0, content.rindex(b"time.npy"))
    content[entry + 20 : entry + 28] = struct.pack("<II", 3_200_000_128, 3_200_000_128)
    path.write_bytes(content)
    message = refused(path)
    assert ("unpacks to at least 2.98 GiB" if also_header else "claims the shape (60,)") in message


def test_data_that_are_not_all_there(path: Path) -> None:
    phi = npy(RECORDING.phi)
    archive(path, members(phi=phi[:-8]))
    assert "claims the shape (60, 3, 3)" in refused(path)
    archive(path, members(phi=phi + b"\0"))
    assert "claims the shape (60, 3, 3)" in refused(path)


# Arrays


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"phi": RECORDING.phi[:, :0]}, "missing column 'phi[:, 0, 0]'"),
        ({"phi": np.full((60, 3, 3), "a")}, "array 'phi' holds <U1; it must hold numbers"),
        ({"phi": np.ones((60, 3, 3), complex)}, "array 'phi' holds complex128"),
        ({"phi": np.ones((60, 3, 3), bool)}, "array 'phi' holds bool"),
        ({"time": np.full(60, "2024-01-01", "M8[ns]")}, "array 'time' holds datetime64[ns]"),
        ({"phi": RECORDING.phi[:59]}, "array 'phi' has 59 rows, but 'time' has 60"),
        ({"theta": RECORDING.theta[:, :2]}, "missing column 'theta[:, 2, 0]' for theta_z of robot 3"),
        ({"time": RECORDING.phi}, "column 'time' has (3, 3) numbers in a row; time must be one"),
        ({"time": None}, "missing column 'time'"),
        ({"phi": None}, "missing column 'omnid1.phi1'"),
        ({"ref": RECORDING.ref[:, :1]}, "missing column 'ref[:, 1, 0]' for ref_x of robot 2"),  # type: ignore[index]
        (
            {"time": np.where(np.arange(60) == 5, np.nan, RECORDING.time)},
            "has no time for 1 samples of robot 1",
        ),
        ({"time": np.where(np.arange(60) == 5, np.inf, RECORDING.time)}, "array 'time' is inf in row 5"),
        ({"time": RECORDING.time + 1e10}, "in row 0; a time must be finite and within 292 years"),
        ({"mocobot": np.array(3)}, "array 'mocobot' must be one text"),
        ({"mocobot": np.array("{}")}, "metadata: missing key 'format'"),
    ],
    ids=range(16),
)
def test_arrays_that_do_not_fit(path: Path, changes: dict[str, np.ndarray | None], words: str) -> None:
    arrays = {name: array for name, array in (ARRAYS | changes).items() if array is not None}
    np.savez(path, **arrays)
    assert words in refused(path)


def test_vectors_need_an_index(path: Path) -> None:
    np.savez(path, **ARRAYS)
    common = {**builtin_map("mocobot-arrays").common}
    for column, words in (
        ("phi", "column 'phi' has (3, 3) numbers in a row; name one of them in the map, such as 'phi[0, 0]'"),
        ("phi[{robot0}]", "'phi[0]' has 1 indices, but a row of 'phi' has the shape (3, 3)"),
        ("phi[-1, 0]", "missing column 'phi[-1, 0]'"),
    ):
        common["phi1"] = replace(common["phi1"], column=column)
        assert words in refused(path, replace(builtin_map("mocobot-arrays"), common=common))


def test_objects_are_never_unpickled(path: Path) -> None:
    class Bomb:
        def __reduce__(self) -> tuple:
            return pytest.fail, ("a pickle was loaded",)

    np.savez(path, **ARRAYS, extra=np.array([Bomb()], dtype=object))
    assert "array 'extra' holds Python objects, which are never loaded" in refused(path)


def test_numbers_beyond_floats_are_infinite(path: Path) -> None:
    """As what came out of a log; no warning on the terminal."""
    np.savez(path, **(ARRAYS | {"phi": np.full((60, 3, 3), 1e308, np.longdouble) * 1e5}))
    common = {**builtin_map("mocobot-arrays").common}
    common["tau1"] = replace(common["tau1"], scale=1e300, offset=1e308)
    log = read_log(path, replace(builtin_map("mocobot-arrays"), common=common))
    assert np.isposinf(log.streams[0].values[:, [0, 1, 2, 6]]).all()


def test_no_rows_is_an_empty_log(path: Path) -> None:
    np.savez(path, **{name: array[:0] for name, array in ARRAYS.items()})
    assert [len(stream.stamp_ns) for stream in read_log(path).streams] == [0, 0, 0]


# Files


def test_files_that_are_no_archives(path: Path) -> None:
    np.savez(path, **ARRAYS)
    content = path.read_bytes()
    for spoiled, words in (
        (b"time,phi\n1,2\n", "is named .npz, but does not begin like one"),
        (b"", "is named .npz, but does not begin like one"),
        (content[:1000], "not a readable NPZ archive, or a damaged one"),
        (content[: len(content) // 2], "not a readable NPZ archive, or a damaged one"),
        (content[:4] + bytes(500), "not a readable NPZ archive, or a damaged one"),
    ):
        path.write_bytes(spoiled)
        assert words in refused(path)


def test_an_archive_of_something_else(path: Path) -> None:
    assert "the columns are none" in refused(archive(path, {"a.txt": b"x"}))


def test_the_same_array_twice(path: Path) -> None:
    archive(path, members())
    with zipfile.ZipFile(path, "a") as file, pytest.warns(UserWarning, match="Duplicate name"):
        file.writestr("phi.npy", npy(RECORDING.phi))
    assert "array 'phi' is in the archive twice" in refused(path)


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
@pytest.mark.parametrize("fortran", [False, True])
def test_a_flipped_bit_in_a_sample_is_found(path: Path, compression: int, fortran: bool) -> None:
    """By the sum over the entry, even where it does not disturb the unpacking."""
    tau = np.asfortranarray(RECORDING.tau) if fortran else RECORDING.tau
    archive(path, members(tau=npy(tau)), compression)
    content = bytearray(path.read_bytes())
    entry = content.rindex(b"PK\x01\x02", 0, content.rindex(b"tau.npy"))
    content[entry + 16] ^= 1  # of the sum: packed data would not unpack
    path.write_bytes(content)
    assert "damaged one (Bad CRC-32" in refused(path)


def test_what_zip_can_but_should_not(path: Path) -> None:
    archive(path, members())
    content = bytearray(path.read_bytes())
    for start in (content.index(b"PK\x03\x04"), content.index(b"PK\x01\x02")):
        content[start + (6 if content[start + 2] == 3 else 8)] |= 1  # encrypted
    path.write_bytes(content)
    assert "damaged one (" in refused(path)
