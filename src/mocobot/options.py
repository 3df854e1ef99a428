"""Options of every command and of the call with the same name; the docstring of a field is its help text.

``mocobot.diagnose(..., options)`` takes ``DiagnoseOptions``; its keyword arguments are fields of that class. The other
calls work alike. ``Diagnose``, which the command line creates, adds what only the command needs: logs and outputs.
This module imports nothing slow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from discrepancy.cause_names import JOINTS, TEAM, excluded_from
from discrepancy.evidence.settings import ODDS
from estimator.errors import InputError
from mocobot.option_types import (
    FASTEST_HZ,
    LONGEST_GAP_S,
    MOST_ODDS,
    SLOWEST_HZ,
    AnyFlag,
    AnyName,
    AnyPath,
    AnyWords,
    Calibrated,
    Episode,
    Files,
    Flag,
    Force,
    Jobs,
    Json,
    LogMap,
    Logs,
    Model,
    Options,
    PartOptions,
    Pictures,
    Reference,
    Scheduler,
    Tolerances,
    TrialKind,
    check_motion,
    check_range,
    check_seconds,
    kinds_of,
    refuse_both,
    refuse_teams,
)
from mocobot_sim.effect_names import check_effect_name
from mocobot_sim.scene.models import payload_path


@dataclass(frozen=True, kw_only=True)
class EstimateOptions(Options):
    """Options of the payload estimate."""

    map: LogMap = None
    episode: Episode = None
    calibration: Calibrated = None
    self_calibrate: Flag = False
    """Calibrate the robots and estimate the payload in one fit of these recordings, which may include free trials."""
    payload: Literal["auto", "rigid", "hinged", "sliding", "flexible"] = "auto"
    """Kind of payload: one rigid body, or two on a hinge (hinged), a slide (sliding) or a joint with a spring
    (flexible). auto: rigid, or two bodies if the robots do not move like one."""
    method: Literal["auto", "fit", "staged", "joint"] = "auto"
    """How to estimate. fit: one fit of loop closure and wrench balance. staged: the method of the paper. joint: the
    grasps of the paper, then one least squares. auto: the fit, if it leaves only noise."""
    cutoff_hz: float = 5.0
    """Cut-off frequency of the low-pass filter [Hz]."""

    def check(self) -> None:
        """Raise InputError if options exclude each other."""
        if self.self_calibrate:
            named = {"calibration": self.calibration is not None, "method": self.method != "auto"}
            for name in (name for name, given in named.items() if given):
                raise InputError(f"self_calibrate and {name} are both given; choose one")
        if self.payload not in ("auto", "rigid"):
            if self.self_calibrate:
                raise InputError(f"self_calibrate is of a rigid payload, and payload is {self.payload!r}")
            if self.method != "auto":
                raise InputError(
                    f"method {self.method!r} is of a rigid payload, and payload is {self.payload!r}"
                )


@dataclass(frozen=True, kw_only=True)
class Estimate(Files, EstimateOptions):
    """Estimate grasps, mass, centre of mass and inertia from recordings of one payload."""

    rec: Logs
    """Recordings (Parquet), or logs in any format that ``convert`` reads, all of one payload."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="EST.json")] = None
    """Write the estimate as JSON."""
    json: Json = None
    pictures: Flag = False
    """Make OUT a folder with estimate.json, report.txt and a picture of the estimated team."""
    strict: Flag = False
    """Exit with 1 if the estimate is flagged, or if the recordings determine neither mass nor grasps."""


