"""Options of the blind campaign."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from mocobot.options.common import Calibrated, Force, Scheduler


@dataclass(frozen=True)
class Campaign:
    """Try your own experiment blind: hide effects in simulated teams, diagnose them, and count what is found, missed
    and invented. An interrupted campaign goes on in its folder."""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the results of all sets, campaign.json, sets.csv, report.txt and plots."""
    payload: str = "a"
    """Payload configuration, or the path of a payload MJCF."""
    trials: Annotated[str, tyro.conf.arg(metavar="KIND,KIND,...")] = "random,random,periodic,static"
    """Trials of every set."""
    vias: int | None = None
    """Vias of a random trial; 80 if not given."""
    duration: float | None = None
    """Length of a periodic motion [s]; 60 if not given."""
    preset: str = "nominal"
    """Sensors: ideal or nominal."""
    background: tuple[Literal["calibrated", "uncalibrated"], ...] = ("calibrated", "uncalibrated")
    """Robots as designed, or drawn as uncalibrated ones are; within tolerances besides."""
    units: Annotated[Path | None, tyro.conf.arg(metavar="TEAM.json")] = None
    """Your robots, in place of these backgrounds: how each deviates from its design."""
    calibration: Calibrated = None
    tolerances: Annotated[Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """How far a healthy robot may be off: drawn for every team, and known to the diagnosis."""
    exclude: Annotated[tuple[str, ...], tyro.conf.arg(metavar="CAUSE...")] = ()
    """Causes that are neither hidden nor considered."""
    causes: Annotated[tuple[str, ...], tyro.conf.arg(metavar="CAUSE...")] = ()
    """Causes to hide, in turn; the whole catalogue if none is named."""
    sizes: Annotated[tuple[float, ...], tyro.conf.arg(metavar="TIMES...")] = (1.0, 2.0, 4.0)
    """Sizes of what is hidden, over the detection limit of the very team, in turn."""
    teams: int = 2
    """Teams of each background; a set of each has nothing hidden."""
    sets: int = 12
    """Sets of each background with one effect hidden; give more to go on with a campaign."""
    closed_loop: bool = False
    """Run the recorded commands of every set again, as `diagnose` does: better, and slower."""
    seed: int = 0
    """Seed of teams, effects, trajectories and noise."""
    jobs: int = 2
    """Parallel processes."""
    scheduler: Scheduler = None
    force: Force = False
