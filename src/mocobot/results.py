"""Base classes of results, which add text and files to the data of the other packages, and their provenance.

Keys of the provenance, in the file of every result or in provenance.json of its folder:

mocobot, python           versions
commit                    commit of the checkout that the package runs from, followed by "+changed" if its sources were
                          edited; null for an installed package
platform                  system, machine and C library
packages                  {name: version} of the libraries that the numbers depend on
command                   name of the command, such as "estimate"
options                   {name: value}: all options that affect the result, including defaults
files                     list of {name, path, bytes, sha256}: inputs, with the path as the user gave it

Nothing depends on the time, place or user of the run, so the same inputs give the same bytes.
"""

import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from estimator.files import file_facts, holds, whole_folder
from mocobot.checks import check_folder
from mocobot.option_types import Options
from mocobot_sim.scene.models import models_dir

PACKAGES = ("dm-control", "joblib", "mujoco", "numba", "numpy", "pyarrow", "scipy")
"""Libraries that can affect the numbers of a result."""
NO_MATTER = ("out", "json", "pictures", "force", "strict", "jobs", "scheduler", "rec")
"""Options that the provenance omits, because the result does not depend on them; recordings are listed as files. It
also omits those of teams where a result is of a single robot."""
FORMAT, VERSION, NAME = "mocobot-provenance", 1, "provenance.json"
SOURCES = ("src", "models", "pyproject.toml")
CODE = ("discrepancy", "estimator", "mocobot", "mocobot_logs", "mocobot_sim")
"""Packages of this project that can affect a result."""
GIT_S = 20.0
Kind = TypeVar("Kind")


def public(kind: type[Kind], below: Any, **more: Any) -> Kind:
    """Convert a result of another package into ``kind``, a subclass of its dataclass, with further fields ``more``."""
    return kind(**{field.name: getattr(below, field.name) for field in fields(below)} | more)


class Folder:
    """Base class of results that are written as a folder; subclasses implement ``write_into``."""

    result: ClassVar[str]

    def to_dict(self) -> dict[str, Any]:
        """Return the result as strict JSON values, with units in the keys."""
        raise NotImplementedError

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> object:
        """Write all files into an existing folder; ``more`` are further keys of the JSON."""
        raise NotImplementedError

    def write(self, folder: Path | str, *, pictures: bool = True) -> None:
        """Write the result as a folder, from which ``mocobot report`` makes a page.

        Args:
            folder: folder to create, or an earlier result of the same kind to replace.
            pictures: whether to draw pictures.

        Raises:
            InputError: the folder holds something else, or cannot be written.
        """
        check_folder(Path(folder), [], holds(self.result), f"an earlier {self.result}", force=True)
        with whole_folder(Path(folder), self.result) as whole:
            self.write_into(whole, pictures=pictures)


def provenance(command: str, options: Any, inputs: Sequence[Path] = ()) -> dict[str, Any]:
    """Return the provenance of a result as plain JSON values; the module's docstring lists the keys.

    Args:
        command: name of the command.
        options: dataclass of options, or values by name; paths and tuples become strings and lists.
        inputs: input files, or folders of such files.

    Raises:
        InputError: an input cannot be read.
    """
    values = options if isinstance(options, Mapping) else asdict(options)
    omitted = {
        *NO_MATTER,
        *(options.OF_TEAMS if values.get("model") and isinstance(options, Options) else ()),
    }
    system = (platform.system(), platform.machine(), *platform.libc_ver())
    return {
        "mocobot": version_of("mocobot"),
        "commit": commit_of(Path(__file__).resolve().parents[2]),
        "python": platform.python_version(),
        "platform": " ".join(part for part in system if part),
        "packages": {name: found for name in PACKAGES if (found := version_of(name)) is not None},
        "command": command,
        "options": {name: _plain(value) for name, value in values.items() if name not in omitted},
        "files": [file_facts(file) for path in inputs for file in _files(path)],
    }


def folder_provenance(made_with: Mapping[str, Any], folder: Path, written: Iterable[Path]) -> dict[str, Any]:
    """Return the content of ``provenance.json`` of a result folder.

    Args:
        made_with: return value of ``provenance``.
        folder: folder of the result.
        written: files of the result in that folder; ``written`` lists them like ``files``, with relative paths.

    Raises:
        InputError: a file cannot be read.
    """
    listed = [file_facts(path) | {"path": path.relative_to(folder).as_posix()} for path in written]
    head = {"format": FORMAT, "version": VERSION, **made_with}
    return head | {"written": sorted(listed, key=lambda f: f["path"])}


def _files(path: Path) -> list[Path]:
    """List a file itself, or all files of a folder."""
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


def version_of(package: str) -> str | None:
    """Version of a package, or None if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def commit_of(root: Path) -> str | None:
    """Commit of the git checkout at ``root``; None if ``root`` is not the top folder of one."""
    if not (root / "src" / "mocobot" / Path(__file__).name).is_file():
        return None
    top, head = _git(root, "rev-parse", "--show-toplevel"), _git(root, "rev-parse", "HEAD")
    if not top or not head or Path(top).resolve() != root:
        return None
    changed = _git(root, "status", "--porcelain", "--", *SOURCES)
    return None if changed is None else head + ("+changed" if changed else "")


def _git(root: Path, *arguments: str) -> str | None:
    """Run git and return its output, or None on failure; without locks or the variables of a git hook."""
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
    """Convert the value of an option to plain JSON."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, os.PathLike) else value


@cache
def code_digest() -> str:
    """SHA-256 of the code and the models that can affect a result."""
    top, found = Path(__file__).resolve().parents[1], hashlib.sha256()
    sources = [path for name in CODE for path in sorted((top / name).rglob("*.py"))]
    models = sorted(path for path in models_dir().rglob("*") if path.suffix in (".xml", ".toml"))
    for path in [*sources, *models]:
        found.update(path.name.encode())
        found.update(path.read_bytes())
    return found.hexdigest()


def run_key(options: Mapping[str, Any]) -> str:
    """Hash options, code, models and versions to 16 digits; a run may reuse partial results with the same key."""
    versions = {name: version_of(name) for name in PACKAGES}
    words = json.dumps([dict(options), versions, code_digest()], sort_keys=True, default=str)
    return hashlib.sha256(words.encode()).hexdigest()[:16]