@dataclass(frozen=True, kw_only=True)
class CalibrateOptions(PartOptions):
    """Options of the calibration of a team's robots, or of a single robot."""

    OF_TEAMS = ("prior", "payload_of", "known_mass", "parallel_flanges", "tilt", "arm_masses")

    map: LogMap = None
    episode: Episode = None
    prior: Annotated[AnyPath | None, tyro.conf.arg(metavar="PRIOR.toml")] = None
    """Prior standard deviations of the robots' deviations (docs/calibration.md); uncalibrated robots if omitted."""
    payload_of: Annotated[AnyWords, tyro.conf.arg(metavar="REC=LABEL...")] = ()
    """Payload label of a recording, if the recording does not state it."""
    known_mass: Annotated[AnyWords, tyro.conf.arg(metavar="[LABEL=]KG[+-SE]...")] = ()
    """Weighed payloads: c=10.48+-0.005; standard error 0.1 % if not given. One fixes the springs' common scale."""
    parallel_flanges: Flag = False
    """Assume that the z axes of all flanges are parallel; this fixes the zeros of theta_x and the drawing frames."""
    same: Annotated[AnyWords, tyro.conf.arg(metavar="LEFT=RIGHT...")] = ()
    """Compare joints of two machines of one kind, with --model: FL=FR for FL_hip_joint with FR_hip_joint, and so on."""
    tilt: Flag = False
    """Estimate the tilt of each base (standard deviation 0.2 deg unless the prior states one)."""
    arm_masses: Flag = False
    """Estimate the mass error of each arm (standard deviation 10 % unless the prior states one)."""

    def check_for(self, model: object, free: object) -> None:
        """Raise InputError for an option that does not apply to a team, or to a single robot."""
        self.check_part(model)
        if model is None and self.same:
            raise InputError("same compares joints of a single robot; it needs a model")
        if model is not None:
            refuse_teams(self)
            if free:
                raise InputError("free is of a team's robots; with a model there is none")


@dataclass(frozen=True, kw_only=True)
class Calibrate(Files, CalibrateOptions):
    """Estimate how robots differ from their model: a team that carries payloads, or with --model a single robot."""

    OF_TEAMS = (*CalibrateOptions.OF_TEAMS, "free")

    rec: Logs
    """Recordings (Parquet) of one team that carries payloads, or logs in any format that ``convert`` reads; with
    --model, joint logs of one robot."""
    model: Model = None
    free: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="REC...")] = ()
    """Recordings of the same robots without a payload; they determine the weight of the arms."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for calibration.json, report.txt, the parameters of every robot and the model of the calibrated team; with
    --model, for as_found.xml and parameters.csv."""
    json: Json = None
    pictures: Pictures = False
    strict: Flag = False
    """Exit with 1 if a finding casts doubt on the numbers."""


@dataclass(frozen=True, kw_only=True)
class DiagnoseOptions(PartOptions):
    """Options of the diagnosis of a team or of a single robot."""

    OF_TEAMS = ("calibration", "scheduler", "laws", "odds", "whole", "jobs")

    map: LogMap = None
    episode: Episode = None
    calibration: Calibrated = None
    tolerances: Tolerances = None
    exclude: Annotated[AnyWords, tyro.conf.arg(metavar="CAUSE...")] = ()
    """Causes to leave out."""
    closed_loop: bool = True
    """Simulate the recorded commands again, without and with the causes found."""
    laws: Literal["auto", "always", "never"] = "auto"
    """Search for laws outside the catalogue. auto: only if the noise exceeds that of the sensors."""
    odds: float = ODDS
    """Prior odds that a cause is present; raise them if you suspect a fault."""
    whole: bool = False
    """Search long recordings of a team in full instead of selected parts."""
    seconds: Annotated[float | None, tyro.conf.arg(metavar="S")] = None
    """Stop after this time [s] with the best verdict so far; Ctrl-C does the same."""
    jobs: Jobs = 1
    scheduler: Scheduler = None

    def check(self) -> None:
        """Raise InputError if a number is out of range."""
        check_range(self, "jobs", 1)
        if not 0.0 < self.odds <= MOST_ODDS:
            raise InputError(f"odds is {self.odds:g}; it must be greater than 0 and at most {MOST_ODDS:g}")
        check_seconds(self.seconds)

    def check_for(self, model: object, reference: object) -> None:
        """Raise InputError for an option that does not apply to a team, or to a single robot."""
        self.check_part(model)
        if model is not None:
            refuse_teams(self)
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
    """Recordings, or logs that ``convert`` reads, all of one payload; with --model, joint logs of one robot."""
    model: Model = None
    reference: Reference = ()
    jobs: Jobs = 2
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for diagnosis.json, report.txt, the residuals and the extended model."""
    json: Json = None
    pictures: Pictures = False
    strict: Flag = False
    """Exit with 1 if the verdict is neither consistent nor explained."""
    verbose: Flag = False
    """Print the full text of report.txt."""


@dataclass(frozen=True, kw_only=True)
class WatchOptions(PartOptions):
    """Options of the first look."""

    map: LogMap = None
    episode: Episode = None
    jobs: Jobs = 1

    def check(self) -> None:
        """Raise InputError if a number is out of range."""
        check_range(self, "jobs", 1)


@dataclass(frozen=True, kw_only=True)
class Watch(Files, WatchOptions):
    """Analyse recordings or logs in one run: inspect, convert, estimate, calibrate if the robots contradict each
    other, diagnose, and make a page. With --model: inspect and diagnose the logs of one robot."""

    rec: Logs
    """Recordings (Parquet), or logs in any format that ``convert`` reads, all of one payload; with --model, joint logs
    of one robot, or folders of them."""
    model: Model = None
    reference: Reference = ()
    follow: Flag = False
    """With --model: wait for further logs in the folders, and for logs to grow, and diagnose each; Ctrl-C ends it."""
    jobs: Jobs = 2
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the page and the results that it shows."""
    open: Flag = False
    """Open the page in a browser; without --out it goes to a temporary folder."""
    pictures: Pictures = False
    strict: Flag = False
    """Exit with 1 if there is no estimate, or if the verdict is neither consistent nor explained."""


