"""Options of every command, and of the call of the same name: the docstring of a field is its help.

``mocobot.diagnose(..., options)`` takes ``DiagnoseOptions``, and likewise the others; keyword arguments of a call are
fields of them. ``Diagnose``, which the command line makes, adds what only a command has: its logs, and where results
go. Nothing here takes long to import.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, TypeVar, get_args

import tyro

from discrepancy.cause_names import JOINTS, TEAM, excluded_from
from discrepancy.evidence.settings import ODDS
from estimator.errors import InputError
from mocobot_sim.effect_names import check_effect_name
from mocobot_sim.scene.models import payload_path

if TYPE_CHECKING:  # from Python the object may be given that a file holds
    AnyPath: TypeAlias = Any
    AnyName: TypeAlias = Any
    AnyFlag: TypeAlias = Any
    AnyWords: TypeAlias = Any
else:
    AnyPath, AnyName, AnyFlag, AnyWords = Path, str, bool, tuple[str, ...]

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]
Force = Annotated[Flag, tyro.conf.arg(help="Replace what exists there; nothing is overwritten without it.")]
Json = Annotated[Path | None, tyro.conf.arg(metavar="FILE.json", help="Write the result as JSON, too.")]
Pictures = Annotated[Flag, tyro.conf.arg(help="Write pictures into the folder, too.")]
Logs = Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="REC...")]
Jobs = Annotated[int, tyro.conf.arg(help="Parallel processes.")]
Episode = Annotated[int | None, tyro.conf.arg(help="Episode of a LeRobot dataset that holds several.")]
LogMap = Annotated[
    AnyName | None,
    tyro.conf.arg(
        metavar="MAP.toml|NAME",
        help="Where logs that are no recordings have which channel, by file or built-in name (docs/measured-data.md); "
        "found out if not given. With a model: log.toml beside the log or the model.",
    ),
]
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
    AnyPath | None,
    tyro.conf.arg(
        metavar="CALIBRATION.json",
        help="The robots as `mocobot calibrate` found them, in place of what the recordings say of them.",
    ),
]
Tolerances = Annotated[
    AnyPath | None,
    tyro.conf.arg(
        metavar="FILE.toml", help="How far a healthy robot may be off; see docs/diagnosis/guide.md."
    ),
]
MaxUnpacked = Annotated[
    float | None,
    tyro.conf.arg(
        metavar="GIB",
        help="Most that each file may unpack to; 100 times its size, at least 0.25 and at most 4 GiB, if not given.",
    ),
]
TrialKind = Literal["random", "periodic", "static", "free"]
MOST_ODDS, LONGEST_S = 1000.0, 1e6
SLOWEST_HZ, FASTEST_HZ, LONGEST_GAP_S = 20.0, 2000.0, 10.0
"""Bounds of a converted recording: the estimator's filter passes 5 Hz."""


class Options:
    """What options of every kind have."""

    def check(self) -> None:
        """Raise an InputError for options that exclude each other, or a number out of its range."""


Made = TypeVar("Made", bound=Options)


def made(kind: type[Made], options: Made | None, given: Mapping[str, Any]) -> Made:
    """The options of a call: those given as one object, with the keyword arguments in place of its fields.

    Raises:
        InputError: they contradict each other, or a value is out of range.
        TypeError: there is no such option.
    """
    found: Any = kind(**given) if options is None else replace(options, **given)  # pyright: ignore
    found.check()
    return found


def refuse_teams(options: Any, names: Iterable[str]) -> None:
    """Refuse options of a team where the model of one robot is given."""
    default = {field.name: field.default for field in fields(options)}
    for name in names:
        if getattr(options, name) != default[name]:
            raise InputError(f"{name} is of a team's robots; with a model there is none")


def refuse_both(options: Any, one: str, other: str, why: str) -> None:
    """Refuse two options that exclude each other."""
    if getattr(options, one) not in (None, ()) and getattr(options, other) not in (None, ()):
        raise InputError(f"{one} and {other} are both given; {why}")


def check_range(options: Any, name: str, least: float, most: float = math.inf) -> None:
    """Refuse a number that is out of range."""
    value = getattr(options, name)
    if not least <= value <= most:
        allowed = f"at least {least:g}" if most == math.inf else f"from {least:g} to {most:g}"
        raise InputError(f"{name} is {value:g}; it must be {allowed}")


def check_seconds(seconds: float | None) -> None:
    """Refuse a time limit that is none."""
    if seconds is not None and not 0.0 < seconds <= LONGEST_S:
        raise InputError(f"seconds is {seconds:g}; it must be above 0 and at most {LONGEST_S:g} s")


