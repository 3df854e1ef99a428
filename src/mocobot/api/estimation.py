"""Estimate a payload."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.outcome import one_fit
from estimator.calibrate.outcome.estimate import estimate_calibrated, estimate_on, one_payload
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.estimate.text import format_estimate
from estimator.files import write_json
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from mocobot.api.given import Given, GivenCalibration, Robots, recordings_of
from mocobot.api.public import public


@dataclass(frozen=True, repr=False)
class Estimate(PayloadEstimate):
    """Grasps, mass, centre of mass and inertia of one payload, printable, and a table in a notebook.

    The attributes are those of ``estimator.estimate.result.PayloadEstimate``; None marks what the data do not
    determine.
    """

    def __str__(self) -> str:
        """The text report."""
        return format_estimate(self)

    def __repr__(self) -> str:
        """One line."""
        mass = "mass not determined" if self.mass is None else f"{self.mass.mass:.4g} kg"
        return f"<Estimate from {len(self.recordings)} recordings: {mass}, {self.method}>"

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import estimate_html

        return estimate_html(self)

    def write(self, path: Path | str) -> None:
        """Write it as JSON, which ``read_estimate`` reads.

        Raises:
            InputError: the file cannot be written.
        """
        write_json(Path(path), self.to_dict())


def estimate(
    recordings: Given | Iterable[Given],
    *,
    map: Path | str | None = None,
    calibration: GivenCalibration | None = None,
    self_calibrate: bool = False,
    method: one_fit.Asked = "auto",
    cutoff_hz: float = 5.0,
    say: Callable[[str], object] = lambda _: None,
) -> Estimate:
    """Estimate grasps, mass, centre of mass and inertia from recordings of one payload.

    Args:
        recordings: one or several, or paths of their files, or of logs that ``convert`` reads as they are.
        map: map of those logs, by file or built-in name (docs/measured-data.md); found out if not given.
        calibration: the robots as they are, or its file; None for what the recordings say of them.
        self_calibrate: calibrate the robots on these recordings, free trials among them perhaps, and take what they
            carry from the same fit.
        method: ``"fit"``, one least squares of closed loops and balance of wrenches; ``"staged"``, the paper's
            sequence; ``"joint"``, its grasps and one least squares for the rest; ``"auto"``, the fit where the
            recordings determine the centre of mass and noise is all that it leaves, else staged where static holds
            determine it, else joint (``why_not_fit`` says why). With a calibration, its robots are held.
        cutoff_hz: cut-off of the low-pass filter [Hz].
        say: takes the name of the stage that begins.

    Raises:
        InputError: a recording cannot be used, they contradict each other, nothing can be estimated, or the
            calibration is of other robots.
    """
    if self_calibrate:
        for name, given in (("calibration", calibration is not None), ("method", method != "auto")):
            if given:
                raise InputError(f"{name} and self_calibrate are both given; choose one")
        return public(Estimate, _self_calibrated(list(recordings_of(recordings, map)), cutoff_hz, say))
    robots = Robots(calibration)
    given = recordings_of(recordings, map, robots)
    if robots.calibration is None:
        return public(Estimate, one_fit.estimate(given, method, cutoff_hz, say))
    return public(Estimate, estimate_on(robots.calibration, list(given), method, cutoff_hz, say))


def _self_calibrated(
    recordings: Sequence[Recording], cutoff_hz: float, say: Callable[[str], object]
) -> PayloadEstimate:
    carried = [recording for recording in recordings if recording.metadata.trial != FREE]
    free = [recording for recording in recordings if recording.metadata.trial == FREE]
    one_payload(carried)
    return estimate_calibrated(calibrate(carried, free, say=say), carried, cutoff_hz, say)


def read_estimate(path: Path | str) -> Estimate:
    """Read what ``Estimate.write`` or ``mocobot estimate --out`` wrote.

    Raises:
        InputError: the file cannot be read, or is not a whole estimate.
    """
    from mocobot_view.payload import read_estimate as read  # needs MuJoCo; an estimate does not

    return public(Estimate, read(Path(path)))
