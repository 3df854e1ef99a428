"""What a log is: told from its first bytes, or from what its folder holds, without the libraries that read it."""

from pathlib import Path
from typing import Literal

from estimator.errors import InputError
from mocobot_logs.faults import detail_of

OutputKind = Literal["parquet", "csv", "npz", "mcap", "sqlite3", "folder"]
SUFFIXES: dict[str, OutputKind] = {
    ".parquet": "parquet",
    ".csv": "csv",
    ".npz": "npz",
    ".mcap": "mcap",
    ".db3": "sqlite3",
    "": "folder",
}
"""What is written, by the target's suffix; a bag's folder has none."""


def output_kind(path: Path) -> OutputKind:
    """What a target is to hold.

    Raises:
        InputError: nothing is written under such a name.
    """
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
DATASET_INFO = Path("meta") / "info.json"
"""Of a LeRobot dataset."""
PARQUET = b"PAR1"
"""First and last bytes of every Parquet file (parquet.apache.org/docs/file-format)."""
ZIP = b"PK\x03\x04", b"PK\x05\x06"
MATLAB = b"MATL"


def log_kind(path: Path) -> Kind:
    """What a log is; a recording that merely lies in a dataset is none of its data.

    Raises:
        InputError: there is no such log, or its format is not known.
    """
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
    except (OSError, ValueError) as error:  # a name too long for the system, or with a NUL in it
        if isinstance(error, InputError):
            raise
        raise InputError(f"{str(path)!r:.80}: not a usable file name ({detail_of(error)})") from error
    if head == PARQUET:
        if dataset_root(path) is None:
            return "parquet"
        from mocobot_logs.table.parquet import is_recording  # takes time

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


def is_bag(path: Path) -> bool:
    """Whether a path is meant as a bag: a folder with a bag's files, or a file that begins or is named like one."""
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
    """Whether a file is named like one of a bag."""
    return path.name.lower().endswith(BAG_SUFFIXES)


def dataset_root(path: Path) -> Path | None:
    """The LeRobot dataset that a path is, or whose data file it is; None if it is neither."""
    for folder in (path, *(path.parents[2:3] if path.is_file() else ())):
        if (folder / DATASET_INFO).is_file():
            return folder
    return None
