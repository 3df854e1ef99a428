"""Types of options that several commands share, the base classes of options, and their checks."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, TypeAlias, TypeVar

import tyro

from estimator.errors import InputError

if TYPE_CHECKING:  # Python callers may pass the object itself instead of the path of its file
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
        help="Map from a log's columns to channels: a file or built-in name (docs/measured-data.md); "
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
BEFORE = "With --model: logs of the robot from before, such as last week's; only what has changed since is reported."
Reference = Annotated[tuple[Path, ...], tyro.conf.arg(metavar="LOG...", help=BEFORE)]
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
"""Bounds of the conversion: rates [Hz] and the longest filled gap [s]. Chosen: the estimator's filter passes 5 Hz."""


class Options:
    """Base class of all options."""

    OF_TEAMS: ClassVar[tuple[str, ...]] = ()
    """Options that a single robot does not have."""

    def check(self) -> None:
        """Raise InputError if options exclude each other or a number is out of range."""


Made = TypeVar("Made", bound=Options)


def made(kind: type[Made], options: Made | None, given: Mapping[str, Any]) -> Made:
    """Build the options of a call: the given object, with its fields replaced by the keyword arguments.

    Raises:
        InputError: options contradict each other, or a value is out of range.
        TypeError: an option does not exist.
    """
    found: Any = kind(**given) if options is None else replace(options, **given)  # pyright: ignore
    found.check()
    return found


def refuse_teams(options: Any) -> None:
    """Raise InputError if an option that only applies to a team is set while a single robot's model is given."""
    default = {field.name: field.default for field in fields(options)}
    for name in options.OF_TEAMS:
        if getattr(options, name) != default[name]:
            raise InputError(f"{name} is of a team's robots; with a model there is none")


def refuse_both(options: Any, one: str, other: str, why: str) -> None:
    """Raise InputError if two options that exclude each other are both set."""
    if getattr(options, one) not in (None, ()) and getattr(options, other) not in (None, ()):
        raise InputError(f"{one} and {other} are both given; {why}")


def check_range(options: Any, name: str, least: float, most: float = math.inf) -> None:
    """Raise InputError if a number is out of range."""
    value = getattr(options, name)
    if not least <= value <= most:
        allowed = f"at least {least:g}" if most == math.inf else f"from {least:g} to {most:g}"
        raise InputError(f"{name} is {value:g}; it must be {allowed}")


def check_seconds(seconds: float | None) -> None:
    """Raise InputError if the time limit is not positive or exceeds ``LONGEST_S``."""
    if seconds is not None and not 0.0 < seconds <= LONGEST_S:
        raise InputError(f"seconds is {seconds:g}; it must be above 0 and at most {LONGEST_S:g} s")


def check_motion(options: Any, kinds: Sequence[str], needed: Mapping[str, tuple[str, ...]]) -> None:
    """Raise InputError if an option is set that applies to none of the trials.

    Args:
        options: options of the simulation.
        kinds: kind of every trial.
        needed: for each option, the trial kinds to which it applies.

    Raises:
        InputError: an option is set, but no trial is of a kind to which it applies.
    """
    for name, wanted in needed.items():
        if getattr(options, name) is not None and not set(wanted) & set(kinds):
            given = "this one is" if len(kinds) == 1 else "these are"
            raise InputError(f"{name} is for a {' or '.join(wanted)} trajectory; {given} {', '.join(kinds)}")


def kinds_of(trials: str, known: Sequence[str]) -> tuple[str, ...]:
    """Split a list such as ``random,static`` into the kind of every trial."""
    kinds = tuple(trials.split(","))
    if not set(kinds) <= set(known):
        raise InputError(
            f"trials is {trials!r}; it must be a list such as random,random,periodic,static of {', '.join(known)}"
        )
    return kinds


@dataclass(frozen=True, kw_only=True)
class Files:
    """Options shared by all commands that read a log and write a result."""

    force: Force = False
    max_unpacked: MaxUnpacked = None


@dataclass(frozen=True, kw_only=True)
class PartOptions(Options):
    """Options that take a part of a robot's model as the arm."""

    lock: Annotated[AnyWords, tyro.conf.UseAppendAction, tyro.conf.arg(metavar="JOINT=VALUE")] = ()
    """With --model: a joint that does not move, such as a gripper's, and its position [rad, 30deg, or m]."""
    base: Annotated[AnyName | None, tyro.conf.arg(metavar="BODY")] = None
    """With --model: the arm is what this body carries; its parent stands still."""

    def check_part(self, model: object) -> None:
        """Raise InputError if a part is named of no model."""
        if model is None and (self.lock or self.base is not None):
            raise InputError("lock and base take a part of a model; name the model with --model")
