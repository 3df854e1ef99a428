"""Read the results in a folder for a report, and find the recordings from which they were made."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import UndefinedError

from discrepancy.joints.calibrated import FORMAT as JOINT_CALIBRATION
from discrepancy.joints.calibrated import from_dict
from discrepancy.result.read import FORMAT as DIAGNOSIS
from discrepancy.result.read import as_now, parse_diagnosis
from discrepancy.result.report import format_verdict
from discrepancy.result.traces import NAME as RESIDUALS
from discrepancy.result.traces import Channel, Trace, load_traces
from estimator.calibrate.json import FORMAT as CALIBRATION
from estimator.calibrate.json import calibration_from_dict
from estimator.errors import InputError
from estimator.estimate.result import FORMAT as ESTIMATE
from estimator.estimate.result import VERSION as ESTIMATE_VERSION
from estimator.estimate.result import PayloadEstimate
from estimator.files import system_errors
from estimator.inputs import file_sha256
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from estimator.strict import Fields, is_number, read_json
from estimator.two_bodies.result import FORMAT as TWO_BODIES
from mocobot_report import CAMPAIGN_FORMAT as CAMPAIGN
from mocobot_report import SOUGHT, check_folder
from mocobot_sim.paper.tables import paper_tables, summary_table
from mocobot_view.payload import read_any_estimate, read_estimate

KINDS = ("paper", "estimate", "calibration", "diagnosis", "joint-calibration", "campaign", "two-bodies")
"""Kinds of results, in the order of the page."""
PROVENANCE = "mocobot-provenance"
TRIAL_KEYS = ("rotation_deg", "torque_Nm", "rod_error_m", "weld_error_m", "weld_error_deg")
Json = dict[str, Any]


@dataclass(frozen=True)
class Result:
    kind: str  # one of KINDS
    path: Path
    found: Any  # Paper, PayloadEstimate, TwoBodies, Calibration, Diagnosed, Told, or a campaign's summary
    provenance: Json | None
    files: tuple[Path, ...]  # files from which it was read


@dataclass(frozen=True)
class Paper:
    """Results that ``mocobot paper --out`` wrote."""

    scores: Mapping[str, Mapping[str, Any]]  # by preset, then payload
    trials: tuple[Json, ...]  # summaries of the simulated trials, possibly empty
    estimates: Mapping[tuple[str, str], PayloadEstimate]  # existing estimates by (payload, preset)


@dataclass(frozen=True)
class Diagnosed:
    """Result that ``mocobot diagnose --out`` wrote."""

    values: Json  # JSON with the keys of discrepancy.result.json
    traces: tuple[Trace, ...]  # residuals of every trial; empty if the folder has none
    channels: tuple[Channel, ...]


def read_folder(folder: Path) -> list[Result]:
    """Read all results in a folder, in the order of the page."""
    check_folder(folder)
    with system_errors(folder, "read"):
        paths = sorted(path for path in folder.glob("*.json") if path.is_file())
    results: list[Result] = []
    for path in paths:
        if path.name in ("trials.json", "provenance.json") or path.name.endswith(".truth.json"):
            continue
        values = read_json(path, "a result of mocobot")
        if kind := _kind(path, values):
            if kind == "diagnosis" and any(one.kind == kind for one in results):
                raise InputError(f"{path}: is a second diagnosis in one folder; a report takes one")
            results.append(READERS[kind](path, values))
    if not results:
        raise InputError(f"{folder}: holds no result of mocobot; a report is made of {SOUGHT}")
    return sorted(results, key=lambda one: KINDS.index(one.kind))


def _kind(path: Path, values: Json) -> str | None:
    if path.name in ("paper.json", "diagnosis.json"):
        return path.stem
    known = (ESTIMATE, CALIBRATION, DIAGNOSIS, JOINT_CALIBRATION, CAMPAIGN, TWO_BODIES)
    formats: dict[str, str] = dict(zip(known, KINDS[1:], strict=True))
    named = values.get("format")
    return formats.get(named) if isinstance(named, str) else None


def _paper(path: Path, scores: Json) -> Result:
    with complete(path, "not the scores of the paper's experiment"):
        tables = [*paper_tables(scores), summary_table(scores)]
        cells = [cell for table in tables for row in table.rows for cell in row.cells]
        numbers = [x for cell in cells for x in (cell.value, cell.spread) if x is not None]
        if not cells or not all(is_number(x) and x >= 0 for x in numbers):
            raise ValueError("it must hold errors, numbers of at least 0 or null")
    folder, trials = path.parent, path.with_name("trials.json")
    files = {
        (payload, preset): file
        for preset, by_payload in scores.items()
        for payload in by_payload
        if (file := folder / "estimates" / f"{payload}_{preset}.json").is_file()
    }
    found = Paper(scores, _trials(trials), {key: read_estimate(file) for key, file in files.items()})
    made, beside = _provenance_beside(path)
    read = [path, *([trials] if trials.is_file() else []), *beside, *files.values()]
    return Result("paper", path, found, made, tuple(read))


def _trials(path: Path) -> tuple[Json, ...]:
    if not path.is_file():
        return ()
    trials = Fields(read_json(path, "the checks of the trials"), ("trials",), str(path)).list("trials")
    for k, values in enumerate(trials):
        trial = Fields(values, ("name", *TRIAL_KEYS), f"{path}: trials[{k}]", ("damping_ratio",))
        trial.text("name")
        for key in TRIAL_KEYS:
            trial.number(key, 0.0)
    return tuple(trials)


def _provenance_beside(path: Path) -> tuple[Json | None, list[Path]]:
    """Read ``provenance.json`` beside a result; also list that file if it exists."""
    file = path.with_name("provenance.json")
    if not file.is_file():
        return None, []
    values = read_json(file, "the provenance of a result")
    return values if values.get("format") == PROVENANCE else None, [file]


def _provenance_within(values: Json) -> Json | None:
    made = values.get("provenance")
    return made if isinstance(made, dict) else None


def _two_bodies(path: Path, values: Json) -> Result:
    return Result("two-bodies", path, read_any_estimate(path), _provenance_within(values), (path,))


def _estimate(path: Path, values: Json) -> Result:
    version = values.get("version")
    if version != ESTIMATE_VERSION:
        raise InputError(
            f"{path}: is an estimate of version {version!r:.40}; this mocobot reads version {ESTIMATE_VERSION}"
        )
    return Result("estimate", path, read_estimate(path), _provenance_within(values), (path,))


def _calibration(path: Path, values: Json) -> Result:
    kind, read = "calibration", calibration_from_dict
    if values["format"] == JOINT_CALIBRATION:
        kind, read = "joint-calibration", from_dict
    return Result(kind, path, read(values, str(path)), _provenance_within(values), (path,))


def _diagnosis(path: Path, values: Json) -> Result:
    parse_diagnosis(values, path)
    with complete(path, "not a complete diagnosis"):
        # Formatting the text checks that most keys of the report exist.
        values = as_now(values)
        format_verdict(values, verbose=True)
    file = path.with_name(RESIDUALS)
    traces, channels = load_traces(file) if file.is_file() else ([], [])
    if traces and [trace.name for trace in traces] != list(values["recordings"]):
        raise InputError(f"{file}: is of other trials than {path.name}; diagnose again")
    found = Diagnosed(values, tuple(traces), tuple(channels))
    return Result("diagnosis", path, found, _provenance_within(values), (path, file) if traces else (path,))


def _campaign(path: Path, values: Json) -> Result:
    made, beside = _provenance_beside(path)
    return Result("campaign", path, values, made, (path, *beside))


READERS: Mapping[str, Callable[[Path, Json], Result]] = {
    "paper": _paper, "estimate": _estimate, "calibration": _calibration, "diagnosis": _diagnosis,
    "joint-calibration": _calibration, "campaign": _campaign, "two-bodies": _two_bodies,
}  # fmt: skip


INCOMPLETE = (
    LookupError, TypeError, ValueError, AttributeError, OverflowError, StopIteration, UndefinedError,
)  # fmt: skip
"""Exceptions that reading raises if a value is missing or has the wrong type."""


@contextmanager
def complete(path: Path, otherwise: str = "not complete") -> Iterator[None]:
    """Context manager around reading the values of a file: turn missing or invalid values into an InputError."""
    try:
        yield
    except INCOMPLETE as error:
        text = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) and error.args else str(error)
        words = " ".join(text.split())[:120] or type(error).__name__
        raise InputError(f"{path}: {otherwise} ({words})") from error


@dataclass(frozen=True)
class Source:
    """A recording from which a result was made."""

    name: str
    path: Path | None
    why: str = ""  # reason why it is not used, without a full stop

    def recording(self) -> Recording:
        """Read the recording; InputError if it was not found or cannot be read."""
        if self.path is None:
            raise InputError(self.why)
        return read_recording(self.path)


def sources(result: Result) -> list[Source]:
    """Find the recordings that the provenance of a result lists.

    The search covers the path that the user gave (from the current folder and from that of the result), the folder of
    the result and its parent. The hash must match.
    """
    files = (result.provenance or {}).get("files")
    listed = [entry for entry in files if isinstance(entry, dict)] if isinstance(files, list) else []
    folder = result.path.parent
    return [_source(entry, folder) for entry in listed if str(entry.get("path", "")).endswith(".parquet")]


def _source(entry: Json, folder: Path) -> Source:
    name, given, changed = str(entry.get("name", "")), entry["path"], False
    for path in (Path(given), folder / given, folder / name, folder.parent / name):
        try:
            same = file_sha256(path) == entry.get("sha256")
        except (OSError, ValueError):  # the name contains NUL
            continue
        if same:
            return Source(name, path)
        changed = True
    if changed:
        return Source(name, None, f"{name} is no longer the file that the result was made from")
    return Source(name, None, f"{name} is no longer where it was ({given})")
