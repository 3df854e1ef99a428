"""Recordings that a result was made from, if they are still where its provenance says and have not changed."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimator.errors import InputError
from estimator.inputs import file_sha256
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording

SUFFIX = ".parquet"


@dataclass(frozen=True)
class Source:
    """One recording.

    Attributes:
        name: of the file.
        path: where it is, or None.
        why: why it is not used, a sentence without its end; empty if it is.
    """

    name: str
    path: Path | None
    why: str = ""

    def recording(self) -> Recording:
        """Read it.

        Raises:
            InputError: it is not used, or cannot be read.
        """
        if self.path is None:
            raise InputError(self.why)
        return read_recording(self.path)


def sources(provenance: dict[str, Any] | None, folder: Path) -> list[Source]:
    """Recordings that a provenance lists.

    Each is sought where the user named it (from the current folder on), beside the result, and under its name there;
    the hash must be the same.
    """
    files = provenance.get("files") if isinstance(provenance, dict) else None
    listed = files if isinstance(files, list) else []
    return [
        _found(entry, folder)
        for entry in listed
        if isinstance(entry, dict) and str(entry.get("path", "")).endswith(SUFFIX)
    ]


def _found(entry: dict[str, Any], folder: Path) -> Source:
    name, changed = str(entry.get("name", "")), False
    given = entry["path"]
    for path in (Path(given), folder / given, folder / name, folder.parent / name):
        try:
            same = file_sha256(path) == entry.get("sha256")
        except (OSError, ValueError):  # a name with a NUL
            continue
        if same:
            return Source(name, path)
        changed = True
    if changed:
        return Source(name, None, f"{name} is no longer the file that the result was made from")
    return Source(name, None, f"{name} is no longer where it was ({entry['path']})")