@dataclass(frozen=True, kw_only=True)
class CampaignOptions(Options):
    """Options of a campaign: what it consists of and where it runs."""

    payload: str = "a"
    """Payload configuration, or path of a payload MJCF."""
    trials: Annotated[str, tyro.conf.arg(metavar="KIND,KIND,...")] = "random,random,periodic,static"
    """Kinds of the trials of every set."""
    vias: int | None = None
    """Number of vias of a random trial; 80 if omitted."""
    duration_s: float | None = None
    """Length of a periodic motion [s]; 60 if omitted."""
    preset: str = "nominal"
    """Sensor preset: ideal or nominal."""
    background: tuple[Literal["calibrated", "uncalibrated"], ...] = ("calibrated", "uncalibrated")
    """Robots as designed, or with drawn calibration errors; both also deviate within the tolerances."""
    units: Annotated[AnyPath | None, tyro.conf.arg(metavar="TEAM.json")] = None
    """Your own robots instead of these backgrounds: how each deviates from its design."""
    calibration: Annotated[
        AnyPath | None,
        tyro.conf.arg(
            metavar="CALIBRATION.json",
            help="What the diagnosis knows of these robots, by `mocobot calibrate`.",
        ),
    ] = None
    tolerances: Annotated[AnyPath | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Tolerances of a healthy robot; deviations are drawn from them for every team, and the diagnosis knows them."""
    exclude: Annotated[tuple[str, ...], tyro.conf.arg(metavar="CAUSE...")] = ()
    """Causes to neither hide nor consider."""
    causes: Annotated[tuple[str, ...], tyro.conf.arg(metavar="CAUSE...")] = ()
    """Causes to hide, in turn; the whole catalogue if none is given."""
    sizes: Annotated[tuple[float, ...], tyro.conf.arg(metavar="TIMES...")] = (1.0, 2.0, 4.0)
    """Sizes of the hidden effects, in turn, as multiples of that team's detection limit."""
    teams: int = 2
    """Teams per background; each also gets one set without a hidden effect."""
    sets: int = 12
    """Sets per background with one hidden effect; a larger number continues an existing campaign."""
    closed_loop: bool = False
    """Simulate the recorded commands of every set again, as `diagnose` does; more accurate, but slower."""
    seed: int = 0
    """Random seed of teams, effects, trajectories and noise."""
    jobs: Jobs = 2
    scheduler: Scheduler = None

    def check(self) -> None:
        """Raise InputError for options that cannot be met; sensor names are checked later."""
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
        """List the kind of every trial."""
        return kinds_of(self.trials, ("random", "periodic", "static"))


@dataclass(frozen=True, kw_only=True)
class Campaign(CampaignOptions):
    """Test your own experiment blind: hide effects in simulated teams, diagnose them, and count what is found, missed
    and invented. An interrupted campaign resumes in its folder."""

    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder for campaign.json, sets.csv, report.txt and the results of all sets."""
    json: Json = None
    pictures: Pictures = False
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class ConvertOptions(Options):
    """Options of the conversion of a log to a recording."""

    map: LogMap = None
    trial: TrialKind | None = None
    """Kind of trial; if omitted, that of the log or the map, else "random". "free": the robots hold nothing."""
    payload: str | None = None
    """Label of the payload."""
    design: Annotated[AnyPath | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Design parameters of the robots; if omitted, those of the log, else of the Omnid."""
    level: Literal["joint", "wrist"] | None = None
    """Signals to write: driven angles and torques, or wrist positions and forces; if omitted, those of the log."""
    clock: Literal["keep", "correct"] = "keep"
    """Keep the robots' time stamps, or correct the offsets between their clocks; both report the offsets."""
    rate_hz: Annotated[float, tyro.conf.arg(metavar="HZ")] = 100.0
    """Sample rate of the recording [Hz]."""
    max_gap_s: Annotated[float, tyro.conf.arg(metavar="S")] = 0.08
    """Longest gap between samples to fill [s]."""
    crop: Annotated[str | None, tyro.conf.arg(metavar="FROM:TO")] = None
    """Keep only a part of the log, in seconds from its start: 12:95, 12: or :95."""
    drop: Annotated[AnyWords, tyro.conf.UseAppendAction, tyro.conf.arg(metavar="robot=N:FROM-TO")] = ()
    """Leave out samples of one robot, in seconds from the log's start: robot=2:30-31."""
    episode: Episode = None

    def check(self) -> None:
        """Raise InputError if a number is out of range."""
        check_range(self, "rate_hz", SLOWEST_HZ, FASTEST_HZ)
        check_range(self, "max_gap_s", 0.0, LONGEST_GAP_S)


@dataclass(frozen=True, kw_only=True)
class Convert(Files, ConvertOptions):
    """Convert a log (ROS 2 bag, CSV, NPZ, Parquet, LeRobot) to a recording, or a recording to one of these formats."""

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="IN")]
    """Log: a rosbag2 folder, .mcap, .db3, .csv, .npz, .mat or .parquet file, or a LeRobot dataset."""
    out: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="OUT")]
    """File to write: .parquet, .csv, .npz, .mcap or .db3; without a suffix, a new rosbag2 folder."""
    split_at_gaps: Flag = False
    """Write one recording per part between gaps that are too long to fill: OUT-1, OUT-2, ..."""
    json: Json = None