def check_motion(options: Any, kinds: Sequence[str], needed: Mapping[str, tuple[str, ...]]) -> None:
    """Refuse a number that says nothing about any of the motions.

    Args:
        options: of the simulation.
        kinds: of the trials.
        needed: kinds of which at least one must be there, by option.

    Raises:
        InputError: an option is given without such a trial.
    """
    for name, wanted in needed.items():
        if getattr(options, name) is not None and not set(wanted) & set(kinds):
            given = "this one is" if len(kinds) == 1 else "these are"
            raise InputError(f"{name} is for a {' or '.join(wanted)} trajectory; {given} {', '.join(kinds)}")


def kinds_of(trials: str, known: Sequence[str]) -> tuple[str, ...]:
    """Kind of every trial of a list such as ``random,static``."""
    kinds = tuple(trials.split(","))
    if not set(kinds) <= set(known):
        raise InputError(
            f"trials is {trials!r}; it must be a list such as random,random,periodic,static of {', '.join(known)}"
        )
    return kinds


@dataclass(frozen=True, kw_only=True)
class Files:
    """What every command has that reads a log and writes something."""

    force: Force = False
    max_unpacked: MaxUnpacked = None


@dataclass(frozen=True, kw_only=True)
class EstimateOptions(Options):
    """How a payload is estimated."""

    map: LogMap = None
    calibration: Calibrated = None
    self_calibrate: Flag = False
    """Calibrate the robots on these recordings, and take what they carry from the same fit; free trials may be among
    them."""
    method: Literal["auto", "fit", "staged", "joint"] = "auto"
    """One fit of closed loops and balance of wrenches; the paper's stages; its grasps, and one least squares for the
    rest. auto: the fit, if noise is all that it leaves."""
    cutoff_hz: float = 5.0
    """Cut-off of the low-pass filter [Hz]."""

    def check(self) -> None:
        """Raise an InputError for options that exclude each other."""
        if self.self_calibrate:
            named = {"calibration": self.calibration is not None, "method": self.method != "auto"}
            for name in (name for name, given in named.items() if given):
                raise InputError(f"self_calibrate and {name} are both given; choose one")


@dataclass(frozen=True, kw_only=True)
class Estimate(Files, EstimateOptions):
    """Estimate grasps, mass, centre of mass and inertia from recordings of one payload."""

    rec: Logs
    """Recordings (Parquet), or logs of any format that ``convert`` reads, all of one payload."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="EST.json")] = None
    """Write the estimate as JSON."""
    json: Json = None
    pictures: Flag = False
    """Make OUT a folder: estimate.json, report.txt, and a picture of the team as estimated."""
    strict: Flag = False
    """Exit with 1 if the estimate is flagged, or nothing could be determined."""


@dataclass(frozen=True, kw_only=True)
class CalibrateOptions(Options):
    """How the robots of a team are calibrated."""

    map: LogMap = None
    prior: Annotated[AnyPath | None, tyro.conf.arg(metavar="PRIOR.toml")] = None
    """How far the robots may be off (docs/calibration.md); robots out of the box if not given."""
    payload_of: Annotated[AnyWords, tyro.conf.arg(metavar="REC=LABEL...")] = ()
    """Which payload a recording is of, where it does not say so itself."""
    known_mass: Annotated[AnyWords, tyro.conf.arg(metavar="[LABEL=]KG[+-SE]...")] = ()
    """Weighed payloads: c=10.48+-0.005; 0.1 % if no standard error is given. One decides the springs' common scale."""
    parallel_flanges: Flag = False
    """The z axes of all flanges are parallel: decides the zeros of theta_x, and with them the frames of drawings."""
    tilt: Flag = False
    """Bases may not stand level (0.2 deg, if the prior says nothing)."""
    arm_masses: Flag = False
    """Each arm's masses may be off (10 %, if the prior says nothing)."""


@dataclass(frozen=True, kw_only=True)
class Calibrate(Files, CalibrateOptions):
    """Find out how every robot differs from its design, from recordings of what the team carries."""

    rec: Logs
    """Recordings (Parquet) of one team that carries payloads, or logs of any format that ``convert`` reads."""
    free: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="REC...")] = ()
    """Recordings of the same robots with nothing in their hands; they tell what the arms weigh."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for calibration.json, report.txt, every robot's numbers and the calibrated team's model."""
    json: Json = None
    pictures: Pictures = False
    strict: Flag = False
    """Exit with 1 if there are findings that speak against the numbers."""


