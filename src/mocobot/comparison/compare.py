"""Read two results and compare them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from discrepancy.result.read import FORMAT as DIAGNOSIS
from discrepancy.result.read import NAME as DIAGNOSIS_NAME
from discrepancy.result.read import parse_diagnosis
from estimator.calibrate.json import FORMAT as CALIBRATION
from estimator.calibrate.json import calibration_from_dict
from estimator.errors import InputError
from estimator.estimate.result import FORMAT as ESTIMATE
from estimator.estimate.result import PayloadEstimate
from estimator.strict import read_json
from mocobot.comparison import calibrations, diagnoses, estimates
from mocobot.comparison.comparison import Comparison
from mocobot.files.targets import CALIBRATION as CALIBRATION_NAME

KINDS = {ESTIMATE: "estimate", CALIBRATION: "calibration", DIAGNOSIS: "diagnosis"}
SOUGHT = "an estimate of `mocobot estimate`, or a calibration or diagnosis of `mocobot calibrate` or `diagnose --out`"


@dataclass(frozen=True)
class _Result:
    """A result as it was read: its name, its kind, itself, and what it says of the files that it was made from."""

    name: str
    kind: str
    value: Any
    files: Mapping[str, str]


class Written(Protocol):
    """A result in memory: an estimate, a calibration or a diagnosis."""

    def to_dict(self) -> dict[str, Any]:
        """What its file would hold."""
        ...


def compare(a: Path | str | Written, b: Path | str | Written) -> Comparison:
    """Compare two estimates, calibrations or diagnoses.

    Args:
        a, b: results, their JSON files, or the folders that hold one.

    Raises:
        InputError: one cannot be read, they are of different kinds, or of different robots.
    """
    one, other = _read(a), _read(b)
    if one.kind != other.kind:
        raise InputError(
            f"{one.name} is {_a(one.kind)} and {other.name} {_a(other.kind)}; both must be of one kind"
        )
    if one.kind == "diagnosis" and {one.value.get("machine"), other.value.get("machine")} >= {
        "team",
        "joints",
    }:
        raise InputError(
            f"{one.name} and {other.name} are diagnoses of a team and of one robot's joints; both must be of one kind"
        )
    groups, changes, notes = _compared(one.kind, one.value, other.value)
    notes = [*_shared(one, other), *notes]
    return Comparison(one.kind, one.name, other.name, tuple(groups), tuple(changes), tuple(notes))


def _compared(kind: str, a: Any, b: Any) -> tuple[list[Any], list[str], list[str]]:
    if kind == "estimate":
        return estimates.groups_of(a, b), [], estimates.notes_of(a, b)
    if kind == "calibration":
        return calibrations.groups_of(a, b), [], calibrations.notes_of(a, b)
    return diagnoses.groups_of(a, b), diagnoses.changes_of(a, b), diagnoses.notes_of(a, b)


def _shared(a: _Result, b: _Result) -> list[str]:
    """Recordings that both were made from: their errors are not independent."""
    names = sorted({name for digest, name in a.files.items() if digest in b.files})
    if not names:
        return []
    return [
        f"Both were made from {', '.join(names)}: errors that come from there are in both, and differences are better "
        "known than is said."
    ]


def _read(given: Path | str | Written) -> _Result:
    if isinstance(given, Path | str):
        file = _file(Path(given))
        return _result(str(given), str(file), read_json(file, SOUGHT))
    return _result(f"{given!r}", f"{given!r}", given.to_dict())


def _file(path: Path) -> Path:
    """The JSON of a result, or the only one in its folder."""
    if not path.is_dir():
        return path
    found = [path / name for name in (CALIBRATION_NAME, DIAGNOSIS_NAME) if (path / name).is_file()]
    found = found or sorted(one for one in path.glob("*.json") if not one.name.endswith(".truth.json"))
    if len(found) != 1:
        what = "holds no result" if not found else f"holds {len(found)} JSON files"
        raise InputError(f"{path}: {what}; name the file of {SOUGHT}")
    return found[0]


def _result(name: str, where: str, values: dict[str, Any]) -> _Result:
    kind = KINDS.get(str(values.get("format")))
    if kind == "estimate":
        try:
            value: Any = PayloadEstimate.from_dict(values)
        except InputError as error:
            raise InputError(f"{where}: {error}") from error
    elif kind == "calibration":
        value = calibration_from_dict(values, where)
    elif kind == "diagnosis":
        parse_diagnosis(values, Path(where))
        value = values
    else:
        raise InputError(f"{where}: format is {values.get('format')!r:.40}; it must be {SOUGHT}")
    made = values.get("provenance")
    listed = made.get("files", []) if isinstance(made, dict) else []
    files = {str(f.get("sha256")): str(f.get("name")) for f in listed if isinstance(f, dict)}
    return _Result(name, kind, value, files)


def _a(kind: str) -> str:
    return f"{'an' if kind == 'estimate' else 'a'} {kind}"
