"""Outcomes of an experiment's tasks on disk, so that an interrupted run goes on where it ended."""

import shutil
from pathlib import Path
from typing import Any

import joblib

from estimator.errors import InputError
from estimator.files import make_folder, system_errors, whole_file

FOLDER = "partial"
"""In the folder of the results, until all is done."""


class Store:
    """A folder of outcomes, a file each, that appear whole or not at all.

    They are Python's own (pickled by joblib), so that a run which goes on has the same bits as one that was never
    interrupted; only the same code reads them, and nobody else's should be.
    """

    def __init__(self, out: Path, key: str, *, force: bool) -> None:
        """Open the store in a folder of results.

        Args:
            out: that folder.
            key: of everything that outcomes depend on; a run with another one has nothing to do with this.
            force: drop what another run left there.

        Raises:
            InputError: another run left something there, or it cannot be written.
        """
        self._top = out / FOLDER
        self.folder = self._top / key
        others = [path for path in self._top.glob("*") if path.name != key] if self._top.is_dir() else []
        if others and not force:
            raise InputError(
                f"{out}: holds parts of an interrupted run with other options, inputs or versions; give --force to "
                "drop them, or name a new folder"
            )
        for path in others:
            shutil.rmtree(path, ignore_errors=True)
        make_folder(self.folder)

    def has(self, stage: str, k: int) -> bool:
        """Whether the outcome of a stage's task is there."""
        return self._file(stage, k).is_file()

    def get(self, stage: str, k: int) -> Any:
        """An outcome.

        Raises:
            InputError: it cannot be read.
        """
        path = self._file(stage, k)
        with system_errors(path, "read"):
            return joblib.load(path)

    def put(self, stage: str, k: int, outcome: Any) -> None:
        """Keep an outcome.

        Raises:
            InputError: it cannot be written.
        """
        with whole_file(self._file(stage, k)) as temporary:
            joblib.dump(outcome, temporary)

    def drop(self) -> None:
        """Remove everything: the results are written."""
        shutil.rmtree(self._top, ignore_errors=True)

    def _file(self, stage: str, k: int) -> Path:
        return self.folder / f"{stage.replace(' ', '-')}-{k}.joblib"
