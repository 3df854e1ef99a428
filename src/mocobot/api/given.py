"""Recordings as a caller may give them: in memory, as files, or as logs that are converted when their turn comes."""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import fields
from pathlib import Path

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import ArmUnit
from estimator.calibrate.calibration import Calibration, calibrated, units_for
from estimator.errors import InputError, RepeatedRowsError
from estimator.recording.model import Recording
from mocobot.files.calibrations import read_calibration
from mocobot.files.recordings import read
from mocobot_logs.convert import Converted, Labels, convert
from mocobot_logs.formats import is_recording, log_kind
from mocobot_logs.log import LogSource
from mocobot_logs.maps import read_map
from mocobot_logs.open_log import open_log
from mocobot_logs.resample import RATE_HZ

GivenCalibration = Calibration | Path | str
"""A calibration, or the path of its file, or of the folder that ``mocobot calibrate --out`` wrote."""
Given = Recording | Path | str
"""A recording, or the path of its file, or of a log of any format that ``convert`` reads."""


class Robots:
    """The robots as a calibration has them, or as every recording says itself.

    Attributes:
        calibration: theirs, or None.
    """

    def __init__(self, given: GivenCalibration | None) -> None:
        """Read the calibration, if there is one.

        Raises:
            InputError: it cannot be read.
        """
        self.calibration: Calibration | None = None
        self.called = "the calibration"
        if isinstance(given, Calibration):
            self.calibration = given
        elif given is not None:
            self.calibration, self.called = read_calibration(given), str(given)

    def of(self, recording: Recording) -> Recording:
        """A recording that knows them.

        Raises:
            InputError: the calibration is of another number of robots, or of another design.
        """
        return recording if self.calibration is None else calibrated(recording, self.calibration, self.called)

    def units(self, source: LogSource, design: OmnidDesign) -> ArmUnit | None:
        """The same for a log, of robots of a design where the log does not say; None without a calibration.

        Raises:
            InputError: as ``of``.
        """
        if self.calibration is None:
            return None
        known = design if source.metadata is None else source.metadata.design
        return units_for(self.calibration, source.robots, known, source.name, self.called)


def recordings_of(
    given: Given | Iterable[Given], map: Path | str | None = None, robots: Robots | None = None
) -> Iterator[Recording]:
    """One or several recordings, read when their turn comes; what a simulation adds to one is left behind.

    Args:
        given: recordings, files of recordings, or logs.
        map: map of the logs, by file or built-in name; found out if not given.
        robots: what they are; None for what every recording says itself.

    Raises:
        InputError: a file cannot be read, or is not a plausible recording, or no log needs the map, or the robots are
            others.
    """
    robots = robots or Robots(None)
    logs = Logs(map)
    for each in [given] if isinstance(given, Recording | Path | str) else given:
        recording = each if isinstance(each, Recording) else logs.read(Path(each))
        yield robots.of(
            Recording(**{field.name: getattr(recording, field.name) for field in fields(Recording)})
        )
    logs.check_map()


class Logs:
    """Reads recordings, and converts what is none in memory: nothing is written anywhere.

    Attributes:
        converted: by path, the logs that were.
    """

    def __init__(self, map: Path | str | None = None) -> None:
        """Read the map, if there is one.

        Raises:
            InputError: it cannot be read.
        """
        self.converted: dict[Path, Converted] = {}
        self._name = map
        self._map = None if map is None else read_map(map)

    def read(self, path: Path) -> Recording:
        """A recording, as it is or of a log; messages name the user's file.

        Raises:
            InputError: the file cannot be read, or is not a plausible recording.
        """
        is_log = _is_log(path)
        with suppress(RepeatedRowsError):
            if not is_log:
                return read(path)
        from mocobot_sim.scene.models import omnid_design  # needs MuJoCo; a recording does not

        log_map = self._map if is_log else None
        source, trial = open_log(path, log_map), None if log_map is None else log_map.trial
        rate_hz = RATE_HZ if is_log or source.metadata is None else source.metadata.rate_hz
        self.converted[path] = done = convert(source, Labels(trial=trial), omnid_design(), rate_hz=rate_hz)
        return done.recording

    def check_map(self) -> None:
        """Whether the map was of use, once all is read.

        Raises:
            InputError: it was given, and all files are recordings.
        """
        if self._map is not None and not self.converted:
            raise InputError(
                f"map {self._name}: all files are recordings, which need none; leave the map out"
            )


def _is_log(path: Path) -> bool:
    """Whether a file or folder is a log of a known format, and no recording."""
    try:
        return log_kind(path) != "parquet" or not is_recording(path)
    except InputError:
        return False
