"""What a user names on the command line, checked before any work is done."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from estimator.errors import InputError
from mocobot.files.writing import check_target


def check_recordings(recordings: Sequence[Path], out: Path | None = None) -> None:
    """Each recording once, and an output that overwrites none of them.

    Raises:
        InputError: one is given twice, or the output is one of them or cannot be written.
    """
    seen: set[str] = set()
    for path in recordings:
        real = os.path.realpath(path)
        if real in seen:
            raise InputError(f"{path} is given twice, and would count twice")
        seen.add(real)
    if out is not None:
        if os.path.realpath(out) in seen:
            raise InputError(f"{out}: is one of the recordings; write the estimate to another file")
        check_target(out)
