"""A diagnosis to be shown: its verdict, and where its causes sit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from discrepancy.team.causes import CAUSES
from estimator.errors import InputError
from mocobot_view.bodies.robot import GIMBAL
from mocobot_view.facts.fact_files import read_json

FORMAT, VERSION, NAME = "mocobot-diagnosis", 1, "diagnosis.json"
VERDICTS = {
    "consistent": "Consistent",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}


@dataclass(frozen=True)
class Cause:
    """One named cause.

    Attributes:
        name: of the cause, such as ``sea_bias``.
        robot: counted from 1, or None for the payload.
        body: the robot's body that it sits at, such as ``proximal1``; None for the base, or the payload.
        sentence: what it does, with its numbers.
    """

    name: str
    robot: int | None
    body: str | None
    sentence: str


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis says.

    Attributes:
        verdict: one of the keys of ``VERDICTS``.
        causes: in the order of discovery.
        recordings: names of the trials it was made from.
    """

    verdict: str
    causes: tuple[Cause, ...]
    recordings: tuple[str, ...]

    def robots(self) -> int:
        """Largest number of a robot that a cause sits at; 0 if none does."""
        return max((cause.robot or 0 for cause in self.causes), default=0)


def read_diagnosis(folder: Path) -> Diagnosis:
    """Read what ``mocobot diagnose --out`` wrote for a team.

    Args:
        folder: it, or its ``diagnosis.json``.

    Raises:
        InputError: there is no diagnosis, or not one of a team of robots.
    """
    path = folder if folder.suffix == ".json" else folder / NAME
    values = read_json(path, "a diagnosis")
    if values.get("format") != FORMAT or values.get("version") != VERSION:
        raise InputError(f"{path}: not a diagnosis; it must have format {FORMAT!r} and version {VERSION}")
    verdict = values.get("verdict")
    if verdict not in VERDICTS:
        raise InputError(f"{path}: verdict is {verdict!r:.40}; it must be one of {', '.join(VERDICTS)}")
    try:
        causes = tuple(_cause(entry) for entry in values["causes"])
        recordings = tuple(str(name) for name in values["recordings"])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"{path}: not a complete diagnosis ({type(error).__name__}: {error})") from error
    return Diagnosis(verdict, causes, recordings)


def _cause(values: dict[str, Any]) -> Cause:
    name, robot, joint = str(values["cause"]), values["robot"], values["joint"]
    for what, number, most in (("robot", robot, None), ("joint", joint, 3)):
        if number is not None and (type(number) is not int or number < 1 or (most and number > most)):
            raise ValueError(f"{what} is {number!r:.40}")
    body, at = None, CAUSES[name].at if name in CAUSES else None
    if robot is not None:
        if joint is not None:
            body = GIMBAL[joint - 1] if at == "gimbal joint" else f"proximal{joint}"
        elif at == "grasp":
            body = "flange"
    return Cause(name, robot, body, str(values["sentence"]))
