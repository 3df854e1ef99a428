"""Turn logs into a first verdict: inspect, convert, estimate, calibrate if needed, diagnose, and make a page."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimator.arm.unit import AT, frames_said
from estimator.calibrate.text import SHOWN, shown_groups
from estimator.errors import InputError
from estimator.files import write_json, write_text
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from estimator.statistics import measured
from mocobot.api.calibration import Calibration, calibrate
from mocobot.api.conversion import convert, convert_parts
from mocobot.api.diagnosis import Diagnosis, diagnose
from mocobot.api.estimation import Estimate, estimate_rigid
from mocobot.api.inspection import inspect
from mocobot.api.recordings import Say, quiet, read
from mocobot.api.watch_joints import logs_in, look_at_joints, verdict_line
from mocobot.checks import CALIBRATION
from mocobot.option_types import made
from mocobot.options import WatchOptions
from mocobot.results import Folder
from mocobot_logs.formats import is_recording, log_kind
from mocobot_report import NAME
from mocobot_report.page import write_report

if TYPE_CHECKING:
    from mocobot.api.joints import GivenModel

BEYOND, MOST = 3.0, 3
"""Threshold [prior standard deviations] above which the summary names a deviation, and largest number of names.
Chosen: among the about sixty deviations of a healthy team of three, one exceeds it in every sixth team."""
VERDICT = "verdict.txt"


@dataclass(repr=False)
class Watched(Folder):
    """Result of a first look at logs.

    Attributes:
        lines: overall verdict, one line per topic.
        recordings: usable recordings by the name of their file.
        converted: names of recordings that were converted from logs, or whose clocks were corrected.
        estimate, calibration, diagnosis: results of each stage, or None; ``lines`` state why a stage failed.
        of_joints: whether the logs are of a single robot's joints, of which only a diagnosis is made.
    """

    lines: list[str] = field(default_factory=list)
    recordings: dict[str, Recording] = field(default_factory=dict)
    converted: list[str] = field(default_factory=list)
    estimate: Estimate | None = None
    calibration: Calibration | None = None
    diagnosis: Diagnosis | None = None
    of_joints: bool = False
    result = "watch"

    def of(self, *, free: bool) -> list[Recording]:
        """List the recordings of free trials (robots hold nothing), or all others."""
        return [one for one in self.recordings.values() if (one.metadata.trial == FREE) is free]

    @property
    def good(self) -> bool:
        """Whether the verdict is ``"consistent"`` or ``"explained"``, and a team has an estimate."""
        verdict = self.diagnosis and self.diagnosis.verdict
        return (self.of_joints or self.estimate is not None) and verdict in ("consistent", "explained")

    def __str__(self) -> str:
        """Return the overall verdict."""
        return "\n".join(self.lines)

    def __repr__(self) -> str:
        """Return a one-line summary."""
        return f"<Watched of {len(self.recordings)} recordings: {'' if self.good else 'not '}good>"

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> None:
        """Write all results into an existing folder.

        The diagnosis and the JSON of the other results go to its top level, where the page looks for them.

        Args:
            folder: existing folder.
            pictures: whether to draw pictures.
            more: further keys of every JSON file.

        Raises:
            InputError: a file cannot be written.
        """
        if self.diagnosis is not None:
            self.diagnosis.write_into(folder, pictures=pictures, **more)
        if self.estimate is not None:
            write_json(folder / "estimate.json", self.estimate.to_dict() | more)
        if self.calibration is not None:
            write_json(folder / CALIBRATION, self.calibration.to_dict() | more)
            (folder / "calibration").mkdir()
            self.calibration.write_into(folder / "calibration", pictures=pictures, **more)
        for name in self.converted:
            write_recording(self.recordings[name], folder / "recordings" / f"{name}.parquet")
        write_text(folder / VERDICT, f"{self}\n")


def report(folder: Path | str, out: Path | str | None = None, *, say: Say = quiet) -> Path:
    """Make one HTML page from a result folder of ``paper``, ``estimate``, ``calibrate``, ``diagnose`` or ``campaign``.

    Args:
        folder: folder of the result.
        out: page to write; default: ``report.html`` in the folder.
        say: called with the name of each stage that begins.

    Returns:
        Path of the page.

    Raises:
        InputError: the folder holds no readable result, or the page cannot be written.
    """
    page = Path(folder) / NAME if out is None else Path(out)
    write_report(Path(folder), page, say)
    return page


def watch(
    logs: Path | str | Iterable[Path | str],
    options: WatchOptions | None = None,
    *,
    model: GivenModel | None = None,
    reference: Path | str | Iterable[Path | str] = (),
    say: Say = quiet,
    simulated: Callable[[int], object] | None = None,
    **fields: Any,
) -> Watched:
    """Analyse recordings or logs in one run: inspect, convert, estimate, calibrate if needed, and diagnose.

    Args:
        logs: files of recordings, or logs in any format that ``convert`` reads, all of one payload; with a model, logs
            of its joints or folders of them, which are inspected and diagnosed.
        options: options of the run; ``fields`` replace its fields.
        model: single robot whose joints were logged, or path of its file; None for a team.
        reference: with a model, logs of the same robot when it was healthy, as for ``diagnose``.
        say: called with the name of each stage that begins.
        simulated: called with 1 after every simulated trial.

    Raises:
        InputError: a log cannot be read, or a folder holds none.
    """
    chosen, seen = made(WatchOptions, options, fields), Watched(of_joints=model is not None)
    paths = [Path(path) for path in _each(logs)]
    if model is not None:
        healthy = [Path(path) for path in _each(reference)]
        found = logs_in(paths, healthy)
        seen.lines, seen.diagnosis = look_at_joints(found, model, healthy, chosen, say)
        return seen
    for path in paths:
        _look(seen, path, chosen, say)
    _conclude(seen, chosen.jobs, say, simulated)
    return seen


def _each(paths: Path | str | Iterable[Path | str]) -> Iterable[Path | str]:
    return [paths] if isinstance(paths, Path | str) else paths


def _look(seen: Watched, path: Path, chosen: WatchOptions, say: Say) -> None:
    """Inspect a file, and add its usable recordings to ``seen``."""
    say(f"inspecting {path.name}")
    found = inspect(path, map=chosen.map, episode=chosen.episode)
    ready = found.ready_for
    if ready.startswith("ready for: nothing"):
        why = "; ".join(finding.sentence for finding in found.findings)
        seen.lines.append(f"{path}: left out, {ready}{f': {why}' if why else ''}.")
        return
    is_log, skewed = log_kind(path) != "parquet" or not is_recording(path), getattr(found, "skewed", False)
    if is_log or skewed:
        say(f"converting {path.name}")
    try:
        how = {"map": chosen.map, "episode": chosen.episode} if is_log else {}
        recordings, done = _used(path, how, is_log=is_log, skewed=skewed)
    except InputError as error:
        seen.lines.append(f"{path}: left out, it cannot be used as it is: {error}.")
        return
    seen.recordings |= recordings
    if done:
        seen.converted += recordings
        ready = f"{ready.partition(';')[0]} ({done})"  # drop the required steps, which are now done
    seen.lines.append(f"{path}: {ready}.")


def _used(path: Path, how: dict[str, Any], *, is_log: bool, skewed: bool) -> tuple[dict[str, Recording], str]:
    """Read the usable recordings of a file; ``how`` are options of its conversion.

    Returns:
        Recordings by name, and the steps that were necessary as text, empty if none.
    """
    clock, corrected = ("correct", ", clocks corrected") if skewed else ("keep", "")
    try:
        if not is_log and not skewed:
            return {path.stem: read(path)}, ""
        recording = convert(path, clock=clock, **how).recording
        return {path.stem: recording}, f"converted{corrected}"
    except InputError as error:
        try:
            parts = convert_parts(path, clock=clock, **how)
        except InputError:
            raise error from None
        many = "the part of it" if len(parts) == 1 else f"the {len(parts)} parts of it"
        named = {f"{path.stem}.part{k}": part.recording for k, part in enumerate(parts, 1)}
        return named, f"{many} between gaps converted{corrected}"


def _conclude(seen: Watched, jobs: int, say: Say, simulated: Callable[[int], object] | None) -> None:
    """Estimate, calibrate if the robots contradict each other, and diagnose, as far as the recordings allow."""
    carried = seen.of(free=False)
    if not carried:
        seen.lines.append("Nothing can be estimated: there is no recording of robots that carry something.")
        return
    try:
        seen.estimate = estimate_rigid(carried, say=say)
        if seen.estimate.contradicts:
            say("calibrating")
            seen.calibration = calibrate(carried, None, seen.of(free=True), say=say)
            seen.estimate = estimate_rigid(carried, calibration=seen.calibration, say=say)
    except InputError as error:
        seen.lines.append(f"No estimate: {error}.")
    if seen.estimate is not None:
        seen.lines += [payload_line(seen.estimate), _robots(seen.calibration), *seen.estimate.flags]
    try:
        seen.diagnosis = diagnose(
            carried, calibration=seen.calibration, jobs=jobs, say=say, simulated=simulated
        )
    except InputError as error:
        seen.lines.append(f"No diagnosis: {error}.")
        return
    seen.lines.append(verdict_line(seen.diagnosis, "the simulation"))


def payload_line(found: Estimate) -> str:
    """State mass and centre of mass in one sentence."""
    mass, com = "mass not determined", "centre of mass not determined"
    if found.mass is not None:
        mass = "{} +- {} kg".format(*measured(found.mass.mass, found.mass.se))
    if found.p_1c is not None and found.p_1c_se_m is not None:
        each = (measured(float(x), float(se)) for x, se in zip(found.p_1c, found.p_1c_se_m, strict=True))
        com = f"centre of mass ({', '.join(f'{x} +- {se}' for x, se in each)}) m in {{1}}"
    frames = f", in {frames_said(found.zero_sd_rad)}" if found.zero_sd_rad else ""
    return f"Payload: {mass}, {com}{frames}."


def _robots(found: Calibration | None) -> str:
    if found is None:
        return "Robots: they agree with each other as designed."
    said = "Robots: as designed they contradict each other; they were calibrated on these recordings."
    return " ".join([said, *_farthest(found), *found.findings])


def _farthest(found: Calibration) -> list[str]:
    """Name the robots' largest deviations beyond ``BEYOND`` prior standard deviations, in at most one sentence."""
    far = []
    for group in shown_groups(found):
        shown, at = SHOWN[group.name], AT[group.name]
        rows = zip(found.units.x[:, at], found.sd[:, at], found.prior_sd[:, at], strict=True)
        for robot, (x, se, prior) in enumerate(rows, start=1):
            for k in range(len(x)):
                if prior[k] > 0 and abs(x[k]) > BEYOND * prior[k]:
                    value = "{} +- {}".format(*measured(shown.scale * x[k], shown.scale * se[k]))
                    place = f"robot {robot}, {shown.name} {group.entries[k]}: {value} {shown.unit}"
                    far.append((abs(x[k]) / prior[k], place))
    places = [place for _, place in sorted(far, reverse=True)[:MOST]]
    return [f"Farther off than robots are: {'; '.join(places)}."] if places else []