@dataclass(frozen=True, kw_only=True)
class DiagnoseOptions(Options):
    """How a diagnosis is made, of a team or of one robot of joints."""

    map: LogMap = None
    calibration: Calibrated = None
    tolerances: Tolerances = None
    exclude: Annotated[AnyWords, tyro.conf.arg(metavar="CAUSE...")] = ()
    """Causes not to consider."""
    closed_loop: bool = True
    """Run the recorded commands again, without and with what is found."""
    laws: Literal["auto", "always", "never"] = "auto"
    """Look for laws that no table lists: where the noise is louder than the sensors', always, or never."""
    odds: float = ODDS
    """Odds of any cause being there before the data are seen; more where a fault is suspected."""
    whole: bool = False
    """Search all of a team's long recordings, not a choice of their parts."""
    seconds: Annotated[float | None, tyro.conf.arg(metavar="S")] = None
    """End after this time with the best verdict so far, as Ctrl-C does."""
    jobs: Jobs = 1
    scheduler: Scheduler = None

    def check(self) -> None:
        """Raise an InputError for a number that is out of range."""
        check_range(self, "jobs", 1)
        if not 0.0 < self.odds <= MOST_ODDS:
            raise InputError(f"odds is {self.odds:g}; it must be greater than 0 and at most {MOST_ODDS:g}")
        check_seconds(self.seconds)

    def check_for(self, model: object, reference: object) -> None:
        """Raise an InputError for what a team does not take, or one robot of joints does not."""
        if model is not None:
            refuse_teams(self, ("calibration", "scheduler", "laws", "odds", "whole", "jobs"))
        elif reference:
            raise InputError("reference goes with a model: a healthy log of the same robot")
        causes = TEAM if model is None else JOINTS
        excluded_from(causes, tuple(self.exclude))
        if set(causes) <= set(self.exclude):
            raise InputError("every cause is excluded; nothing is left to look for")


@dataclass(frozen=True, kw_only=True)
class Diagnose(Files, DiagnoseOptions):
    """Find out what the simulation gets wrong, name the physical cause, and measure what fixing it is worth."""

    rec: Logs
    """Recordings or logs that ``convert`` reads, all of one payload; with --model, logs of one robot's joints."""
    model: Model = None
    reference: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="LOG...")] = ()
    """With --model: logs of the same robot while it was well; what is off there, too, is no news."""
    jobs: Jobs = 2
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for diagnosis.json, report.txt, the residuals and the extended model."""
    json: Json = None
    pictures: Pictures = False
    strict: Flag = False
    """Exit with 1 if the verdict is neither consistent nor explained."""
    verbose: Flag = False
    """Print all that report.txt says."""


@dataclass(frozen=True, kw_only=True)
class WatchOptions(Options):
    """How a first look is taken."""

    map: LogMap = None
    jobs: Jobs = 1

    def check(self) -> None:
        """Raise an InputError for a number that is out of range."""
        check_range(self, "jobs", 1)


@dataclass(frozen=True, kw_only=True)
class Watch(Files, WatchOptions):
    """Look at recordings or logs once, and say what there is: inspect, convert, estimate, calibrate if the robots
    contradict each other, diagnose, and make a page."""

    rec: Logs
    """Recordings (Parquet), or logs of any format that ``convert`` reads, all of one payload."""
    jobs: Jobs = 2
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the page, and for all that it is made of."""
    open: Flag = False
    """Open the page in a browser; without --out it is in a temporary folder."""
    pictures: Pictures = False
    strict: Flag = False
    """Exit with 1 if there is no estimate, or the verdict is neither consistent nor explained."""


