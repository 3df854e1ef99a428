"""``mocobot watch``: logs to a first verdict: inspect, convert, estimate, calibrate if need be, diagnose, report."""

import tempfile
import textwrap
import webbrowser
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from estimator.arm.unit import AT, frames_said
from estimator.calibrate.text import SHOWN, shown_groups
from estimator.errors import InputError
from estimator.files import whole_folder, write_json, write_text
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.recording.parquet import write_recording
from estimator.statistics import measured
from mocobot.api.calibration import Calibration, calibrate
from mocobot.api.conversion import convert, convert_parts
from mocobot.api.diagnosis import Diagnosis, diagnose
from mocobot.api.estimation import Estimate, estimate
from mocobot.api.inspection import inspect
from mocobot.checks import PAGE, VERDICT
from mocobot.files.calibrations import NAME as CALIBRATION
from mocobot.files.calibrations import write_calibration
from mocobot.files.calibrations import write_into as write_calibration_into
from mocobot.files.provenance import provenance
from mocobot.files.recordings import read
from mocobot.files.targets import map_file
from mocobot.options import Watch
from mocobot.progress import stages
from mocobot.strict import NotGood
from mocobot_logs.formats import is_recording, log_kind
from mocobot_report.page import write_report

WIDTH = 110
BEYOND, MOST = 3.0, 3
"""Standard deviations of the prior from which on a robot is said to be off, and how many places are named. Chosen: of
the some sixty deviations of a healthy team of three, one is that far off in every sixth team."""
Say = Callable[[str], object]


@dataclass
class _Seen:
    """What was found so far.

    Attributes:
        lines: the overall verdict.
        recordings: those that can be used, by the name of their file.
        converted: names of those that were logs, or whose clocks were corrected.
        estimate, calibration, diagnosis: None where there is none, and ``lines`` say why.
    """

    lines: list[str] = field(default_factory=list)
    recordings: dict[str, Recording] = field(default_factory=dict)
    converted: list[str] = field(default_factory=list)
    estimate: Estimate | None = None
    calibration: Calibration | None = None
    diagnosis: Diagnosis | None = None

    def of(self, *, free: bool) -> list[Recording]:
        """Recordings of robots that hold nothing, or of all others."""
        return [one for one in self.recordings.values() if (one.metadata.trial == FREE) is free]

    @property
    def good(self) -> bool:
        """Whether the recordings can be believed, and what they show is understood."""
        verdict = self.diagnosis and self.diagnosis.verdict
        return self.estimate is not None and verdict in ("consistent", "explained")


def run(options: Watch) -> None:
    """Run the command.

    Raises:
        InputError: a log that cannot be read, or an output that cannot be written.
        NotGood: with ``strict``, there is no estimate, or the verdict is neither consistent nor explained.
    """
    seen, out = _Seen(), options.out
    inputs = [*options.rec, *map_file(options.map)]
    made_with = provenance("watch", asdict(options), inputs)
    if out is None and options.open:
        out = Path(tempfile.mkdtemp(prefix="mocobot-watch-")) / "watch"
    with stages() as (say, simulated):
        _read(seen, options, say)
        _conclude(seen, options.jobs, say, simulated)
        if out is not None:
            say("write")
            with whole_folder(out, "watch") as folder:
                _write(seen, folder, made_with)
            if seen.estimate or seen.diagnosis:
                write_report(out, out / PAGE, say)
                seen.lines.append(f"The page with all of it: {out / PAGE}.")
    print(
        "\n".join(part for line in seen.lines for part in textwrap.wrap(line, WIDTH, subsequent_indent="  "))
    )
    if options.open and out is not None and (out / PAGE).is_file():
        webbrowser.open((out / PAGE).resolve().as_uri())
    if options.strict and not seen.good:
        raise NotGood(seen.lines[-1].rstrip("."))


def _read(seen: _Seen, options: Watch, say: Say) -> None:
    """Inspect every file, and read what is of use."""
    for path in options.rec:
        say(f"inspecting {path.name}")
        found = inspect(path, map=options.map)
        ready = found.ready_for
        if ready.startswith("ready for: nothing"):
            why = "; ".join(finding.sentence for finding in found.findings)
            seen.lines.append(f"{path}: left out, {ready}{f': {why}' if why else ''}.")
            continue
        is_log = log_kind(path) != "parquet" or not is_recording(path)
        if is_log or found.skewed:
            say(f"converting {path.name}")
        try:
            recordings, done = _used(
                path, options.map if is_log else None, is_log=is_log, skewed=found.skewed
            )
        except InputError as error:
            seen.lines.append(f"{path}: left out, it cannot be used as it is: {error}.")
            continue
        seen.recordings |= recordings
        if done:
            seen.converted += recordings
            ready = f"{ready.partition(';')[0]} ({done})"  # what is to be done first was
        seen.lines.append(f"{path}: {ready}.")


