"""Options of the commands that take logs of real robots."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from mocobot.options.common import Calibrated, Flag, Force, MaxUnpacked, Model


@dataclass(frozen=True)
class Convert:
    """Convert a measured log (ROS 2 bag, CSV, NPZ, Parquet, LeRobot) to a recording, or a recording to one of these."""

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="IN")]
    """Log: a rosbag2 folder, .mcap, .db3, .csv, .npz or .parquet file, or a LeRobot dataset."""
    out: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="OUT")]
    """Recording to write: .parquet; .csv, .npz, .mcap or .db3; or a new rosbag2 folder if it has no suffix."""
    force: Force = False
    map: Annotated[str | None, tyro.conf.arg(metavar="MAP.toml|NAME")] = None
    """Where the log has which channel, by file or built-in name (docs/measured-data.md); found out if not given."""
    trial: Literal["random", "periodic", "static", "free"] | None = None
    """Kind of trial, if neither log nor map says; "random" else. "free": robots that hold nothing."""
    payload: str | None = None
    """Name of the payload."""
    design: Annotated[Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Numbers of the robots, if not the log's own or those of the Omnid."""
    level: Literal["joint", "wrist"] | None = None
    """What to write: driven angles and torques, or wrist positions and forces; that of the log if not given."""
    clock: Literal["keep", "correct"] = "keep"
    """Believe the robots' stamps, or take out what their clocks differ by. It is estimated and reported either way."""
    rate: Annotated[float, tyro.conf.arg(metavar="HZ")] = 100.0
    """Rate of the recording [Hz]."""
    max_gap: Annotated[float, tyro.conf.arg(metavar="S")] = 0.08
    """Longest time without samples that is filled in [s]."""
    crop: Annotated[str | None, tyro.conf.arg(metavar="FROM:TO")] = None
    """Keep a part of the log only, in seconds from its start: 12:95, 12: or :95."""
    drop: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="robot=N:FROM-TO")] = ()
    """Leave out samples of one robot, in seconds from the log's start: robot=2:30-31. May be given several times."""
    split_at_gaps: Flag = False
    """Make a recording of every part between gaps too long to be filled: OUT-1, OUT-2, ..."""
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE.json")] = None
    """Write the report as JSON, too."""
    episode: int | None = None
    """Episode of a LeRobot dataset that holds several."""
    max_unpacked: MaxUnpacked = None


@dataclass(frozen=True)
class Map:
    """Draft the map of a log, for `convert --map`: what is which channel, by names, the units in them, and values."""

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """Log of any format that ``convert`` reads."""
    model: Model = None
    out: Annotated[Path | None, tyro.conf.arg(metavar="MAP.toml")] = None
    """Write the draft to a file instead of the terminal."""
    force: Force = False
    episode: int | None = None
    """Episode of a LeRobot dataset that holds several."""
    max_unpacked: MaxUnpacked = None


@dataclass(frozen=True)
class Inspect:
    """Look at a log before anyone trusts a number of it: stamps, channels, clocks, wiring, excitation."""

    rec: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """Recording or log of any format that ``convert`` reads; broken ones are looked at, too."""
    map: Annotated[str | None, tyro.conf.arg(metavar="MAP")] = None
    """Map file or the name of a built-in one; see docs/measured-data.md."""
    model: Model = None
    json: Annotated[Path | None, tyro.conf.arg(metavar="FILE.json")] = None
    """Write the report as JSON, too."""
    force: Force = False
    strict: Flag = False
    """Exit with 1 if the log is ready for nothing."""
    design: Annotated[Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Numbers of the robots, where the log does not say; the Omnid's if not given."""
    calibration: Calibrated = None
    episode: int | None = None
    """Episode of a LeRobot dataset."""
    max_unpacked: MaxUnpacked = None
