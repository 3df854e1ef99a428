"""Identify the format of a log from its first bytes or its folder, and report damaged files.

Libraries that read logs are imported elsewhere, since that takes time.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Literal

from estimator.errors import InputError
from estimator.files import system_errors
from estimator.inputs import open_input, printable

LONGEST = 200
readable = partial(system_errors, done="read")
"""Context manager that turns errors of the operating system into one sentence: that a file cannot be read."""


def read_small(path: Path, most_bytes: int, where: str, kind: str) -> bytes:
    """Read a small file of metadata; ``where`` and ``kind`` name file and content in messages."""
    with readable(where), open_input(path) as file:
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise InputError(f"{where}: is larger than {most_bytes >> 20} MiB, which no {kind} is")
    return content


def detail_of(error: BaseException) -> str:
    """Return the first line of an error's message, printable and short, or its type if there is none."""
    lines = str(error).splitlines()
    return shown(lines[0].strip() if lines else "", LONGEST) or type(error).__name__


def shown(text: str, longest: int = 60) -> str:
    """Return text of a file in a form that a terminal can show."""
    return printable(text[:longest], keep="")[:longest]


@contextmanager
def told_in_one_sentence(where: str, kind: str) -> Iterator[None]:
    """Turn every error of a library inside the block into one sentence about the file."""
    try:
        yield
    except InputError:
        raise
    except PermissionError as error:
        raise InputError(f"{where}: cannot be read (permission denied)") from error
    except Exception as error:  # for damaged bytes libraries raise many types, not all of them their own
        raise InputError(f"{where}: not a readable {kind}, or a damaged one ({detail_of(error)})") from error


OutputKind = Literal["parquet", "csv", "npz", "mcap", "sqlite3", "folder"]
SUFFIXES: dict[str, OutputKind] = {
    ".parquet": "parquet", ".csv": "csv", ".npz": "npz", ".mcap": "mcap", ".db3": "sqlite3", "": "folder",
}  # fmt: skip
"""Output formats by suffix of the target; a bag's folder has none."""


def output_kind(path: Path) -> OutputKind:
    """Return the output format of a target by its suffix."""
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None or not path.name:
        known = ", ".join(suffix for suffix in SUFFIXES if suffix)
        raise InputError(f"{path}: the name must end in one of {known}, or have no suffix (a bag's folder)")
    return kind


Kind = Literal["bag", "csv", "mat", "npz", "parquet", "lerobot"]
TEXT_SUFFIXES = (".csv", ".tsv", ".txt")
FORMATS = (
    "a rosbag2 folder, .mcap or .db3, a CSV file (.csv, .tsv, .txt), an .npz archive, a MATLAB file (.mat), a "
    ".parquet file or a LeRobot dataset"
)
MCAP, SQLITE, ROS1 = b"\x89MCAP0\r\n", b"SQLite format 3\x00", b"#ROSBAG"
"""First bytes of a bag's files."""
BAG_METADATA = "metadata.yaml"
BAG_SUFFIXES = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd")
DATASET_INFO = Path("meta") / "info.json"  # description of a LeRobot dataset
PARQUET = b"PAR1"  # first and last bytes of every Parquet file (parquet.apache.org/docs/file-format)
ZIP = b"PK\x03\x04", b"PK\x05\x06"
MATLAB = b"MATL"


def log_kind(path: Path) -> Kind:
    """Return the format of a log; a recording inside a dataset's folder does not belong to the dataset."""
    try:
        if not path.exists():
            raise InputError(f"{path}: there is no such file")
        if path.is_dir():
            if dataset_root(path) is not None:
                return "lerobot"
            if is_bag(path):
                return "bag"
            raise InputError(f"{path}: is a directory, and neither a rosbag2 bag nor a LeRobot dataset")
        if not path.is_file():
            raise InputError(f"{path}: is not a regular file; a log is {FORMATS}")
        with path.open("rb") as file:
            head = file.read(4)
    except PermissionError as error:
        raise InputError(f"{path}: cannot be read (permission denied)") from error
    except (OSError, ValueError) as error:  # a name too long for the system, or with a NUL
        if isinstance(error, InputError):
            raise
        raise InputError(f"{str(path)!r:.80}: not a usable file name ({detail_of(error)})") from error
    if head == PARQUET:
        if dataset_root(path) is None:
            return "parquet"
        return "parquet" if is_recording(path) else "lerobot"
    if head in ZIP:
        return "npz"
    suffix = path.suffix.lower()
    if suffix in TEXT_SUFFIXES:
        return "csv"
    if head == MATLAB or suffix == ".mat":
        return "mat"
    if is_bag(path):
        return "bag"
    if suffix in (".npz", ".parquet", ".mcap", ".db3"):
        raise InputError(
            f"{path}: is named {suffix}, but does not begin like one; it is damaged or something else"
        )
    raise InputError(f"{path}: is of no known format; a log is {FORMATS}")


def is_recording(path: Path) -> bool:
    import pyarrow.parquet as pq

    from estimator.recording.parquet import METADATA_KEY

    with told_in_one_sentence(str(path), "Parquet file"), pq.ParquetFile(path) as file:
        return METADATA_KEY in (file.schema_arrow.metadata or {})


def is_bag(path: Path) -> bool:
    """Return whether a path is a bag: a folder with a bag's files, or a file with a bag's first bytes or suffix."""
    try:
        if path.is_dir():
            return (path / BAG_METADATA).exists() or any(has_bag_suffix(entry) for entry in path.iterdir())
        if not path.is_file():
            return False
        with path.open("rb") as file:
            head = file.read(16)
        return has_bag_suffix(path) or head.startswith((MCAP, SQLITE, ROS1))
    except (OSError, ValueError):
        return False


def has_bag_suffix(path: Path) -> bool:
    return path.name.lower().endswith(BAG_SUFFIXES)


def dataset_root(path: Path) -> Path | None:
    """Return the LeRobot dataset that a path is or belongs to; None if there is none."""
    for folder in (path, *(path.parents[2:3] if path.is_file() else ())):
        if (folder / DATASET_INFO).is_file():
            return folder
    return None
