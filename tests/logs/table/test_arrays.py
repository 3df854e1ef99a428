"""NPZ archives and MATLAB files: read in step, never an object, no claim believed."""

from __future__ import annotations

import io
import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from estimator import inputs
from estimator.inputs import set_max_unpacked
from log_files import assert_same, read_log, refused
from mocobot_logs.maps import CsvMap
from mocobot_logs.open_log import open_table
from mocobot_logs.table import table as tables
from mocobot_logs.table.table import Wanted
from recordings import metadata, small_recording

RECORDING = small_recording(rows=60)
ARRAYS = {name: getattr(RECORDING, name) for name in ("time", "phi", "theta", "tau", "ref")}


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


def test_metadata_travel_along(path: Path) -> None:
    np.savez(path, mocobot=np.array(metadata(payload="a").to_json()), **ARRAYS)
    log = read_log(path)
    assert log.metadata == metadata(payload="a")
    assert_same(log, RECORDING)


# Claims


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


def test_objects_are_never_unpickled(path: Path) -> None:
    class Bomb:
        def __reduce__(self) -> tuple:
            return pytest.fail, ("a pickle was loaded",)

    np.savez(path, **ARRAYS, extra=np.array([Bomb()], dtype=object))
    assert "array 'extra' holds Python objects, which are never loaded" in refused(path)


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


MAT_RECORDING = small_recording(rows=60)
MAT_ARRAYS = {name: getattr(MAT_RECORDING, name) for name in ("time", "phi", "theta", "tau", "ref")}
HEADER = b"MATLAB 5.0 MAT-file".ljust(124)
TYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 9, "i8": 12, "u8": 13}


@pytest.fixture
def path_of_mat(tmp_path: Path) -> Path:
    return tmp_path / "log.mat"


def element(kind: int, data: bytes, order: str = "<", count: int | None = None) -> bytes:
    """Type, number of bytes, data: packed into eight bytes where there are four at most, as MATLAB does."""
    count = len(data) if count is None else count
    if len(data) == count <= 4 and kind != 14:
        return struct.pack(f"{order}I", count << 16 | kind) + data.ljust(4, b"\0")
    return struct.pack(f"{order}II", kind, count) + data + bytes(-len(data) % 8)


def matrix(
    name: str, values: np.ndarray, order: str = "<", stored: str | None = None, flags: int = 6, **claims
) -> bytes:
    """A matrix as an element; ``claims`` are of its shape and bytes."""
    stored = stored or values.dtype.str[1:]
    raw = values.astype(f"{order}{stored}").tobytes(order="F")
    shape = claims.get("shape", values.shape)
    inside = element(6, struct.pack(f"{order}II", flags, 0), order)
    inside += element(5, struct.pack(f"{order}{len(shape)}i", *shape), order) + element(
        1, name.encode(), order
    )
    return element(14, inside + element(TYPES[stored], raw, order, claims.get("count")), order)


def packed(content: bytes) -> bytes:
    raw = zlib.compress(content)
    return struct.pack("<II", 15, len(raw)) + raw


def saved(path_of_mat: Path, *elements: bytes, order: str = "<") -> Path:
    mark = {"<": b"\x00\x01IM", ">": b"\x01\x00MI"}[order]
    path_of_mat.write_bytes(HEADER + mark + b"".join(elements))
    return path_of_mat


def columns(path_of_mat: Path, *names: str) -> dict[str, np.ndarray]:
    """Whole columns, of a table whose time is ``t`` [s]."""
    table = open_table(path_of_mat, "mat", CsvMap())
    blocks = list(table.blocks(Wanted(names, ("t",), 1_000_000_000), lambda _: None))
    found = {name: np.concatenate([block.columns[name] for block in blocks]) for name in names}
    return found | {"t": np.concatenate([block.clocks["t"][0] for block in blocks])}


T = np.arange(5) / 4.0
GOOD = matrix("t", T[:, None])


# What is written


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("cells", [1 << 20, 700])
def test_a_recording_comes_back(path_of_mat: Path, monkeypatch, compressed: bool, cells: int) -> None:
    monkeypatch.setattr(tables, "CELLS", cells)
    savemat(path_of_mat, MAT_ARRAYS, do_compression=compressed, oned_as="column")
    assert_same(read_log(path_of_mat), MAT_RECORDING)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("stored", list(TYPES))