@dataclass(frozen=True, kw_only=True)
class MapOptions(PartOptions):
    """Options of the draft of a map."""

    episode: Episode = None


@dataclass(frozen=True, kw_only=True)
class Map(Files, MapOptions):
    """Draft the map of a log for `convert --map`: match columns to channels by their names, units and values."""

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """Log in any format that ``convert`` reads."""
    model: Model = None
    out: Annotated[Path | None, tyro.conf.arg(metavar="MAP.toml")] = None
    """Write the draft to a file instead of the terminal."""


@dataclass(frozen=True, kw_only=True)
class InspectOptions(PartOptions):
    """Options of the inspection of a log."""

    OF_TEAMS = ("design", "calibration")

    map: LogMap = None
    design: Annotated[AnyPath | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Design parameters of the robots, used if the log has none; if omitted, those of the Omnid."""
    calibration: Calibrated = None
    episode: Episode = None

    def check_for(self, model: object) -> None:
        """Raise InputError for an option that does not apply to a team, or to a single robot."""
        self.check_part(model)
        if model is not None:
            refuse_teams(self)


@dataclass(frozen=True, kw_only=True)
class Inspect(Files, InspectOptions):
    """Check a log before you trust its numbers: time stamps, channels, clocks, wiring, excitation."""

    rec: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """Recording, or log in any format that ``convert`` reads; damaged files are accepted."""
    model: Model = None
    json: Json = None
    strict: Flag = False
    """Exit with 1 if no command can use the log."""


@dataclass(frozen=True, kw_only=True)
class Paper(Options):
    """Run the paper's experiment and print Tables II-V with the published numbers beside ours."""

    payload: tuple[str, ...] = ("a", "b", "c", "d")
    """Payload configurations."""
    preset: tuple[str, ...] = ("ideal", "nominal", "uncalibrated", "scattered")
    """Sensor presets; scattered: uncalibrated, with the effects that scatter the paper's trials."""
    trials: int = 6
    """Random trials per payload; half as many periodic trials are added."""
    seed: int = 0
    """Random seed of trajectories, noise and calibration errors."""
    staged_only: bool = False
    """Run only the paper's own method, without the additional calibrations and fits."""
    jobs: Jobs = 2
    scheduler: Scheduler = None
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for paper.json, tables.txt, the estimates and plots; an interrupted run resumes there."""
    force: Force = False
    recordings: bool = False
    """Also write the recordings (needs --out)."""

    def check(self) -> None:
        """Raise InputError if a payload does not exist or a number is out of range."""
        for payload in self.payload:
            payload_path(payload, rigid=True)
        check_range(self, "jobs", 1)


@dataclass(frozen=True, kw_only=True)
class Report(Files):
    """Make one HTML page with tables, plots and provenance from a result folder (`paper`, `estimate`, `calibrate`,
    `diagnose`, `campaign`)."""

    dir: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """Folder that one of these commands wrote with --out; for estimates, the folder that holds their files."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE.html")] = None
    """Page to write; DIR/report.html if omitted."""


