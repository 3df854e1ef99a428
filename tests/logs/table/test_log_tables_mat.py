"""MATLAB logs: matrices as MATLAB and others save them, and files that claim, hide or lack what they should hold."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from estimator.errors import InputError
from estimator.inputs import set_max_unpacked
from log_files import assert_same, read_log, refused
from mocobot_logs.maps import CsvMap
from mocobot_logs.open_log import open_table
from mocobot_logs.table import table as tables
from mocobot_logs.table.table import Wanted
from recordings import small_recording

RECORDING = small_recording(rows=60)
ARRAYS = {name: getattr(RECORDING, name) for name in ("time", "phi", "theta", "tau", "ref")}
HEADER = b"MATLAB 5.0 MAT-file".ljust(124)
TYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 9, "i8": 12, "u8": 13}


@pytest.fixture
def path(tmp_path: Path) -> Path:
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


def saved(path: Path, *elements: bytes, order: str = "<") -> Path:
    mark = {"<": b"\x00\x01IM", ">": b"\x01\x00MI"}[order]
    path.write_bytes(HEADER + mark + b"".join(elements))
    return path


def columns(path: Path, *names: str) -> dict[str, np.ndarray]:
    """Whole columns, of a table whose time is ``t`` [s]."""
    table = open_table(path, "mat", CsvMap())
    blocks = list(table.blocks(Wanted(names, ("t",), 1_000_000_000), lambda _: None))
    found = {name: np.concatenate([block.columns[name] for block in blocks]) for name in names}
    return found | {"t": np.concatenate([block.clocks["t"][0] for block in blocks])}


T = np.arange(5) / 4.0
GOOD = matrix("t", T[:, None])


# What is written


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("cells", [1 << 20, 700])
def test_a_recording_comes_back(path: Path, monkeypatch, compressed: bool, cells: int) -> None:
    monkeypatch.setattr(tables, "CELLS", cells)
    savemat(path, ARRAYS, do_compression=compressed, oned_as="column")
    assert_same(read_log(path), RECORDING)


def test_the_format_shows_in_the_first_bytes(path: Path) -> None:
    savemat(path, ARRAYS)
    other = path.rename(path.with_suffix(".log"))
    assert_same(read_log(other), RECORDING)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("stored", list(TYPES))
def test_numbers_of_every_type_and_byte_order(path: Path, order: str, stored: str) -> None:
    """MATLAB stores doubles in the smallest type that holds them."""
    q = np.array([[1.0], [0.0], [3.0], [2.0], [100.0]])
    content = [matrix("t", T[:, None], order), matrix("q", q, order, stored)]
    assert columns(saved(path, *content, order=order), "q")["q"].tolist() == q[:, 0].tolist()


def test_rows_columns_and_matrices(path: Path) -> None:
    q = np.arange(15.0).reshape(5, 3)
    content = [
        packed(matrix("t", T[None])),
        packed(matrix("q", q)),
        matrix("on", q[:, :1] > 3, stored="u1", flags=0x209),
    ]
    found = columns(saved(path, *content), "q", "on")
    assert np.array_equal(found["q"], q)
    assert found["on"].tolist() == [0, 0, 1, 1, 1]
    assert found["t"].tolist() == [0, 250_000_000, 500_000_000, 750_000_000, 1_000_000_000]


def test_a_single_row_has_small_elements(path: Path) -> None:
    content = [matrix("t", np.ones((1, 1)), stored="u1"), matrix("q", np.full((1, 1), 7.0), stored="i2")]
    assert columns(saved(path, *content), "q")["q"].tolist() == [7]


def test_what_is_no_matrix_of_real_numbers_is_left_out(path: Path) -> None:
    cell = np.empty(2, object)
    cell[:] = ["a", 1.0]
    savemat(path, {"t": T, "q": T, "s": {"a": T}, "c": cell, "w": "text", "z": T + 1j}, oned_as="column")
    assert set(open_table(path, "mat", CsvMap()).shapes) == {"t", "q"}


def test_memory_stays_small(path: Path) -> None:
    count = 1_000_000
    savemat(path, {"t": np.arange(count) / 1e3, "q": np.zeros(count)}, do_compression=True, oned_as="column")
    table = open_table(path, "mat", CsvMap())
    tracemalloc.start()
    rows = sum(len(b.columns["q"]) for b in table.blocks(Wanted(("q",), ("t",), 10**9), lambda _: None))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert rows == count
    assert most < 60e6


# What is refused


def edited(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        savemat(path, ARRAYS, do_compression=True)
        path.write_bytes(change(path.read_bytes()))

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
def test_damage_is_told_in_one_sentence(path: Path, name: str) -> None:
    write, said = REFUSED[name]
    write(path)
    assert said in refused(path)


def test_other_numbers_of_rows(path: Path) -> None:
    saved(path, GOOD, matrix("q", np.zeros((3, 5))))
    with pytest.raises(InputError, match=r"variable 'q' has 3 rows, but 't' has 5; all must have as many"):
        columns(path, "q")


def test_what_unpacks_to_too_much_is_refused_before_it_is_read(path: Path) -> None:
    big = np.zeros((1 << 17, 1))
    saved(path, packed(matrix("t", np.arange(float(1 << 17))[:, None])), packed(matrix("q", big)))
    set_max_unpacked(1e-3)
    try:
        with pytest.raises(InputError, match=r"unpacks to at least 0\.00\d+ GiB"):
            columns(path, "q")
    finally:
        set_max_unpacked(None)


def test_packed_numbers_that_end_early(path: Path) -> None:
    whole = matrix("q", np.zeros((5, 1)))
    saved(path, GOOD, packed(whole[:-16]))
    with pytest.raises(InputError, match="not a readable MATLAB file, or a damaged one"):
        columns(path, "q")


def test_a_team_needs_the_maps_columns(path: Path) -> None:
    savemat(path, {"t": T})
    assert "missing column" in refused(path)
    assert "`mocobot map" in refused(path)