def test_numbers_of_every_type_and_byte_order(path_of_mat: Path, order: str, stored: str) -> None:
    """MATLAB stores doubles in the smallest type that holds them."""
    q = np.array([[1.0], [0.0], [3.0], [2.0], [100.0]])
    content = [matrix("t", T[:, None], order), matrix("q", q, order, stored)]
    assert columns(saved(path_of_mat, *content, order=order), "q")["q"].tolist() == q[:, 0].tolist()


def test_rows_columns_and_matrices(path_of_mat: Path) -> None:
    q = np.arange(15.0).reshape(5, 3)
    content = [
        packed(matrix("t", T[None])),
        packed(matrix("q", q)),
        matrix("on", q[:, :1] > 3, stored="u1", flags=0x209),
    ]
    found = columns(saved(path_of_mat, *content), "q", "on")
    assert np.array_equal(found["q"], q)
    assert found["on"].tolist() == [0, 0, 1, 1, 1]
    assert found["t"].tolist() == [0, 250_000_000, 500_000_000, 750_000_000, 1_000_000_000]


def test_what_is_no_matrix_of_real_numbers_is_left_out(path_of_mat: Path) -> None:
    cell = np.empty(2, object)
    cell[:] = ["a", 1.0]
    savemat(
        path_of_mat, {"t": T, "q": T, "s": {"a": T}, "c": cell, "w": "text", "z": T + 1j}, oned_as="column"
    )
    assert set(open_table(path_of_mat, "mat", CsvMap()).shapes) == {"t", "q"}


def test_memory_stays_small(path_of_mat: Path) -> None:
    count = 1_000_000
    savemat(
        path_of_mat,
        {"t": np.arange(count) / 1e3, "q": np.zeros(count)},
        do_compression=True,
        oned_as="column",
    )
    table = open_table(path_of_mat, "mat", CsvMap())
    tracemalloc.start()
    rows = sum(len(b.columns["q"]) for b in table.blocks(Wanted(("q",), ("t",), 10**9), lambda _: None))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert rows == count
    assert most < 60e6


# What is refused


def edited(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    def write(path_of_mat: Path) -> None:
        savemat(path_of_mat, MAT_ARRAYS, do_compression=True)
        path_of_mat.write_bytes(change(path_of_mat.read_bytes()))

    return write


REFUSED: dict[str, tuple[Callable[[Path], object], str]] = {
    "empty": (lambda p: p.write_bytes(b""), "is not a MATLAB file of level 5, or a damaged one; save it with -v7"),
    "level 4": (lambda p: savemat(p, {"t": T}, format="4"), "is not a MATLAB file of level 5"),
    "7.3": (
        lambda p: p.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512)), "is a MATLAB 7.3 file, which is not read; save it"
    ),
    "cut in a variable": (edited(lambda b: b[:700]), "is cut off: the variable from byte"),
    "cut in a tag": (edited(lambda b: b[:130]), "not a readable MATLAB file, or a damaged one (2 of 8"),
    "zeros": (edited(lambda b: b[:128] + bytes(64)), "is damaged: byte 128 begins an element of type 0"),
    "bad zlib": (edited(lambda b: b[:140] + bytes(9) + b[149:]), "not a readable MATLAB file, or a damaged one ("),
    "only text": (lambda p: savemat(p, {"w": "text"}), "holds no matrix of real numbers; save each column as a vector"),
    "twice": (lambda p: saved(p, GOOD, packed(GOOD)), "variable 't' is in the file twice"),
    "more than there is": (
        lambda p: saved(p, matrix("t", T[:, None], shape=(1 << 30, 1))),
        "variable 't' claims 8589934592 bytes of numbers, but has 40",
    ),
    "beyond its element": (
        lambda p: saved(p, GOOD[:4] + struct.pack("<I", 56) + GOOD[8:]), "variable 't' goes beyond its 56 bytes"
    ),
    "negative": (lambda p: saved(p, matrix("t", T[:, None], shape=(-5, -1))), "variable 't' is damaged"),
    "packed text": (lambda p: saved(p, packed(element(1, b"a" * 16))), "what is packed at byte 128 is no matrix"),
    "long name": (lambda p: saved(p, matrix("t" * 2000, T[:, None])), "is damaged: a header has an element of 2000"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_damage_is_told_in_one_sentence(path_of_mat: Path, name: str) -> None:
    write, said = REFUSED[name]
    write(path_of_mat)
    assert said in refused(path_of_mat)


def test_a_team_needs_the_maps_columns(path_of_mat: Path) -> None:
    savemat(path_of_mat, {"t": T})
    assert "missing column" in refused(path_of_mat)
    assert "`mocobot map" in refused(path_of_mat)
