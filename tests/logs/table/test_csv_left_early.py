"""A CSV file that is left before its end, at a fault or at rows that are enough, ends the process like any other."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import sys
from pathlib import Path
from estimator.errors import InputError
from mocobot_logs.maps import CsvMap
from mocobot_logs.table import csv
from mocobot_logs.table.table import Wanted

csv.BLOCK_BYTES = 4096
for _ in range(60):
    blocks = csv.CsvTable(Path(sys.argv[1]), CsvMap(), "log").blocks(Wanted(("a",), (), 1), lambda _: None)
    try:
        next(blocks)
        next(blocks)
    except InputError as error:
        print(error)
"""


@pytest.mark.parametrize("fault", [None, 30, 100])
def test_a_file_left_early(tmp_path: Path, fault: int | None) -> None:
    """pyarrow's streaming reader had its thread abort or hang the process, most times out of ten."""
    rows = [f"{k},{k}.5,{'x' * 40}" for k in range(20_000)]
    if fault is not None:
        rows[fault] = f"oops{rows[fault]}"
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["a,b,c", *rows]))
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, path], capture_output=True, text=True, timeout=30, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
        said = (
            ""
            if fault is None
            else f"log: column 'a' holds 'oops{fault}' in line {fault + 2}; it must hold numbers\n"
        )
        assert done.stdout == said * 60
