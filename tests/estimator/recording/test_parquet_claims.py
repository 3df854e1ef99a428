"""Recordings whose footers or pages claim gigabytes are refused before memory is taken."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator.inputs import set_max_unpacked
from estimator.recording.parquet import METADATA_KEY, claimed_bytes, read_recording, write_recording
from recordings import small_recording

LIMIT = """
import atexit, re, resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))  # libraries reserve more than they use
status = Path("/proc/self/status")  # of Linux; what getrusage tells there includes the parent before it ran this
peak = lambda: re.search(r"VmHWM:\\s*(\\d+)", status.read_text())[1] if status.is_file() else 0
atexit.register(lambda: print(peak()))
from mocobot.cli import main
main(sys.argv[1:])
"""


@pytest.fixture(scope="module")
def bomb(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 30 million rows of zeros, 8.7 GiB, in 5 MB."""
    path = tmp_path_factory.mktemp("bomb") / "rec.parquet"
    recording, zeros = small_recording(rows=10), np.zeros(1 << 20)
    names, text = ["time", *recording.columns()], recording.metadata.to_json().encode()
    block = pa.table({name: zeros for name in dict.fromkeys(names)}).replace_schema_metadata(
        {METADATA_KEY: text}
    )
    with pq.ParquetWriter(path, block.schema) as writer:
        for _ in range(30):
            writer.write_table(block)
    return path


@pytest.mark.parametrize("command", ["estimate", "inspect", "replay --save a.rrd", "diagnose"])
def test_a_bomb_is_refused_in_bounded_memory(bomb: Path, command: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LIMIT, *command.split(), str(bomb)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith(f"mocobot: {bomb}: unpacks to at least 8.67")
    assert "GiB, which --max-unpacked GIB changes" in done.stderr
    assert int(done.stdout.split()[-1]) < 1 << 20  # KiB in use at the peak


def test_the_option_changes_the_limit(bomb: Path, tmp_path: Path) -> None:
    arguments = [sys.executable, "-m", "mocobot", "inspect", str(bomb), "--max-unpacked"]
    done = subprocess.run([*arguments, "0.5"], capture_output=True, text=True, timeout=60, check=False)
    assert "the limit is 0.5 GiB" in done.stderr
    done = subprocess.run([*arguments, "-1"], capture_output=True, text=True, timeout=60, check=False)
    assert done.stderr == "mocobot: --max-unpacked is -1; it must be above 0 and at most 1e6 GiB\n"
    write_recording(small_recording(rows=50), path := tmp_path / "small.parquet")
    set_max_unpacked(1e-9)
    try:
        assert len(read_recording(path).time) == 50  # never below a file's own size
    finally:
        set_max_unpacked(None)


def varint(value: int, length: int = 0) -> bytes:
    """A whole number of Thrift's compact protocol, in so many bytes."""
    value, parts = value << 1, []
    while value or len(parts) < max(length, 1):
        parts.append(value & 127)
        value >>= 7
    return bytes([*(part | 128 for part in parts[:-1]), parts[-1]])


def test_pages_are_counted_whatever_the_footer_says(tmp_path: Path) -> None:
    """A page of 8 MiB under a footer that tells of 1000 values."""
    path, rows = tmp_path / "a.parquet", 1 << 20
    pq.write_table(
        pa.table({"a": np.zeros(rows), "b.c": np.zeros(rows)}), path, compression="zstd", use_dictionary=False,
        write_statistics=False, data_page_size=1 << 30, write_batch_size=rows, max_rows_per_page=rows,
    )  # fmt: skip
    honest = pq.ParquetFile(path).metadata.row_group(0).column(0).total_uncompressed_size
    assert claimed_bytes(path, ["a", "b.c"], ["b.c"]) == honest > 8 * rows
    content = path.read_bytes()
    begin = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    footer = content[begin:]
    for value, told in ((rows, 1000), (honest, 9000)):
        assert varint(value) in footer
        footer = footer.replace(varint(value), varint(told, len(varint(value))))
    path.write_bytes(content[:begin] + footer)
    assert pq.ParquetFile(path).metadata.num_rows == 1000
    assert claimed_bytes(path, ["a", "b.c"], ["a"]) > 8 * rows - 100


def test_lists_are_counted_by_their_values(tmp_path: Path) -> None:
    pq.write_table(pa.table({"a": [[0.0] * 5000] * 20, "other": [1.0] * 20}), path := tmp_path / "a.parquet")
    columns = [pq.ParquetFile(path).schema.column(k).path for k in range(2)]
    assert claimed_bytes(path, columns, ["a"]) >= 8 * 100_000
    assert claimed_bytes(path, columns, ["other"]) < 8 * 100_000
