"""Find out what the simulation of a team gets wrong."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from discrepancy.evidence.findings import Word
from discrepancy.evidence.settings import ODDS
from discrepancy.joints.diagnosed import JointDiagnosed
from discrepancy.result.read import name_of
from discrepancy.team.causes import read_tolerances
from discrepancy.team.diagnosis import When, against_truth, diagnose_team
from discrepancy.team.told import TeamDiagnosed
from estimator.files import holds, whole_folder
from mocobot.api.given import Given, GivenCalibration, Robots, recordings_of
from mocobot.files.targets import check_folder
from mocobot_sim.trial.truth import GroundTruth


@dataclass(frozen=True)
class Member:
    """One place of a cause that all joints have.

    Attributes:
        place: in words.
        joint: counted from 1, or None.
        parameters, standard_errors: as of ``Cause``.
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
        robot: counted from 1, or None.
        joint: counted from 1, or None.
        sentence: what it does, with its numbers.
        parameters: values by name, units in the names; ``make_effect`` takes them.
        standard_errors: by the same names; None for what was chosen, not fitted.
        probability: that it is this cause, at this place.
        in_sample: share of the nominal model's misfit that it removes beyond the causes before it.
        held_out: the same on trials left out of the fit, or None.
        place: in words.
        members: its places; several of a cause that all joints have, whose ``parameters`` are the medians; none of a
            team's cause.
        told: names in words of the smallest set of causes that holds 90 %, the likeliest first; empty of a team's.
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
class Diagnosis:
    """A verdict with all that supports it: printable, a table in a notebook, and a folder of files.

    Attributes:
        found: of a team, or of one robot of joints.
    """

    found: TeamDiagnosed | JointDiagnosed

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys; see ``discrepancy.result.json`` for the keys."""
        return self.found.to_dict()

    @property
    def verdict(self) -> Word:
        """``"consistent"``, ``"miscalibrated"``, ``"explained"``, ``"partly_explained"`` or ``"unexplained"``."""
        return self.to_dict()["verdict"]

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The named causes, in the order of discovery."""
        return tuple(_cause(entry) for entry in self.to_dict()["causes"])

    def __repr__(self) -> str:
        """One line."""
        values = self.to_dict()
        named = ", ".join(map(name_of, values["causes"])) or "nothing named"
        return f"<Diagnosis of {len(values['recordings'])} trials: {self.verdict}; {named}>"

    def __str__(self) -> str:
        """The text report; of a robot of joints its first sentences and its table."""
        return str(self.found)

    def verbose_text(self) -> str:
        """The whole text report."""
        return self.found.verbose_text()

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import diagnosis_html

        return diagnosis_html(self.to_dict())

    def write(self, folder: Path | str) -> None:
        """Write JSON, report, residuals, pictures and the extended model; an earlier diagnosis is replaced.

        ``mocobot report`` makes a page of the folder; ``simulate`` takes its ``extended`` as a model.

        Raises:
            InputError: the folder holds something else, or cannot be written.
        """
        check_folder(Path(folder), [], holds("diagnosis"), "an earlier diagnosis", force=True)
        with whole_folder(Path(folder), "diagnosis") as whole:
            self.write_into(whole)

    def write_into(self, folder: Path, **more: Any) -> None:
        """The same into an existing folder, with further keys in the JSON."""
        self.found.write_into(folder, **more)


def diagnose(
    recordings: Given | Iterable[Given],
    *,
    map: Path | str | None = None,
    truth: GroundTruth | None = None,
    calibration: GivenCalibration | None = None,
    tolerances: Path | str | None = None,
    exclude: Iterable[str] = (),
    closed_loop: bool = True,
    laws: When = "auto",
    odds: float = ODDS,
    whole: bool = False,
    jobs: int = 1,
    say: Callable[[str], object] = lambda _: None,
    simulated: Callable[[int], object] | None = None,
) -> Diagnosis:
    """Find out what the simulation gets wrong, name the physical cause, and measure what fixing it is worth.

    Args:
        recordings: of one payload, or paths of their files, or of logs that ``convert`` reads as they are; several, so
            that what is named can be validated.
        map: map of those logs, by file or built-in name (docs/measured-data.md); found out if not given.
        truth: of the payload, for the errors of the estimates; it is not looked at before the verdict.
        calibration: the robots as they are, or its file; None for what the recordings say of them. Tolerances are then
            of robots as it has them.
        tolerances: TOML file: how far a healthy robot may be off (docs/diagnosis/guide.md); None for the defaults.
        exclude: causes not to consider.
        closed_loop: whether to run the recorded commands again, without and with what is found.
        laws: whether to look for laws that the catalogue lacks: ``"auto"`` where something unlisted is left, or
            a cause is not sure, ``"always"``, or ``"never"``.
        odds: of any cause being there before the data are seen, at all its places together.
        whole: whether to search all of long recordings, not a choice of their parts.
        jobs: parallel processes.
        say: takes the name of the stage that begins.
        simulated: called with 1 for every trial that was simulated.

    Raises:
        InputError: recordings, tolerances, causes or odds that cannot be used, or a calibration of other robots.
    """
    known = read_tolerances(Path(tolerances) if tolerances is not None else None)
    found = diagnose_team(
        list(recordings_of(recordings, map, Robots(calibration))), known, tuple(exclude),
        closed_loop=closed_loop, laws=laws, odds=odds, whole=whole, jobs=jobs, say=say, simulated=simulated,
    )  # fmt: skip
    if truth is not None:
        found = against_truth(found, truth.to_dict())
    return Diagnosis(found)


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