@dataclass(frozen=True, kw_only=True)
class CampaignOptions(Options):
    """What a campaign consists of, and where it runs."""

    payload: str = "a"
    """Payload configuration, or the path of a payload MJCF."""
    trials: Annotated[str, tyro.conf.arg(metavar="KIND,KIND,...")] = "random,random,periodic,static"
    """Trials of every set."""
    vias: int | None = None
    """Vias of a random trial; 80 if not given."""
    duration_s: float | None = None
    """Length of a periodic motion [s]; 60 if not given."""
    preset: str = "nominal"
    """Sensors: ideal or nominal."""
    background: tuple[Literal["calibrated", "uncalibrated"], ...] = ("calibrated", "uncalibrated")
    """Robots as designed, or drawn as uncalibrated ones are; within tolerances besides."""
    units: Annotated[AnyPath | None, tyro.conf.arg(metavar="TEAM.json")] = None
    """Your robots, in place of these backgrounds: how each deviates from its design."""
    calibration: Annotated[
        AnyPath | None,
        tyro.conf.arg(
            metavar="CALIBRATION.json",
            help="What the diagnosis knows of these robots, by `mocobot calibrate`.",
        ),
    ] = None
    tolerances: Annotated[AnyPath | None, tyro.conf.arg(metavar="FILE.toml")] = None
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
    jobs: Jobs = 2
    scheduler: Scheduler = None

    def check(self) -> None:
        """Raise an InputError for what cannot be met, but for names of sensors."""
        needed = {"vias": ("random",), "duration_s": ("periodic",)}
        check_motion(self, self.kinds, needed)
        for name, least in (("jobs", 1), ("teams", 1), ("sets", 0), ("seed", 0)):
            check_range(self, name, least)
        if not self.background:
            raise InputError("background names no robots; it must be calibrated, uncalibrated or both")
        if len(set(self.background)) < len(self.background):
            raise InputError(f"background names the same robots twice ({' '.join(self.background)})")
        if not self.sizes or not all(0.0 < size < math.inf for size in self.sizes):
            raise InputError(f"sizes is {self.sizes}; they must be numbers above 0")
        if self.calibration is not None and self.units is None:
            raise InputError("calibration is of given robots; say with --units how they truly are")
        for name, given in (("causes", self.causes), ("exclude", self.exclude)):
            for cause in given:
                if cause not in TEAM:
                    raise InputError(
                        f"--{name}: cause {cause!r} does not exist; the causes are {', '.join(TEAM)}"
                    )
        if both := set(self.causes) & set(self.exclude):
            raise InputError(f"{both.pop()} is both to be hidden and excluded; choose one")

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kind of every trial."""
        return kinds_of(self.trials, ("random", "periodic", "static"))


@dataclass(frozen=True, kw_only=True)
class Campaign(CampaignOptions):
    """Try your own experiment blind: hide effects in simulated teams, diagnose them, and count what is found, missed
    and invented. An interrupted campaign goes on in its folder."""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the results of all sets, campaign.json, sets.csv and report.txt."""
    json: Json = None
    pictures: Pictures = False
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class ConvertOptions(Options):
    """How a log becomes a recording."""

    map: LogMap = None
    trial: TrialKind | None = None
    """Kind of trial, if neither log nor map says; "random" else. "free": robots that hold nothing."""
    payload: str | None = None
    """Name of the payload."""
    design: Annotated[AnyPath | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Numbers of the robots, if not the log's own or those of the Omnid."""
    level: Literal["joint", "wrist"] | None = None
    """What to write: driven angles and torques, or wrist positions and forces; that of the log if not given."""
    clock: Literal["keep", "correct"] = "keep"
    """Believe the robots' stamps, or take out what their clocks differ by. It is estimated and reported either way."""
    rate_hz: Annotated[float, tyro.conf.arg(metavar="HZ")] = 100.0
    """Rate of the recording [Hz]."""
    max_gap_s: Annotated[float, tyro.conf.arg(metavar="S")] = 0.08
    """Longest time without samples that is filled in [s]."""
    crop: Annotated[str | None, tyro.conf.arg(metavar="FROM:TO")] = None
    """Keep a part of the log only, in seconds from its start: 12:95, 12: or :95."""
    drop: Annotated[AnyWords, tyro.conf.UseAppendAction, tyro.conf.arg(metavar="robot=N:FROM-TO")] = ()
    """Leave out samples of one robot, in seconds from the log's start: robot=2:30-31. May be given several times."""
    episode: Episode = None

    def check(self) -> None:
        """Raise an InputError for a number that is out of range."""
        check_range(self, "rate_hz", SLOWEST_HZ, FASTEST_HZ)
        check_range(self, "max_gap_s", 0.0, LONGEST_GAP_S)


@dataclass(frozen=True, kw_only=True)
class Convert(Files, ConvertOptions):
    """Convert a measured log (ROS 2 bag, CSV, NPZ, Parquet, LeRobot) to a recording, or a recording to one of these."""

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="IN")]
    """Log: a rosbag2 folder, .mcap, .db3, .csv, .npz, .mat or .parquet file, or a LeRobot dataset."""
    out: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="OUT")]
    """Recording to write: .parquet; .csv, .npz, .mcap or .db3; or a new rosbag2 folder if it has no suffix."""
    split_at_gaps: Flag = False
    """Make a recording of every part between gaps too long to be filled: OUT-1, OUT-2, ..."""
    json: Json = None


