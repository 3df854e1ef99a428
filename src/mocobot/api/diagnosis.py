"""Find out what the simulation of a team or of a single robot gets wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discrepancy.evidence.findings import Word
from discrepancy.joints.diagnosed import JointDiagnosed
from discrepancy.result.read import name_of
from discrepancy.team.causes import read_tolerances
from discrepancy.team.diagnosis import against_truth, diagnose_team
from discrepancy.team.told import TeamDiagnosed
from discrepancy.team.two_bodies import TwoBodyDiagnosed
from mocobot.api.recordings import Given, Robots, Say, quiet, recordings_of
from mocobot.cluster import workers_of
from mocobot.option_types import made
from mocobot.options import DiagnoseOptions
from mocobot.results import Folder
from mocobot_sim.trial.truth import GroundTruth

if TYPE_CHECKING:
    from mocobot.api.joints import GivenLogs, GivenModel


@dataclass(frozen=True)
class Member:
    """One of the places of a cause that acts on several joints.

    Attributes:
        place: place in words.
        joint: number of the joint from 1, or None.
        parameters, standard_errors: as in ``Cause``.
    """

    place: str
    joint: int | None
    parameters: Mapping[str, float]
    standard_errors: Mapping[str, float | None]


@dataclass(frozen=True)
class Cause:
    """One named cause.

    Attributes:
        cause: name in the catalogue, such as ``"sea_bias"``.
        robot: number of the robot from 1, or None.
        joint: number of the joint from 1, or None.
        sentence: effect of the cause, with its numbers.
        parameters: values by name, with units in the names; ``make_effect`` accepts them.
        standard_errors: by the same names; None for parameters that were chosen instead of fitted.
        probability: posterior probability that this cause acts at this place.
        in_sample: share of the nominal model's misfit that the cause removes beyond the causes before it.
        held_out: the same share on trials that were left out of the fit, or None.
        place: place in words.
        members: places of the cause, empty for a team. If there are several, ``parameters`` are their medians.
        told: names of the smallest set of causes with 90 % of the probability, most likely first; empty for a team.
    """

    cause: str
    robot: int | None
    joint: int | None
    sentence: str
    parameters: Mapping[str, float]
    standard_errors: Mapping[str, float | None]
    probability: float
    in_sample: float
    held_out: float | None
    place: str
    members: tuple[Member, ...]
    told: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Folder):
    """A verdict with its support; prints as text, shows as a table in a notebook, writes a folder.

    The folder holds JSON, report, residuals and pictures; ``simulate`` accepts its ``extended`` as a model.

    Attributes:
        found: diagnosis of a team or of a single robot.
    """

    found: TeamDiagnosed | TwoBodyDiagnosed | JointDiagnosed
    result = "diagnosis"

    def to_dict(self) -> dict[str, Any]:
        """Return strict JSON values with units in the keys; see ``discrepancy.result.json``."""
        return self.found.to_dict()

    @property
    def verdict(self) -> Word:
        """One of "consistent", "miscalibrated", "explained", "partly_explained" and "unexplained"."""
        return self.to_dict()["verdict"]

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Named causes in the order of discovery."""
        return tuple(_cause(entry) for entry in self.to_dict()["causes"])

    def __repr__(self) -> str:
        """Return a one-line summary."""
        values = self.to_dict()
        named = ", ".join(map(name_of, values["causes"])) or "nothing named"
        return f"<Diagnosis of {len(values['recordings'])} trials: {self.verdict}; {named}>"

    def __str__(self) -> str:
        """Return the text report; for a single robot, its first sentences and its table."""
        return str(self.found)

    def verbose_text(self) -> str:
        """Return the full text report."""
        return self.found.verbose_text()

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import diagnosis_html

        return diagnosis_html(self.to_dict())

    def against_truth(self, truth: Mapping[str, Any]) -> Diagnosis:
        """Add the errors of the payload estimates, given the true payload; a single robot's diagnosis is unchanged.

        Args:
            truth: true payload, as ``GroundTruth.to_dict`` returns it; no errors are added if it does not fit.
        """
        if not isinstance(self.found, TeamDiagnosed):
            return self
        return replace(self, found=against_truth(self.found, truth))

    @property
    def used_truth(self) -> bool:
        """Whether the diagnosis contains errors of the estimates against the truth."""
        return isinstance(self.found, TeamDiagnosed) and self.found.errors is not None

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> None:
        """Write all files into an existing folder.

        Args:
            folder: existing folder.
            pictures: whether to draw pictures.
            more: further keys of the JSON.

        Raises:
            InputError: a file cannot be written.
        """
        self.found.write_into(folder, pictures=pictures, **more)


