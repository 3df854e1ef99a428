"""Where a result comes from: versions, options and the hashes of the files it was made from.

mocobot, python           versions
commit                    of the checkout that the package runs from, "+changed" behind it where sources differ from the
                          commit; null for an installed package
platform                  system, machine and C library
packages                  {name: version} of the libraries that the numbers depend on
command                   such as "estimate"
options                   {name: value}: everything the result depends on, defaults included
files                     list of {name, path, bytes, sha256}: inputs, the path as the user gave it

Nothing in it depends on when, where or by whom the command was run, so the same inputs give the same bytes.
"""

import os
import platform
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from estimator.files import file_facts

PACKAGES = ("dm-control", "joblib", "mujoco", "numba", "numpy", "pyarrow", "scipy")
"""Libraries that a result's numbers pass through."""
NO_MATTER = ("out", "force", "strict", "jobs", "scheduler", "rec")
"""Options that are not listed: results do not depend on where they go, on what they replace, on the exit code or on the
number of processes, and recordings are listed as files."""
FORMAT, VERSION, NAME = "mocobot-provenance", 1, "provenance.json"
SOURCES = ("src", "models", "pyproject.toml")
GIT_S = 20.0


def provenance(command: str, options: Mapping[str, Any], inputs: Sequence[Path] = ()) -> dict[str, Any]:
    """Say what a result was made with and from, as plain JSON values with the keys documented above.

    Args:
        command: name of the command.
        options: by name; paths and tuples become strings and lists.
        inputs: files the result was made from, or folders of such files.

    Raises:
        InputError: an input cannot be read.
    """
    return {
        "mocobot": version_of("mocobot"),
        "commit": _commit(Path(__file__).resolve().parents[3]),
        "python": platform.python_version(),
        "platform": " ".join(
            part for part in (platform.system(), platform.machine(), *platform.libc_ver()) if part
        ),
        "packages": {name: found for name in PACKAGES if (found := version_of(name)) is not None},
        "command": command,
        "options": {name: _plain(value) for name, value in options.items() if name not in NO_MATTER},
        "files": [file_facts(file) for path in inputs for file in _files(path)],
    }


def folder_provenance(made_with: Mapping[str, Any], folder: Path, written: Iterable[Path]) -> dict[str, Any]:
    """The content of a result folder's ``provenance.json``.

    Args:
        made_with: what ``provenance`` says.
        folder: that of the result.
        written: files of this result inside it; they are listed under ``written`` like ``files``, with paths from the
            folder on.

    Raises:
        InputError: a file cannot be read.
    """
    listed = [file_facts(path) | {"path": path.relative_to(folder).as_posix()} for path in written]
    return {
        "format": FORMAT,
        "version": VERSION,
        **made_with,
        "written": sorted(listed, key=lambda f: f["path"]),
    }


def _files(path: Path) -> list[Path]:
    """A file, or all files of a folder."""
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


def version_of(package: str) -> str | None:
    """Version of an installed package, or None."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _commit(root: Path) -> str | None:
    """Commit of the checkout at ``root``, or None where that is not the top of one."""
    if not (root / "src" / "mocobot" / "files" / Path(__file__).name).is_file():
        return None
    top, head = _git(root, "rev-parse", "--show-toplevel"), _git(root, "rev-parse", "HEAD")
    if not top or not head or Path(top).resolve() != root:
        return None
    changed = _git(root, "status", "--porcelain", "--", *SOURCES)
    return None if changed is None else head + ("+changed" if changed else "")


def _git(root: Path, *arguments: str) -> str | None:
    """Output of git, or None where it fails; it must not take locks, nor look where a hook's variables point."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    try:
        done = subprocess.run(
            ["git", "--no-optional-locks", "-C", str(root), *arguments],
            env=env, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=GIT_S, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired, UnicodeDecodeError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def _plain(value: Any) -> Any:
    """Plain JSON of an option."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, os.PathLike) else value
