"""Where the truth beside a recording is."""

from pathlib import Path


def truth_path(recording: Path) -> Path:
    """Sidecar of a recording: ``rec.parquet`` has ``rec.truth.json``."""
    return recording.with_suffix(".truth.json")
