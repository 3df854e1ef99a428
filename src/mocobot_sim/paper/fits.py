"""Beside the staged method: one least squares per payload, of closed loops and balance of wrenches of three trials.

Robots that are as designed are held so. Robots that are not calibrate themselves on the same recordings, or are held as
another payload's recordings have calibrated them.
"""

from collections.abc import Sequence

from estimator.calibrate.calibrate import calibrate, start_estimate
from estimator.calibrate.calibration import Calibration, Prior
from estimator.estimate.payload import estimate_from_trials, trial_of, within_arithmetic
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_sim.trial.sensors import sensor_preset

ONE_FIT = "nominal, one fit"
SELF_CALIBRATED = "uncalibrated, self-calibrated"
TRANSFER = "uncalibrated, transfer"
COLUMNS = {"nominal": (ONE_FIT,), "uncalibrated": (SELF_CALIBRATED, TRANSFER)}
"""What stands beside the column of a preset."""
NO_SPREAD = Prior().scaled(0.0)
"""Robots exactly as designed."""


def three_trials(recordings: Sequence[Recording]) -> list[Recording]:
    """The first recording of every kind of trial: a random, a static and a periodic one.

    More of them would cost minutes, and noise is no longer what limits a fit of three.
    """
    first: dict[str, Recording] = {}
    for recording in recordings:
        first.setdefault(recording.metadata.trial, recording)
    return list(first.values())


def estimate_both(
    recordings: Sequence[Recording], fitted: bool
) -> tuple[PayloadEstimate, PayloadEstimate | None]:
    """The staged estimate from one payload's recordings, and what a fit of three of them starts from, or None.

    Recordings are processed once for both.

    Args:
        recordings: of the payload, read through one preset.
        fitted: whether there will be a fit.

    Raises:
        InputError: nothing can be estimated from them.
    """
    with within_arithmetic([recording.name for recording in recordings]):
        trials = [trial_of(recording) for recording in recordings]
        first = [recordings.index(one) for one in three_trials(recordings)]
        start = start_estimate([trials[k] for k in first]) if fitted else None
        return estimate_from_trials(trials, "staged"), start


def fit_trials(
    recordings: Sequence[Recording],
    preset: str,
    robots: Calibration | None = None,
    start: PayloadEstimate | None = None,
) -> Calibration:
    """Fit what one payload's recordings, read through one preset, say of it.

    Args:
        recordings: of the payload.
        preset: of their sensors; robots of a calibrated one are held as designed, others calibrate themselves.
        robots: how they came out with another payload, to be held so.
        start: what ``start_estimate`` makes of them; None to make it here.

    Raises:
        InputError: the recordings do not determine it.
    """
    as_designed = robots is None and sensor_preset(preset).calibrated
    starts = None if start is None else {recordings[0].metadata.payload: start}
    return calibrate(recordings, prior=NO_SPREAD if as_designed else None, robots=robots, starts=starts)
