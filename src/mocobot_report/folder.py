"""What a folder holds that a report can be made of."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from discrepancy.channel import Channel
from discrepancy.result.read import FORMAT as DIAGNOSIS
from discrepancy.result.read import as_now, parse_diagnosis
from discrepancy.result.report import format_verdict
from discrepancy.result.traces import Trace
from discrepancy.result.traces_file import NAME as RESIDUALS
from discrepancy.result.traces_file import load_traces
from estimator.calibrate.calibration import Calibration
from estimator.calibrate.json import FORMAT as CALIBRATION
from estimator.calibrate.json import calibration_from_dict
from estimator.errors import InputError
from estimator.estimate.result import FORMAT as ESTIMATE
from estimator.estimate.result import VERSION as ESTIMATE_VERSION
from estimator.estimate.result import PayloadEstimate
from estimator.files import system_errors
from estimator.strict import Fields, is_number, read_json
from mocobot_report.campaign.words import FORMAT as CAMPAIGN
from mocobot_report.sought import SOUGHT, check_folder
from mocobot_sim.paper.tables import paper_tables, summary_table
from mocobot_view.payload import read_estimate

PROVENANCE = "mocobot-provenance"
TRIAL_KEYS = ("rotation_deg", "torque_Nm", "rod_error_m", "weld_error_m", "weld_error_deg")
Json = dict[str, Any]


@dataclass(frozen=True)
class Paper:
    """What ``mocobot paper --out`` wrote.

    Attributes:
        scores: by preset, then payload.
        trials: summaries of the simulated trials; empty where there are none.
        estimates: by (payload, preset), those that are there.
        provenance: of the run, or None.
    """

    scores: Mapping[str, Mapping[str, Any]]
    trials: tuple[Json, ...]
    estimates: Mapping[tuple[str, str], PayloadEstimate]
    provenance: Json | None


@dataclass(frozen=True)
class Estimated:
    """One file of ``mocobot estimate --out``."""

    path: Path
    estimate: PayloadEstimate
    provenance: Json | None


@dataclass(frozen=True)
class Calibrated:
    """What ``mocobot calibrate --out`` wrote."""

    path: Path
    calibration: Calibration
    provenance: Json | None


@dataclass(frozen=True)
class Diagnosed:
    """What ``mocobot diagnose --out`` wrote.

    Attributes:
        folder: where.
        values: the diagnosis as ``discrepancy.result.json`` documents it.
        traces: residuals of every trial; empty where the folder has none.
        channels: of the residuals.
    """

    folder: Path
    values: Json
    traces: tuple[Trace, ...]
    channels: tuple[Channel, ...]

    @property
    def provenance(self) -> Json | None:
        """Of the run, or None."""
        return self.values.get("provenance")


@dataclass(frozen=True)
class Campaign:
    """What ``mocobot campaign --out`` wrote: its summary (``mocobot_report.campaign.words``)."""

    path: Path
    values: Json
    provenance: Json | None


@dataclass(frozen=True)
class Contents:
    """Everything found in a folder, and the files that it was read from."""

    folder: Path
    paper: Paper | None
    estimates: tuple[Estimated, ...]
    diagnosis: Diagnosed | None
    calibrations: tuple[Calibrated, ...]
    campaign: Campaign | None
    files: tuple[Path, ...]


def read_folder(folder: Path) -> Contents:
    """Read all results that a folder holds.

    Raises:
        InputError: there is no such folder, it holds no result, or one of them cannot be read.
    """
    check_folder(folder)
    with system_errors(folder, "read"):
        jsons = sorted(path for path in folder.glob("*.json") if path.is_file())
    paper = diagnosis = campaign = None
    estimates, calibrations, files = [], [], []
    for path in jsons:
        if path.name == "paper.json":
            paper = _paper(folder)
            files.append(path)
        elif path.name not in ("trials.json", "provenance.json") and not path.name.endswith(".truth.json"):
            values = read_json(path, "a result of mocobot")
            if path.name == "diagnosis.json" or values.get("format") == DIAGNOSIS:
                diagnosis = _diagnosis(path, values, diagnosis)
                files.append(path)
            elif values.get("format") == ESTIMATE:
                estimates.append(_estimate(path, values))
                files.append(path)
            elif values.get("format") == CAMPAIGN:
                campaign = Campaign(path, values, _provenance(folder / "provenance.json"))
                files += [path, *(p for p in [folder / "provenance.json"] if p.is_file())]
            elif values.get("format") == CALIBRATION:
                made = values.get("provenance")
                found = calibration_from_dict(values, str(path))
                calibrations.append(Calibrated(path, found, made if isinstance(made, dict) else None))
                files.append(path)
    if not (paper or diagnosis or campaign or estimates or calibrations):
        raise InputError(f"{folder}: holds no result of mocobot; a report is made of {SOUGHT}")
    if paper is not None:
        files += [p for p in (folder / "trials.json", folder / "provenance.json") if p.is_file()]
        files += [folder / "estimates" / f"{p}_{preset}.json" for p, preset in paper.estimates]
    if diagnosis is not None and diagnosis.traces:
        files.append(folder / RESIDUALS)
    return Contents(folder, paper, tuple(estimates), diagnosis, tuple(calibrations), campaign, tuple(files))


def _paper(folder: Path) -> Paper:
    path = folder / "paper.json"
    scores = read_json(path, "the scores of the paper's experiment")
    with complete(path, "not the scores of the paper's experiment"):
        tables = [*paper_tables(scores), summary_table(scores)]
        cells = [cell for table in tables for row in table.rows for cell in row.cells]
        if not cells or not all(_number(x) for cell in cells for x in (cell.value, cell.spread)):
            raise ValueError("it must hold errors, numbers of at least 0 or null")
    found = {
        (payload, preset): read_estimate(file)
        for preset, by_payload in scores.items()
        for payload in by_payload
        if (file := folder / "estimates" / f"{payload}_{preset}.json").is_file()
    }
    return Paper(scores, _trials(folder / "trials.json"), found, _provenance(folder / "provenance.json"))


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


def _provenance(path: Path) -> Json | None:
    if not path.is_file():
        return None
    values = read_json(path, "the provenance of a result")
    return values if values.get("format") == PROVENANCE else None


def _estimate(path: Path, values: Json) -> Estimated:
    if values.get("version") != ESTIMATE_VERSION:
        raise InputError(
            f"{path}: is an estimate of version {values.get('version')!r:.40}; this mocobot reads version "
            f"{ESTIMATE_VERSION}"
        )
    found = values.get("provenance")
    return Estimated(path, read_estimate(path), found if isinstance(found, dict) else None)


def _diagnosis(path: Path, values: Json, other: Diagnosed | None) -> Diagnosed:
    if other is not None:
        raise InputError(f"{path}: is a second diagnosis in one folder; a report takes one")
    parse_diagnosis(values, path)
    with complete(path, "not a complete diagnosis"):
        # The text touches most keys that a report has to show.
        values = as_now(values)
        format_verdict(values, verbose=True)
    file = path.parent / RESIDUALS
    traces, channels = load_traces(file) if file.is_file() else ([], [])
    if traces and [trace.name for trace in traces] != list(values["recordings"]):
        raise InputError(f"{file}: is of other trials than {path.name}; diagnose again")
    return Diagnosed(path.parent, values, tuple(traces), tuple(channels))


@contextmanager
def complete(path: Path, otherwise: str = "not complete") -> Iterator[None]:
    """A block that reads a file's values; where one is missing or of another kind, the file is what is wrong.

    Raises:
        InputError: a key is missing, or a value is not what it must be.
    """
    try:
        yield
    except (
        KeyError,
        TypeError,
        ValueError,
        AttributeError,
        IndexError,
        OverflowError,
        StopIteration,
    ) as error:
        text = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) and error.args else str(error)
        words = " ".join(text.split())[:120] or type(error).__name__
        raise InputError(f"{path}: {otherwise} ({words})") from error


def _number(value: Any) -> bool:
    """Whether a score is null or a finite number of at least 0."""
    return value is None or (is_number(value) and value >= 0)
