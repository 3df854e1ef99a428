"""Options of every command, as the command line shows them: data only, so that the help needs nothing else."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from discrepancy.evidence.settings import ODDS

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]
Force = Annotated[Flag, tyro.conf.arg(help="Replace what exists there; nothing is overwritten without it.")]
Scheduler = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="tcp://HOST:PORT|FILE",
        help="Run on the workers of a Dask scheduler, by its address or its scheduler file (docs/commands/cluster.md).",
    ),
]
Model = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="ROBOT.xml",
        help="MJCF or URDF of one fixed-base robot whose joints were logged (docs/serial/guide.md), not a team.",
    ),
]
Calibrated = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="CALIBRATION.json",
        help="The robots as `mocobot calibrate` found them, in place of what the recordings say of them.",
    ),
]
MaxUnpacked = Annotated[
    float | None,
    tyro.conf.arg(
        metavar="GIB",
        help="Most that each file may unpack to; 100 times its size, at least 0.25 and at most 4 GiB, if not given.",
    ),
]


@dataclass(frozen=True)
class Estimate:
    """Estimate grasps, mass, centre of mass and inertia from recordings of one payload."""

    rec: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="REC...")]
    """Recordings (Parquet), or logs of any format that ``convert`` reads, all of one payload."""
    map: Annotated[str | None, tyro.conf.arg(metavar="MAP.toml|NAME")] = None
    """Map of the logs that are no recordings; found out if not given."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="EST.json")] = None
    """Write the estimate as JSON, too."""
    force: Force = False
    strict: Flag = False
    """Exit with 1 if the estimate is flagged, or nothing could be determined."""
    calibration: Calibrated = None
    self_calibrate: Flag = False
    """Calibrate the robots on these recordings, and take what they carry from the same fit; free trials may be among
    them."""
    method: Literal["auto", "fit", "staged", "joint"] = "auto"
    """One fit of closed loops and balance of wrenches; the paper's stages; its grasps, and one least squares for the
    rest. auto: the fit, if noise is all that it leaves."""
    cutoff_hz: float = 5.0
    """Cut-off of the low-pass filter [Hz]."""
    max_unpacked: MaxUnpacked = None


@dataclass(frozen=True)
class Calibrate:
    """Find out how every robot differs from its design, from recordings of what the team carries."""

    rec: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="REC...")]
    """Recordings (Parquet) of one team that carries payloads, or logs of any format that ``convert`` reads."""
    free: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="REC...")] = ()
    """Recordings of the same robots with nothing in their hands; they tell what the arms weigh."""
    map: Annotated[str | None, tyro.conf.arg(metavar="MAP.toml|NAME")] = None
    """Map of the logs that are no recordings; found out if not given."""
    prior: Annotated[Path | None, tyro.conf.arg(metavar="PRIOR.toml")] = None
    """How far the robots may be off (docs/calibration.md); robots out of the box if not given."""
    payload_of: Annotated[tuple[str, ...], tyro.conf.arg(metavar="REC=LABEL...")] = ()
    """Which payload a recording is of, where it does not say so itself."""
    known_mass: Annotated[tuple[str, ...], tyro.conf.arg(metavar="[LABEL=]KG[+-SE]...")] = ()
    """Weighed payloads: c=10.48+-0.005; 0.1 % if no standard error is given. One decides the springs' common scale."""
    parallel_flanges: Flag = False
    """The z axes of all flanges are parallel: decides the zeros of theta_x, and with them the frames of drawings."""
    tilt: Flag = False
    """Bases may not stand level (0.2 deg, if the prior says nothing)."""
    arm_masses: Flag = False
    """Each arm's masses may be off (10 %, if the prior says nothing)."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for calibration.json, report.txt, every robot's numbers, plots and the calibrated team's model."""
    force: Force = False
    strict: Flag = False
    """Exit with 1 if there are findings that speak against the numbers."""
    max_unpacked: MaxUnpacked = None


@dataclass(frozen=True)
class Diagnose:
    """Find out what the simulation gets wrong, name the physical cause, and measure what fixing it is worth."""

    rec: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="REC...")]
    """Recordings (Parquet), or logs of any format that ``convert`` reads, all of one payload; several, so that what is
    named can be validated. Logs of a robot's joints with --model."""
    map: Annotated[str | None, tyro.conf.arg(metavar="MAP.toml|NAME")] = None
    """Map of the logs that are no recordings; found out if not given. With --model, log.toml beside log or model."""
    model: Model = None
    reference: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="LOG...")] = ()
    """With --model: logs of the same robot while it was well; what is off there, too, is no news."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for diagnosis.json, report.txt, the extended model and plots."""
    force: Force = False
    strict: Flag = False
    """Exit with 1 if the verdict is neither consistent nor explained."""
    verbose: Flag = False
    """Print all that report.txt says."""
    seconds: Annotated[float | None, tyro.conf.arg(metavar="S")] = None
    """End after this time with the best verdict so far, as Ctrl-C does."""
    jobs: int = 2
    """Parallel processes of a diagnosis without --model, which needs one."""
    scheduler: Scheduler = None
    calibration: Calibrated = None
    tolerances: Annotated[Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """How far a healthy robot may be off; see docs/diagnosis/guide.md."""
    exclude: Annotated[tuple[str, ...], tyro.conf.arg(metavar="CAUSE...")] = ()
    """Causes not to consider."""
    closed_loop: bool = True
    """Run the recorded commands again, without and with what is found."""
    laws: Literal["auto", "always", "never"] = "auto"
    """Look for laws that no table lists: where the noise is louder than the sensors', always, or never."""
    odds: float = ODDS
    """Odds of any cause being there before the data are seen; more where a fault is suspected."""
    whole: bool = False
    """Search all of a team's long recordings, not a choice of their parts."""
    max_unpacked: MaxUnpacked = None


@dataclass(frozen=True)
class Watch:
    """Look at recordings or logs once, and say what there is: inspect, convert, estimate, calibrate if the robots
    contradict each other, diagnose, and make a page."""

    rec: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="REC...")]
    """Recordings (Parquet), or logs of any format that ``convert`` reads, all of one payload."""
    map: Annotated[str | None, tyro.conf.arg(metavar="MAP.toml|NAME")] = None
    """Map of the logs that are no recordings; found out if not given."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the page, and for all that it is made of."""
    open: Flag = False
    """Open the page in a browser; without --out it is in a temporary folder."""
    force: Force = False
    strict: Flag = False
    """Exit with 1 if there is no estimate, or the verdict is neither consistent nor explained."""
    jobs: int = 2
    """Parallel processes."""
    max_unpacked: MaxUnpacked = None


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


@dataclass(frozen=True)
class Convert:
    """Convert a measured log (ROS 2 bag, CSV, NPZ, Parquet, LeRobot) to a recording, or a recording to one of these."""

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="IN")]
    """Log: a rosbag2 folder, .mcap, .db3, .csv, .npz, .mat or .parquet file, or a LeRobot dataset."""
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
