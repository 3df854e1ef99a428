"""Options of the commands that find something out."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from discrepancy.rules.inference import PRIOR_ODDS
from mocobot.options.common import Calibrated, Flag, Force, MaxUnpacked, Model, Scheduler


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
    named can be validated. One MAT file with --rig emps; logs of a robot's joints with --model."""
    map: Annotated[str | None, tyro.conf.arg(metavar="MAP.toml|NAME")] = None
    """Map of the logs that are no recordings; found out if not given. With --model, log.toml beside log or model."""
    model: Model = None
    reference: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="LOG...")] = ()
    """With --model: logs of the same robot while it was well; what is off there, too, is no news."""
    rig: Literal["team", "emps"] = "team"
    """What was recorded: a team of mocobots, or the EMPS benchmark's axis (docs/emps.md)."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for diagnosis.json, report.txt, the extended model and plots."""
    force: Force = False
    strict: Flag = False
    """Exit with 1 if the verdict is neither consistent nor explained."""
    jobs: int = 2
    """Parallel processes."""
    scheduler: Scheduler = None
    calibration: Calibrated = None
    tolerances: Annotated[Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """How far a healthy robot may be off; see docs/diagnosis/guide.md."""
    exclude: Annotated[tuple[str, ...], tyro.conf.arg(metavar="CAUSE...")] = ()
    """Causes not to consider."""
    closed_loop: bool = True
    """Run the recorded commands again, without and with what is found."""
    laws: Literal["auto", "always", "never"] = "auto"
    """Look for laws that the catalogue lacks: where something unlisted is left or a cause is unsure, always, never."""
    odds: float = PRIOR_ODDS
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