def _used(path: Path, log_map: str | None, *, is_log: bool, skewed: bool) -> tuple[dict[str, Recording], str]:
    """What can be used of a file, by names, and what was done for it, empty if nothing.

    Raises:
        InputError: it cannot be converted, not even the parts of it between gaps.
    """
    clock, corrected = ("correct", ", clocks corrected") if skewed else ("keep", "")
    try:
        if not is_log and not skewed:
            return {path.stem: read(path)}, ""
        recording = convert(path, map=log_map, clock=clock).recording
        return {path.stem: recording}, f"converted{corrected}"
    except InputError as error:
        try:
            parts = convert_parts(path, map=log_map, clock=clock)
        except InputError:
            raise error from None
        many = "the part of it" if len(parts) == 1 else f"the {len(parts)} parts of it"
        named = {f"{path.stem}.part{k}": part.recording for k, part in enumerate(parts, 1)}
        return named, f"{many} between gaps converted{corrected}"


def _conclude(seen: _Seen, jobs: int, say: Say, simulated: Callable[[int], object]) -> None:
    """Estimate, calibrate if the robots contradict each other, and diagnose, as far as the recordings allow."""
    carried = seen.of(free=False)
    if not carried:
        seen.lines.append("Nothing can be estimated: there is no recording of robots that carry something.")
        return
    try:
        seen.estimate = estimate(carried, say=say)
        if seen.estimate.contradicts:
            say("calibrating")
            seen.calibration = calibrate(carried, free=seen.of(free=True), say=say)
            seen.estimate = estimate(carried, calibration=seen.calibration, say=say)
    except InputError as error:
        seen.lines.append(f"No estimate: {error}.")
    if seen.estimate is not None:
        seen.lines += [_payload(seen.estimate), _robots(seen.calibration), *seen.estimate.flags]
    try:
        seen.diagnosis = diagnose(
            carried, calibration=seen.calibration, jobs=jobs, say=say, simulated=simulated
        )
    except InputError as error:
        seen.lines.append(f"No diagnosis: {error}.")
        return
    named = [cause.sentence for cause in seen.diagnosis.causes]
    verdict = seen.diagnosis.verdict.replace("_", " ").upper()
    rest = seen.diagnosis.to_dict()["remains"]
    seen.lines.append(" ".join([f"Against the simulation: {verdict}.", *named, *rest]))


def _payload(found: Estimate) -> str:
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
    """The robots' clearest deviations, a sentence, if any is beyond what was assumed of healthy ones."""
    far = []
    for group in shown_groups(found):
        shown, at = SHOWN[group.name], AT[group.name]
        for robot, (x, se, prior) in enumerate(
            zip(found.units.x[:, at], found.sd[:, at], found.prior_sd[:, at], strict=True), start=1
        ):
            for k in range(len(x)):
                if prior[k] > 0 and abs(x[k]) > BEYOND * prior[k]:
                    value = "{} +- {}".format(*measured(shown.scale * x[k], shown.scale * se[k]))
                    place = f"robot {robot}, {shown.name} {group.entries[k]}: {value} {shown.unit}"
                    far.append((abs(x[k]) / prior[k], place))
    places = [place for _, place in sorted(far, reverse=True)[:MOST]]
    return [f"Farther off than robots are: {'; '.join(places)}."] if places else []


def _write(seen: _Seen, folder: Path, made_with: dict[str, Any]) -> None:
    """Everything into an existing folder: the diagnosis and the JSON of the others at its top, for the page."""
    if seen.diagnosis is not None:
        seen.diagnosis.write_into(folder, provenance=made_with)
    if seen.estimate is not None:
        write_json(folder / "estimate.json", seen.estimate.to_dict() | {"provenance": made_with})
    if seen.calibration is not None:
        write_calibration(folder / CALIBRATION, seen.calibration, made_with)
        (folder / "calibration").mkdir()
        write_calibration_into(folder / "calibration", seen.calibration, made_with)
    for name in seen.converted:
        write_recording(seen.recordings[name], folder / "recordings" / f"{name}.parquet")
    write_text(folder / VERDICT, "\n".join(seen.lines) + "\n")
