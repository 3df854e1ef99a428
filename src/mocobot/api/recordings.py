"""Read logs in every form that callers may pass: recordings in memory, their files, or logs of any format."""

import os
import shlex
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import fields
from pathlib import Path

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import ArmUnit
from estimator.calibrate.calibration import Calibration, calibrated, units_for
from estimator.calibrate.json import calibration_from_dict
from estimator.errors import InputError, RepeatedRowsError
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from estimator.strict import read_json
from mocobot.checks import CALIBRATION
from mocobot_logs.convert import Labels, convert
from mocobot_logs.convert_report import format_on_the_fly
from mocobot_logs.formats import FORMATS, is_recording, log_kind
from mocobot_logs.log import LogSource
from mocobot_logs.maps import read_map
from mocobot_logs.open_log import open_log
from mocobot_logs.resample import RATE_HZ

GivenCalibration = Calibration | Path | str
"""A calibration, the path of its file, or the folder that ``mocobot calibrate --out`` wrote."""
Given = Recording | Path | str
"""A recording, the path of its file, or the path of a log in any format that ``convert`` reads."""
Say = Callable[[str], object]
KINDS = {
    "bag": "a ROS 2 bag",
    "csv": "a table of text",
    "npz": "an NPZ archive",
    "mat": "a MATLAB file",
    "lerobot": "of a LeRobot dataset",
    "parquet": "a Parquet file",
}
"""Words for the formats that ``log_kind`` returns."""


def quiet(*_: object) -> None:
    """Ignore reports of progress."""


class Robots:
    """Robot parameters from a calibration or, without one, from each recording.

    Attributes:
        calibration: calibration of the robots, or None.
    """

    def __init__(self, given: GivenCalibration | None) -> None:
        """Read the calibration, if one is given."""
        self.calibration: Calibration | None = None
        self.called = "the calibration"
        if isinstance(given, Calibration):
            self.calibration = given
        elif given is not None:
            self.calibration, self.called = calibration_of(given), str(given)

    def of(self, recording: Recording) -> Recording:
        """Return the recording with the calibrated robot parameters."""
        return recording if self.calibration is None else calibrated(recording, self.calibration, self.called)

    def units(self, source: LogSource, design: OmnidDesign) -> ArmUnit | None:
        """Return the calibrated robots for a log, or None without a calibration.

        Args:
            source: the log.
            design: design of the robots, used if the log states none.
        """
        if self.calibration is None:
            return None
        known = design if source.metadata is None else source.metadata.design
        return units_for(self.calibration, source.robots, known, source.name, self.called)


def calibration_of(path: Path | str) -> Calibration:
    """Read a calibration from its file, or from the folder that ``mocobot calibrate --out`` wrote."""
    path = Path(path)
    file = path / CALIBRATION if path.is_dir() else path
    return calibration_from_dict(read_json(file, "a calibration"), str(file))


def recordings_of(
    given: Given | Iterable[Given],
    map: Path | str | None = None,
    robots: Robots | None = None,
    *,
    episode: int | None = None,
    say: Say = quiet,
    note: Say = quiet,
) -> Iterator[Recording]:
    """Yield recordings one by one, each read only when needed and without the truth of a simulation.

    Args:
        given: recordings, files of recordings, or logs, which are converted in memory.
        map: map of the logs, by file or built-in name; default: detected from the log.
        robots: robot parameters; None for those of each recording.
        episode: episode of a LeRobot dataset that holds several.
        say: called with the name of each stage that begins.
        note: called with a text on how each log was read.

    Raises:
        InputError: a file cannot be read or is not a plausible recording, no log needs the map, or the calibration
            belongs to other robots.
    """
    robots, needed = robots or Robots(None), False
    log_map = None if map is None else read_map(map)
    for each in [given] if isinstance(given, Recording | Path | str) else given:
        recording = each
        if not isinstance(recording, Recording):
            path = Path(recording)
            say(f"reading {path.name}")
            recording = None
            is_log = _is_log(path)
            with suppress(RepeatedRowsError):
                recording = None if is_log else read(path)
            if recording is None:
                from mocobot_sim.scene.models import omnid_design  # imports MuJoCo

                needed = True
                source = open_log(path, log_map if is_log else None, episode)
                rate_hz = RATE_HZ if is_log or source.metadata is None else source.metadata.rate_hz
                trial = log_map.trial if is_log and log_map is not None else None
                done = convert(source, Labels(trial=trial), omnid_design(), rate_hz=rate_hz)
                note(format_on_the_fly(done, str(path)))
                recording = done.recording
        plain = {field.name: getattr(recording, field.name) for field in fields(Recording)}
        yield robots.of(Recording(**plain))
    if log_map is not None and not needed:
        raise InputError(f"map {map}: all files are recordings, which need none; leave the map out")


def _is_log(path: Path) -> bool:
    """Whether a file or folder is a log in a known format and not a recording."""
    try:
        return log_kind(path) != "parquet" or not is_recording(path)
    except InputError:
        return False


def read(path: Path) -> Recording:
    """Read a recording; the error for any other file suggests what to do with it.

    Raises:
        InputError: the file cannot be read or is not a recording.
    """
    try:
        return read_recording(path)
    except InputError:
        if path.is_file() and path.suffix == ".json":
            raise InputError(
                f"{path}: is a JSON file, not a recording of mocobot; recordings are .parquet files"
            ) from None
        if path.is_file() or path.is_dir():
            check_no_log(path)
        raise


def check_no_log(path: Path) -> None:
    """Raise an InputError that explains how to convert a file or folder that is not a recording.

    Recordings, damaged recordings and folders that are no log pass without an error.
    """
    try:
        kind = log_kind(path)
        if kind == "parquet" and is_recording(path):
            return
    except InputError:
        if path.is_dir() or path.suffix in (".parquet", ".json"):
            return  # no log, or a damaged recording
        raise InputError(
            f"{path}: is not a recording of mocobot, and mocobot convert does not read its format; make it {FORMATS}"
        ) from None
    name = Path(os.path.realpath(path)).name or "log"  # "." and "/" have no name
    target = path.parent / f"{name if path.is_dir() else path.stem}.parquet"
    if target == path:
        target = path.parent / f"{path.stem}_recording.parquet"
    raise InputError(
        f"{path}: is {KINDS[kind]}, not a recording of mocobot; use "
        f"mocobot convert {shlex.quote(str(path))} {shlex.quote(str(target))}"
    )
