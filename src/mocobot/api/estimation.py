"""Estimate a payload from recordings."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimator.calibrate.calibrate import calibrate
from estimator.estimate import fit as one_fit
from estimator.estimate.fit import estimate_calibrated, estimate_on, one_payload
from estimator.estimate.result import PayloadEstimate, format_estimate
from estimator.files import write_json
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from mocobot.api.recordings import Given, Robots, Say, quiet, recordings_of
from mocobot.option_types import made
from mocobot.options import EstimateOptions
from mocobot.results import public


@dataclass(frozen=True, repr=False)
class Estimate(PayloadEstimate):
    """Grasps, mass, centre of mass and inertia of one payload; prints as text, shows as a table in a notebook.

    The attributes are those of ``estimator.estimate.result.PayloadEstimate``; None marks quantities that the data do
    not determine.
    """

    def __str__(self) -> str:
        """Return the text report."""
        return format_estimate(self)

    def __repr__(self) -> str:
        """Return a one-line summary."""
        mass = "mass not determined" if self.mass is None else f"{self.mass.mass:.4g} kg"
        return f"<Estimate from {len(self.recordings)} recordings: {mass}, {self.method}>"

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import estimate_html

        return estimate_html(self)

    def write(self, path: Path | str) -> None:
        """Write the estimate as JSON, for ``read_estimate``.

        Raises:
            InputError: the file cannot be written.
        """
        write_json(Path(path), self.to_dict())


def estimate(
    logs: Given | Iterable[Given],
    options: EstimateOptions | None = None,
    *,
    say: Say = quiet,
    note: Say = quiet,
    **fields: Any,
) -> Estimate:
    """Estimate grasps, mass, centre of mass and inertia from recordings of one payload.

    ``why_not_fit`` of the estimate states why the method ``"auto"`` did not use the single fit. A calibration fixes
    the parameters of the robots.

    Args:
        logs: one or several recordings, or paths of recordings or of logs that ``convert`` reads without further
            options.
        options: options of the estimate; ``fields`` replace its fields.
        say: called with the name of each stage that begins.
        note: called with a text on how each log was read.

    Raises:
        InputError: a recording cannot be used, recordings contradict each other, nothing can be estimated, or the
            calibration belongs to other robots.
    """
    chosen = made(EstimateOptions, options, fields)
    robots = Robots(chosen.calibration)
    given = recordings_of(logs, chosen.map, robots, episode=chosen.episode, say=say, note=note)
    if chosen.self_calibrate:
        found = _self_calibrated(list(given), chosen.cutoff_hz, say)
    elif robots.calibration is None:
        found = one_fit.estimate(given, chosen.method, chosen.cutoff_hz, say)
    else:
        found = estimate_on(robots.calibration, list(given), chosen.method, chosen.cutoff_hz, say)
    return public(Estimate, found)


def _self_calibrated(recordings: Sequence[Recording], cutoff_hz: float, say: Say) -> PayloadEstimate:
    carried = [recording for recording in recordings if recording.metadata.trial != FREE]
    free = [recording for recording in recordings if recording.metadata.trial == FREE]
    one_payload(carried)
    return estimate_calibrated(calibrate(carried, free, say=say), carried, cutoff_hz, say)


def read_estimate(path: Path | str) -> Estimate:
    """Read an estimate that ``Estimate.write`` or ``mocobot estimate --out`` wrote.

    Raises:
        InputError: the file cannot be read or is not a complete estimate.
    """
    from mocobot_view.payload import read_estimate as read  # imports MuJoCo

    return public(Estimate, read(Path(path)))