def diagnose(
    logs: Given | Iterable[Given] | GivenLogs,
    model: GivenModel | None = None,
    reference: GivenLogs | None = None,
    options: DiagnoseOptions | None = None,
    *,
    truth: GroundTruth | None = None,
    say: Say = quiet,
    simulated: Callable[[int], object] | None = None,
    note: Say = quiet,
    **fields: Any,
) -> Diagnosis:
    """Find out what the simulation gets wrong, name the physical cause, and measure what fixing it is worth.

    Args:
        logs: recordings of one payload, or paths of recordings or of logs that ``convert`` reads without further
            options; with a model, logs of its joints. Several logs allow validation on held-out data.
        model: single robot whose joints were logged, or path of its file; None for a team.
        reference: with a model, logs of the same robot when it was healthy; what deviates there, too, is not counted
            as a fault.
        options: options of the diagnosis; ``fields`` replace its fields. With a calibration, tolerances apply to the
            calibrated robots.
        truth: true payload, for the errors of the estimates; not used before the verdict.
        say: called with the name of each stage that begins.
        simulated: called with 1 after every simulated trial.
        note: called with a text on how each log, or the model, was read.

    Raises:
        InputError: logs, model, tolerances, causes or other options cannot be used.
    """
    chosen = made(DiagnoseOptions, options, fields)
    chosen.check_for(model, reference)
    if model is not None:
        return Diagnosis(_diagnosed_joints(model, logs, reference or (), chosen, say, note))
    known = read_tolerances(None if chosen.tolerances is None else Path(chosen.tolerances))
    given: Any = logs
    robots, episode = Robots(chosen.calibration), chosen.episode
    recordings = list(recordings_of(given, chosen.map, robots, episode=episode, say=say, note=note))
    with workers_of(chosen.scheduler):
        found = diagnose_team(
            recordings, known, tuple(chosen.exclude),
            closed_loop=chosen.closed_loop, laws=chosen.laws, odds=chosen.odds, whole=chosen.whole,
            seconds=chosen.seconds, jobs=chosen.jobs, say=say, simulated=simulated,
        )  # fmt: skip
    return Diagnosis(found) if truth is None else Diagnosis(found).against_truth(truth.to_dict())


def _diagnosed_joints(
    model: GivenModel, logs: Any, reference: Any, chosen: DiagnoseOptions, say: Say, note: Say
) -> JointDiagnosed:
    """Diagnose a single robot; with the option ``closed_loop``, also roll out its simulation."""
    from discrepancy.joints.rolled import rolled_out
    from discrepancy.joints.verdict import judged
    from mocobot.api.joints import read_logs, read_model

    robot = read_model(model, lock=chosen.lock, base=chosen.base)
    tolerances = _joint_tolerances(chosen.tolerances)
    for text in robot.notes:
        note(f"{robot.path.name}: {text}")
    say("reading")
    read = [read_logs(given, robot, map=chosen.map, episode=chosen.episode) for given in (logs, reference)]
    verdict = judged(
        robot, read[0], reference=read[1], excluded=tuple(chosen.exclude), tolerances=tolerances,
        seconds=chosen.seconds, say=say,
    )  # fmt: skip
    return JointDiagnosed(verdict, rolled_out(verdict, say) if chosen.closed_loop else None)


def _joint_tolerances(path: Path | str | None) -> dict[str, dict[str, float]] | None:
    """Read the tolerances that a file sets, by cause and parameter; None without a file."""
    from discrepancy.cause_names import read_tolerances as read
    from discrepancy.joints.effects import NAMES

    if path is None:
        return None
    none = {name: dict.fromkeys(names, math.nan) for name, names in NAMES.items()}
    given = {
        name: {key: x for key, x in values.items() if not math.isnan(x)}
        for name, values in read(Path(path), none).items()
    }
    return {name: values for name, values in given.items() if values}


def _cause(values: Mapping[str, Any]) -> Cause:
    return Cause(
        values["cause"], values["robot"], values["joint"], values["sentence"], *_numbers(values),
        values["probability"], values["explained"]["in_sample"], values["explained"]["held_out"], values["place"],
        tuple(Member(entry["place"], entry["joint"], *_numbers(entry)) for entry in values["members"]),
        tuple(entry["name"] for entry in values.get("told", ())),
    )  # fmt: skip


def _numbers(values: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, float | None]]:
    parameters = values["parameters"].items()
    return {name: of["value"] for name, of in parameters}, {name: of["se"] for name, of in parameters}