@dataclass(frozen=True, kw_only=True)
class Compare:
    """Compare two estimates, calibrations or diagnoses, and report what changed by more than its standard errors."""

    a: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="A")]
    """JSON file of an estimate, calibration or diagnosis, or the folder that holds it."""
    b: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="B")]
    """Second result, of the same kind as A."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for comparison.json, report.txt and comparison.png."""
    json: Json = None
    force: Force = False
    strict: Flag = False
    """Exit with 1 if something changed."""


@dataclass(frozen=True, kw_only=True)
class Effects:
    """List the physical effects that `simulate --effect` can hide in a team: parameters, units and ranges."""

    name: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="NAME...")] = ()
    """Effects to list; all if omitted."""


@dataclass(frozen=True, kw_only=True)
class SimulateOptions(Options):
    """Options of the simulation of trials."""

    effects: Annotated[
        AnyWords, tyro.conf.UseAppendAction, tyro.conf.arg(name="effect", metavar="NAME:KEY=VALUE,...")
    ] = ()
    """Effect to hide in the team; `mocobot effects` lists all. Example: joint_friction:robot=2,joint=1,coulomb=0.05."""
    units: Annotated[AnyPath | None, tyro.conf.arg(metavar="TEAM.json")] = None
    """Deviations of every robot from its design, for example the truth of another trial; needs calibrated sensors."""
    model: Annotated[AnyPath | None, tyro.conf.arg(metavar="DIR")] = None
    """Extended model to simulate instead of a payload on robots as designed."""
    vias: int | None = None
    """Number of vias of a random trial, or of the fast part of a free trial; 80 if omitted."""
    duration_s: float | None = None
    """Length of a periodic motion [s]; 60 if omitted."""
    preset: AnyName = "nominal"
    """Sensor preset: ideal, nominal or uncalibrated."""
    seed: int = 0
    """Random seed of trajectory, noise and calibration errors."""
    level: Literal["joint", "wrist"] = "joint"
    """Signals in the file: driven angles and spring torques, or wrist positions and forces."""
    robots: int | None = None
    """Number of robots of a free trial; if omitted, the number of grasps of the payload."""
    drive: Annotated[float | None, tyro.conf.arg(metavar="RATIO")] = None
    """Let the bases of random and periodic trials drive while they carry, and record their wheel odometry. RATIO is the
    standard deviation of the odometry's relative errors, such as 0.01."""

    def check(self) -> None:
        """Raise InputError if options exclude each other or an effect does not exist."""
        if self.drive is not None and not 0.0 <= self.drive <= 0.1:
            raise InputError(f"drive is {self.drive:g}; it must be from 0 to 0.1")
        refuse_both(self, "units", "model", "the model has robots of its own, so leave one out")
        for effect in self.effects:
            if isinstance(effect, str):
                check_effect_name(effect.partition(":")[0])

    def check_for(self, payload: object, kinds: Sequence[str]) -> None:
        """Raise InputError for an option that does not apply to these trials or to this payload."""
        needed = {"vias": ("random", "free"), "duration_s": ("periodic",), "robots": ("free",)}
        check_motion(self, kinds, needed | {"drive": ("random", "periodic")})
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
    """Simulate one or several trials of a team; write recordings, and the ground truth in a separate file beside."""

    out: Annotated[Path | None, tyro.conf.arg(metavar="REC.parquet|DIR")] = None
    """Recording to write, with the truth beside it as REC.truth.json; with --trials, a folder of such files, named
    trial1_random.parquet and so on."""
    trials: Annotated[str | None, tyro.conf.arg(metavar="KIND,KIND,...")] = None
    """Simulate several trials of one team, such as random,random,periodic,static."""
    trajectory: TrialKind = "random"
    """Kind of motion; free: every arm moves alone and holds nothing."""
    payload: str | None = None
    """Payload configuration, or path of a payload MJCF (body 'payload', sites grasp1 .. graspN); 'a' if omitted,
    unless a model is given."""
    force: Force = False

    @property
    def kinds(self) -> tuple[str, ...]:
        """List the kind of every trial."""
        return (self.trajectory,) if self.trials is None else kinds_of(self.trials, get_args(TrialKind))


