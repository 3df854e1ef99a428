"""Options of the commands that simulate, and of those that show what was simulated or measured."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from mocobot.options.common import Calibrated, Force, MaxUnpacked, Model

Kind = Literal["random", "periodic", "static", "free"]
"""Of a trial."""


@dataclass(frozen=True)
class Effects:
    """List the physical effects that `simulate --effect` hides in a team: parameters, units and ranges."""

    name: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="NAME...")] = ()
    """Effects to list; all if none is named."""


@dataclass(frozen=True)
class Simulate:
    """Simulate one trial, or several of one team, and write recordings with the ground truth in sidecars."""

    out: Annotated[Path | None, tyro.conf.arg(metavar="REC.parquet")] = None
    """Recording to write; the truth goes beside it as REC.truth.json."""
    trials: Annotated[str | None, tyro.conf.arg(metavar="KIND,KIND,...")] = None
    """Several trials of one team: random,random,periodic,static (needs --out-dir)."""
    out_dir: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for several trials: trial1_random.parquet, ..., each with its truth."""
    force: Force = False
    payload: str | None = None
    """Payload configuration, or the path of a payload MJCF (body 'payload', sites grasp1 .. graspN); 'a' if neither
    this nor a model is given."""
    model: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Extended model to simulate in place of a payload on robots as designed."""
    effect: Annotated[
        tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME:KEY=VALUE,...")
    ] = ()
    """Effect to hide in the team: joint_friction:robot=2,joint=1,coulomb=0.05. May be given several times; `mocobot
    effects` lists them."""
    units: Annotated[Path | None, tyro.conf.arg(metavar="TEAM.json")] = None
    """How every robot deviates from its design, such as the truth of another trial; needs calibrated sensors."""
    trajectory: Kind = "random"
    """Kind of motion; free: every arm alone, holding nothing."""
    vias: int | None = None
    """Vias of a random trial, or of a free one's fast part; 80 if not given."""
    duration: float | None = None
    """Length of a periodic motion [s]; 60 if not given."""
    preset: str = "nominal"
    """Sensors: ideal, nominal or uncalibrated."""
    seed: int = 0
    """Seed of trajectory, noise and calibration errors."""
    level: Literal["joint", "wrist"] = "joint"
    """What the file holds: driven angles and spring torques, or wrist positions and forces."""
    robots: int | None = None
    """Robots of a free trial; as many as the payload has grasps if not given."""


@dataclass(frozen=True)
class Replay:
    """Watch recordings: the scene moving from the measured angles, estimate against truth, all signals (Rerun)."""

    rec: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="REC...")]
    """Recordings (Parquet); several are shown side by side. Logs of a robot's joints with --model."""
    model: Model = None
    map: Annotated[str | None, tyro.conf.arg(metavar="MAP.toml")] = None
    """With --model: map of the logs; log.toml beside log or model if not given."""
    estimate: Annotated[Path | None, tyro.conf.arg(metavar="EST.json")] = None
    """Estimate to show, as `mocobot estimate --out` writes it; made from each recording if not given."""
    calibration: Calibrated = None
    truth: bool = False
    """Show the truth beside each recording, too (REC.truth.json)."""
    diagnosis: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Mark what a diagnosis names, as `mocobot diagnose --out` writes it."""
    payload: Annotated[str | None, tyro.conf.arg(metavar="NAME|FILE.xml")] = None
    """Geometry of the payload; that of the recording's label, or bars between the grasps, if not given."""
    save: Annotated[Path | None, tyro.conf.arg(metavar="OUT.rrd")] = None
    """Write a file for the Rerun viewer instead of opening it."""
    force: Force = False
    web: bool = False
    """Serve to a browser instead of opening the viewer."""
    max_unpacked: MaxUnpacked = None
