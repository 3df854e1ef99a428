"""Read a diagnosis from its file (format: ``discrepancy.result.json``)."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimator.errors import InputError
from estimator.strict import read_json

FORMAT, VERSION, NAME = "mocobot-diagnosis", 3, "diagnosis.json"
READABLE = (2, VERSION)
"""Readable versions."""
EXTENDED, AS_FOUND = "extended", "as_found"
"""Folders of models in a result folder: with the named causes, and with every part at its fitted value."""
VERDICTS = {
    "consistent": "Consistent",
    "miscalibrated": "Miscalibrated",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}
"""Verdicts in words."""


@dataclass(frozen=True)
class NamedCause:
    """One named cause.

    Attributes:
        name: identifier, such as ``sea_bias``.
        robot, joint: place, counted from 1; None if it has no such place.
        sentence: its effect with values.
        kind: the cause in words, such as ``torque zero of a driven joint``.
        label: the cause with its place, such as ``torque zero of joint 1 of robot 2``.
    """

    name: str
    robot: int | None
    joint: int | None
    sentence: str
    kind: str = ""
    label: str = ""


@dataclass(frozen=True)
class WrittenDiagnosis:
    """Content of a diagnosis file.

    Attributes:
        verdict: one of the keys of ``VERDICTS``.
        causes: in the order of discovery.
        recordings: names of the trials.
        of_joints: whether it is about one robot of joints, not about a team.
    """

    verdict: str
    causes: tuple[NamedCause, ...]
    recordings: tuple[str, ...]
    of_joints: bool = False

    def is_of(self, recording: str) -> bool:
        """Whether the diagnosis used a recording, by file name, or parts of it (``team.long``)."""
        names = {Path(name).name for name in self.recordings}
        return Path(recording).name in names | {re.sub(r", \d+ to \d+ s$", "", name) for name in names}

    def robots(self) -> int:
        """Largest robot number among the causes; 0 if there is none."""
        return max((cause.robot or 0 for cause in self.causes), default=0)


def read_diagnosis(folder: Path) -> WrittenDiagnosis:
    """Read the result of ``mocobot diagnose --out``.

    Args:
        folder: the result folder, or its ``diagnosis.json``.

    Raises:
        InputError: there is no diagnosis, or it is incomplete.
    """
    path = folder if folder.suffix == ".json" else folder / NAME
    return parse_diagnosis(read_json(path, "a diagnosis"), path)


def as_now(values: Mapping[str, Any]) -> dict[str, Any]:
    """Add keys that older versions lack, so that a file has the current form."""

    def finding(entry: Mapping[str, Any]) -> dict[str, Any]:
        rivals = entry.get("alternatives", [])
        told = [x for x in (entry, *rivals) if x is entry or x.get("ambiguous")]
        new: dict[str, Any] = {
            "members": [],
            "event": None,
            "at": None,
            "folds": [],
            "alternatives": [],
            "law": None,
        }
        new["told"] = [{key: x[key] for key in ("cause", "place", "name")} for x in told]
        new |= {
            "explained": {"in_sample": 0.0, "held_out": None},
            "separate": "",
            "parameters": {},
            "shape": {},
        }
        return new | {"instead": {"nothing": 0.0, "unlisted": 0.0}} | dict(entry)

    machine = "joints" if is_of_joints(values) else "team"
    lists = {name: [finding(entry) for entry in values.get(name, [])] for name in ("causes", "suspected")}
    new = {"machine": machine, "finished": True, "reference": [], "rollouts": None, "places": []}
    return new | dict(values) | lists


def parse_diagnosis(values: Mapping[str, Any], path: Path) -> WrittenDiagnosis:
    """Parse the values of a diagnosis file; ``path`` is for messages.

    Raises:
        InputError: the values are no diagnosis, of an unreadable version, or incomplete.
    """
    if values.get("format") != FORMAT:
        raise InputError(f"{path}: not a diagnosis; it must have format {FORMAT!r}")
    if values.get("version") not in READABLE:
        version = values.get("version")
        raise InputError(
            f"{path}: is a diagnosis of version {version!r:.40}; this mocobot reads "
            f"versions {' and '.join(map(str, READABLE))}"
        )
    verdict = values.get("verdict")
    if verdict not in VERDICTS:
        raise InputError(f"{path}: verdict is {verdict!r:.40}; it must be one of {', '.join(VERDICTS)}")
    try:
        causes = tuple(_cause(entry) for entry in values["causes"])
        recordings = tuple(str(name) for name in values["recordings"])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"{path}: not a complete diagnosis ({type(error).__name__}: {error})") from error
    return WrittenDiagnosis(verdict, causes, recordings, is_of_joints(values))


def _cause(values: Mapping[str, Any]) -> NamedCause:
    name, robot, joint = str(values["cause"]), values["robot"], values["joint"]
    most_joints = (
        None if robot is None else 3
    )  # only team robots are numbered; they are Deltas with three joints
    for what, number, most in (("robot", robot, None), ("joint", joint, most_joints)):
        if number is not None and (type(number) is not int or number < 1 or (most and number > most)):
            raise ValueError(f"{what} is {number!r:.40}")
    return NamedCause(name, robot, joint, str(values["sentence"]), kind_of(values), name_of(values))


def name_of(entry: Mapping[str, Any]) -> str:
    """A cause with its place in words."""
    return entry["name"]


def kind_of(entry: Mapping[str, Any]) -> str:
    """A cause in words, without its place."""
    return entry["kind"]


def is_of_joints(values: Mapping[str, Any]) -> bool:
    """Whether a diagnosis is about one robot of joints. Version 2 does not say; only such robots have rollouts."""
    return values.get("machine", "joints" if values.get("rollouts") else "") == "joints"