@dataclass(frozen=True, kw_only=True)
class ReplayOptions(PartOptions):
    """Options of a replay."""

    OF_TEAMS = ("estimate", "calibration", "payload", "truth")

    map: LogMap = None
    episode: Episode = None
    estimate: Annotated[AnyPath | None, tyro.conf.arg(metavar="EST.json")] = None
    """Estimate to show, written by `mocobot estimate --out`; if omitted, an estimate is made from each recording."""
    calibration: Calibrated = None
    truth: AnyFlag = False
    """Also show the truth that is stored beside each recording (REC.truth.json)."""
    diagnosis: Annotated[AnyPath | None, tyro.conf.arg(metavar="DIR")] = None
    """Mark the causes of a diagnosis, written by `mocobot diagnose --out`; with --model, show its torques."""
    payload: Annotated[AnyName | None, tyro.conf.arg(metavar="NAME|FILE.xml")] = None
    """Geometry of the payload; if omitted, that of the recording's label, or bars between the grasps."""
    web: bool = False
    """Serve the replay to a browser instead of opening the viewer."""

    def check_for(self, path: object, model: object) -> None:
        """Raise InputError if options exclude each other or do not apply to a single robot."""
        self.check_part(model)
        if path is not None and self.web:
            raise InputError("out and web are both given; choose a file or a browser")
        if model is not None:
            refuse_teams(self)
        elif self.map is not None or self.episode is not None:
            name = "map" if self.map is not None else "episode"
            raise InputError(
                f"{name} goes with a model; a team's log must be converted to a recording first (mocobot convert)"
            )


@dataclass(frozen=True, kw_only=True)
class Replay(Files, ReplayOptions):
    """Watch recordings in Rerun: the scene in motion by the measured angles, estimate and truth, all signals."""

    rec: Logs
    """Recordings (Parquet), shown side by side; with --model, joint logs of one robot."""
    model: Model = None
    out: Annotated[Path | None, tyro.conf.arg(metavar="OUT.rrd")] = None
    """Write a file for the Rerun viewer instead of opening it."""


@dataclass(frozen=True, kw_only=True)
class Example:
    """Write a robot's model and logs with one hidden fault, and print the commands that find it."""

    robot: tyro.conf.Positional[Literal["arm"]]
    """arm: a made-up arm of six axes, simulated in MuJoCo."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("mocobot-example")
    """Folder for arm.xml, today.csv, last_week.csv and answer.txt."""
    force: Force = False


OLD_NAMES = {"duration": "duration-s", "rate": "rate-hz", "max-gap": "max-gap-s", "out-dir": "out",
             "save": "out"}  # fmt: skip
"""Earlier names of options, which commands that have the new option still accept."""
