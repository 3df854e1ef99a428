"""Plain values and arrays in one NPZ file, without pickles: ``facts`` is the bytes of a JSON text."""

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.errors import InputError
from estimator.inputs import Unpacked, open_input, plain


def write_archive(path: Path, facts: Any, arrays: Mapping[str, NDArray[Any]], *, compress: bool) -> None:
    """Write plain values and arrays.

    Raises:
        OSError: it cannot be written.
    """
    told = np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)
    with path.open("wb") as file:
        (np.savez_compressed if compress else np.savez)(file, allow_pickle=False, facts=told, **arrays)


def read_archive(path: Path, what: str) -> tuple[Any, dict[str, NDArray[Any]]]:
    """Read what ``write_archive`` wrote.

    Args:
        path: the file.
        what: it should be, for messages.

    Raises:
        InputError: there is no such file, it is not whole, or unpacks to too much.
    """
    try:
        with open_input(path) as opened, zipfile.ZipFile(opened) as archive:
            refuse_other_packing(archive, str(path))
            Unpacked(str(path), path.stat().st_size).add(sum(entry.file_size for entry in archive.infolist()))
            arrays = {}
            for entry in archive.infolist():
                with archive.open(entry) as file:
                    name = entry.filename.removesuffix(".npy")
                    arrays[name] = np.lib.format.read_array(file, allow_pickle=False)
        if "facts" not in arrays:
            raise InputError(f"{path}: not {what}; 'facts' is missing")
        return plain(json.loads(arrays.pop("facts").tobytes())), arrays
    except InputError:
        raise
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file; it would be {what}") from error
    except Exception as error:  # on damaged bytes numpy and zipfile raise many types
        raise InputError(f"{path}: not {what}, or damaged ({words(error)})") from error


def refuse_other_packing(archive: zipfile.ZipFile, where: str) -> None:
    """Refuse entries packed as numpy never does: Python unpacks these without a limit.

    Raises:
        InputError: there is one.
    """
    for entry in archive.infolist():
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(f"{where}: entry {entry.filename!r:.60} is not packed as numpy does it")


def words(error: Exception) -> str:
    """What a library says of a damaged file, in one line."""
    return " ".join(str(error).split())[:120] or type(error).__name__
