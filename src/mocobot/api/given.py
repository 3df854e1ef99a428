"""Recordings as a caller may give them."""

from collections.abc import Iterable, Iterator
from dataclasses import fields
from pathlib import Path

from estimator.recording.model import Recording
from mocobot.files.recordings import read

Given = Recording | Path | str
"""A recording, or the path of its file."""


def recordings_of(given: Given | Iterable[Given]) -> Iterator[Recording]:
    """One or several recordings, read when their turn comes; what a simulation adds to one is left behind.

    Raises:
        InputError: a file cannot be read, or is not a plausible recording.
    """
    for each in [given] if isinstance(given, Recording | Path | str) else given:
        recording = each if isinstance(each, Recording) else read(Path(each))
        yield Recording(**{field.name: getattr(recording, field.name) for field in fields(Recording)})
