"""Options of the experiment, and of what is made of results."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from mocobot.options.common import Flag, Force, MaxUnpacked, Scheduler


@dataclass(frozen=True)
class Paper:
    """Run the paper's experiment and print Tables II-V, published figures beside ours."""

    payload: tuple[str, ...] = ("a", "b", "c", "d")
    """Payload configurations."""
    preset: tuple[str, ...] = ("ideal", "nominal", "uncalibrated")
    """Sensor presets."""
    trials: int = 6
    """Random trials per payload; half as many are periodic."""
    jobs: int = 2
    """Parallel processes."""
    scheduler: Scheduler = None
    seed: int = 0
    """Seed of trajectories, noise and calibration errors."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for paper.json, tables.txt, the estimates and plots; a run that was interrupted goes on there."""
    force: Force = False
    recordings: bool = False
    """Write the recordings, too (needs --out)."""
    staged_only: bool = False
    """The paper's own method alone, without the calibrations and fits beside it."""


@dataclass(frozen=True)
class Report:
    """Make one HTML page of a result folder (`paper`, `estimate`, `calibrate`, `diagnose`, `campaign`): tables, plots,
    provenance."""

    dir: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """Folder of `mocobot paper`, `calibrate`, `diagnose` or `campaign --out`, or one with files of `mocobot estimate
    --out`."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE.html")] = None
    """Page to write; DIR/report.html if not given."""
    force: Force = False
    max_unpacked: MaxUnpacked = None


@dataclass(frozen=True)
class Compare:
    """Compare two estimates, calibrations or diagnoses: what changed beyond its errors."""

    a: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="A")]
    """JSON file of an estimate, calibration or diagnosis, or the folder that holds it."""
    b: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="B")]
    """Another one of the same kind."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for comparison.json, report.txt and comparison.png."""
    force: Force = False
    strict: Flag = False
    """Exit with 1 if something changed."""