@dataclass(frozen=True, kw_only=True)
class MapOptions(Options):
    """How a map is drafted."""

    episode: Episode = None


@dataclass(frozen=True, kw_only=True)
class Map(Files, MapOptions):
    """Draft the map of a log, for `convert --map`: what is which channel, by names, the units in them, and values."""

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """Log of any format that ``convert`` reads."""
    model: Model = None
    out: Annotated[Path | None, tyro.conf.arg(metavar="MAP.toml")] = None
    """Write the draft to a file instead of the terminal."""


@dataclass(frozen=True, kw_only=True)
class InspectOptions(Options):
    """How a log is looked at."""

    map: LogMap = None
    design: Annotated[AnyPath | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Numbers of the robots, where the log does not say; the Omnid's if not given."""
    calibration: Calibrated = None
    episode: Episode = None

    def check_for(self, model: object) -> None:
        """Raise an InputError for what one robot of joints does not take."""
        if model is not None:
            refuse_teams(self, ("design", "calibration"))


@dataclass(frozen=True, kw_only=True)
class Inspect(Files, InspectOptions):
    """Look at a log before anyone trusts a number of it: stamps, channels, clocks, wiring, excitation."""

    rec: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """Recording or log of any format that ``convert`` reads; broken ones are looked at, too."""
    model: Model = None
    json: Json = None
    strict: Flag = False
    """Exit with 1 if the log is ready for nothing."""


@dataclass(frozen=True, kw_only=True)
class Paper(Options):
    """Run the paper's experiment and print Tables II-V, published figures beside ours."""

    payload: tuple[str, ...] = ("a", "b", "c", "d")
    """Payload configurations."""
    preset: tuple[str, ...] = ("ideal", "nominal", "uncalibrated")
    """Sensor presets."""
    trials: int = 6
    """Random trials per payload; half as many are periodic."""
    seed: int = 0
    """Seed of trajectories, noise and calibration errors."""
    staged_only: bool = False
    """The paper's own method alone, without the calibrations and fits beside it."""
    jobs: Jobs = 2
    scheduler: Scheduler = None
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for paper.json, tables.txt, the estimates and plots; a run that was interrupted goes on there."""
    force: Force = False
    recordings: bool = False
    """Write the recordings, too (needs --out)."""

    def check(self) -> None:
        """Raise an InputError for a payload that does not exist, or a number that is out of range."""
        for payload in self.payload:
            payload_path(payload)
        check_range(self, "jobs", 1)


@dataclass(frozen=True, kw_only=True)
class Report(Files):
    """Make one HTML page of a result folder (`paper`, `estimate`, `calibrate`, `diagnose`, `campaign`): tables, plots,
    provenance."""

    dir: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """Folder of `mocobot paper`, `calibrate`, `diagnose` or `campaign --out`, or one with files of `mocobot estimate
    --out`."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE.html")] = None
    """Page to write; DIR/report.html if not given."""


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Compare two estimates, calibrations or diagnoses: what changed beyond its errors."""

    a: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="A")]
    """JSON file of an estimate, calibration or diagnosis, or the folder that holds it."""
    b: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="B")]
    """Another one of the same kind."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for comparison.json, report.txt and comparison.png."""
    json: Json = None
    force: Force = False
    strict: Flag = False
    """Exit with 1 if something changed."""


@dataclass(frozen=True, kw_only=True)
class Effects:
    """List the physical effects that `simulate --effect` hides in a team: parameters, units and ranges."""

    name: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="NAME...")] = ()
    """Effects to list; all if none is named."""


