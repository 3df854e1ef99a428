"""Estimate a payload from recordings."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from estimator.calibrate.calibrate import calibrate
from estimator.calibrate.calibration import calibrated
from estimator.errors import InputError
from estimator.estimate import fit as one_fit
from estimator.estimate.consistency import NOT_ONE_BODY
from estimator.estimate.fit import estimate_calibrated, estimate_on, one_payload
from estimator.estimate.result import PayloadEstimate, format_estimate
from estimator.files import write_json
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.strict import read_json
from estimator.two_bodies.estimate import Kind, estimate_two_bodies
from estimator.two_bodies.result import TwoBodies, format_two_bodies
from mocobot.api.recordings import Given, Robots, Say, quiet, recordings_of
from mocobot.option_types import made
from mocobot.options import EstimateOptions
from mocobot.results import public
from mocobot_sim.scene.models import truth_path


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


@dataclass(frozen=True, repr=False)
class TwoBodyEstimate(TwoBodies):
    """Two bodies on a hinge or slide: joint, masses, inertias; prints as text.

    The attributes are those of ``estimator.two_bodies.result.TwoBodies``.
    """

    def __str__(self) -> str:
        """Return the text report."""
        return format_two_bodies(self)

    def beside_truth(self, recording: Path) -> str:
        """Return the text report, with the truth of two bodies beside a simulated recording, if there is one."""
        path = truth_path(recording)
        truth = read_json(path, "the truth beside a simulated recording") if path.is_file() else {}
        return format_two_bodies(self, truth if truth.get("bodies") else None)

    def __repr__(self) -> str:
        """Return a one-line summary."""
        return f"<TwoBodyEstimate from {len(self.recordings)} recordings: {self.kind}, {self.whole[0].mass:.4g} kg>"

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
) -> Estimate | TwoBodyEstimate:
    """Estimate grasps, mass, centre of mass and inertia from recordings of one payload.

    The payload is one rigid body. If its option says so, or if ``"auto"`` finds that the robots do not hold one body
    and a joint explains their motion, it is two bodies on a hinge or slide. ``why_not_fit`` of a rigid estimate states
    why the method ``"auto"`` did not use the single fit. A calibration fixes the parameters of the robots.

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
    logs = logs if isinstance(logs, Recording | Path | str) else list(logs)
    if chosen.payload not in ("auto", "rigid"):
        return _two_bodies(logs, chosen, chosen.payload, "", say, note)
    try:
        found = public(Estimate, _rigid(logs, chosen, say, note))
    except InputError as error:
        if chosen.payload == "rigid" or NOT_ONE_BODY not in str(error):
            raise
        try:
            return _two_bodies(logs, chosen, "auto", f"Not one rigid body: {error}.", say, quiet)
        except InputError as joint:
            raise InputError(f"{error}; nor two bodies on a joint ({joint})") from error
    doubt = next((flag for flag in found.flags if NOT_ONE_BODY in flag), None)
    if chosen.payload == "auto" and doubt is not None and found.contradicts:
        with suppress(InputError):
            return _two_bodies(logs, chosen, "auto", doubt, say, quiet)
    return found


def estimate_rigid(logs: Iterable[Recording], *, say: Say = quiet, **fields: Any) -> Estimate:
    """Estimate one rigid body; arguments and errors as for ``estimate``."""
    return public(Estimate, _rigid(logs, made(EstimateOptions, None, fields), say, quiet))


def _rigid(logs: Given | Iterable[Given], chosen: EstimateOptions, say: Say, note: Say) -> PayloadEstimate:
    robots = Robots(chosen.calibration)
    given = recordings_of(logs, chosen.map, robots, episode=chosen.episode, say=say, note=note)
    if chosen.self_calibrate:
        return _self_calibrated(list(given), chosen.cutoff_hz, say)
    if robots.calibration is None:
        return one_fit.estimate(given, chosen.method, chosen.cutoff_hz, say)
    return estimate_on(robots.calibration, list(given), chosen.method, chosen.cutoff_hz, say)


def _two_bodies(
    logs: Given | Iterable[Given], chosen: EstimateOptions, kind: Kind, why: str, say: Say, note: Say
) -> TwoBodyEstimate:
    robots = Robots(chosen.calibration)
    given = list(recordings_of(logs, chosen.map, robots, episode=chosen.episode, say=say, note=note))
    if robots.calibration is not None:
        given = [calibrated(recording, robots.calibration) for recording in given]
    return public(TwoBodyEstimate, estimate_two_bodies(given, kind, say, why))


def _self_calibrated(recordings: Sequence[Recording], cutoff_hz: float, say: Say) -> PayloadEstimate:
    carried = [recording for recording in recordings if recording.metadata.trial != FREE]
    free = [recording for recording in recordings if recording.metadata.trial == FREE]
    one_payload(carried)
    return estimate_calibrated(calibrate(carried, free, say=say), carried, cutoff_hz, say)


def read_estimate(path: Path | str) -> Estimate | TwoBodyEstimate:
    """Read an estimate that its ``write`` or ``mocobot estimate --out`` wrote.

    Raises:
        InputError: the file cannot be read or is not a complete estimate.
    """
    from mocobot_view.payload import read_any_estimate  # imports MuJoCo

    found = read_any_estimate(Path(path))
    return public(TwoBodyEstimate, found) if isinstance(found, TwoBodies) else public(Estimate, found)