@dataclass(frozen=True, kw_only=True)
class SimulateOptions(Options):
    """How trials are simulated."""

    effects: Annotated[
        AnyWords, tyro.conf.UseAppendAction, tyro.conf.arg(name="effect", metavar="NAME:KEY=VALUE,...")
    ] = ()
    """Effect to hide in the team: joint_friction:robot=2,joint=1,coulomb=0.05. May be given several times; `mocobot
    effects` lists them."""
    units: Annotated[AnyPath | None, tyro.conf.arg(metavar="TEAM.json")] = None
    """How every robot deviates from its design, such as the truth of another trial; needs calibrated sensors."""
    model: Annotated[AnyPath | None, tyro.conf.arg(metavar="DIR")] = None
    """Extended model to simulate in place of a payload on robots as designed."""
    vias: int | None = None
    """Vias of a random trial, or of a free one's fast part; 80 if not given."""
    duration_s: float | None = None
    """Length of a periodic motion [s]; 60 if not given."""
    preset: AnyName = "nominal"
    """Sensors: ideal, nominal or uncalibrated."""
    seed: int = 0
    """Seed of trajectory, noise and calibration errors."""
    level: Literal["joint", "wrist"] = "joint"
    """What the file holds: driven angles and spring torques, or wrist positions and forces."""
    robots: int | None = None
    """Robots of a free trial; as many as the payload has grasps if not given."""

    def check(self) -> None:
        """Raise an InputError for options that exclude each other, or an effect of no known name."""
        refuse_both(self, "units", "model", "the model has robots of its own, so leave one out")
        for effect in self.effects:
            if isinstance(effect, str):
                check_effect_name(effect.partition(":")[0])

    def check_for(self, payload: object, kinds: Sequence[str]) -> None:
        """Raise an InputError for what says nothing about these trials, or about this payload."""
        needed = {"vias": ("random", "free"), "duration_s": ("periodic",), "robots": ("free",)}
        check_motion(self, kinds, needed)
        if payload is None:
            return
        for name, why in (
            ("robots", "a payload says how many robots there are"),
            ("model", "the model has its own payload, so leave one out"),
        ):
            if getattr(self, name) is not None:
                raise InputError(f"payload and {name} are both given; {why}")


@dataclass(frozen=True, kw_only=True)
class Simulate(SimulateOptions):
    """Simulate one trial, or several of one team, and write recordings with the ground truth in sidecars."""

    out: Annotated[Path | None, tyro.conf.arg(metavar="REC.parquet|DIR")] = None
    """Recording to write, the truth beside it as REC.truth.json; with --trials a folder: trial1_random.parquet, ...,
    each with its truth."""
    trials: Annotated[str | None, tyro.conf.arg(metavar="KIND,KIND,...")] = None
    """Several trials of one team: random,random,periodic,static."""
    trajectory: TrialKind = "random"
    """Kind of motion; free: every arm alone, holding nothing."""
    payload: str | None = None
    """Payload configuration, or the path of a payload MJCF (body 'payload', sites grasp1 .. graspN); 'a' if neither
    this nor a model is given."""
    force: Force = False

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kind of every trial."""
        return (self.trajectory,) if self.trials is None else kinds_of(self.trials, get_args(TrialKind))


@dataclass(frozen=True, kw_only=True)
class ReplayOptions(Options):
    """What a replay shows."""

    map: LogMap = None
    estimate: Annotated[AnyPath | None, tyro.conf.arg(metavar="EST.json")] = None
    """Estimate to show, as `mocobot estimate --out` writes it; made from each recording if not given."""
    calibration: Calibrated = None
    truth: AnyFlag = False
    """Show the truth beside each recording, too (REC.truth.json)."""
    diagnosis: Annotated[AnyPath | None, tyro.conf.arg(metavar="DIR")] = None
    """Mark what a diagnosis names, as `mocobot diagnose --out` writes it."""
    payload: Annotated[AnyName | None, tyro.conf.arg(metavar="NAME|FILE.xml")] = None
    """Geometry of the payload; that of the recording's label, or bars between the grasps, if not given."""
    web: bool = False
    """Serve to a browser instead of opening the viewer."""

    def check_for(self, path: object, model: object) -> None:
        """Raise an InputError for what excludes each other, or one robot of joints does not take."""
        if path is not None and self.web:
            raise InputError("out and web are both given; choose a file or a browser")
        if model is not None:
            refuse_teams(self, ("estimate", "calibration", "diagnosis", "payload", "truth"))
        elif self.map is not None:
            raise InputError("map goes with a model; logs of a team are converted to recordings first")


@dataclass(frozen=True, kw_only=True)
class Replay(Files, ReplayOptions):
    """Watch recordings: the scene moving from the measured angles, estimate against truth, all signals (Rerun)."""

    rec: Logs
    """Recordings (Parquet); several are shown side by side. Logs of a robot's joints with --model."""
    model: Model = None
    out: Annotated[Path | None, tyro.conf.arg(metavar="OUT.rrd")] = None
    """Write a file for the Rerun viewer instead of opening it."""


OLD_NAMES = {
    "duration": "duration-s",
    "rate": "rate-hz",
    "max-gap": "max-gap-s",
    "out-dir": "out",
    "save": "out",
}
"""Earlier spellings of options, which commands still take where they have the newer one."""
