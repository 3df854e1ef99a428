"""Watch recordings: the scene moving from the measured angles, estimate against truth, all signals (Rerun)."""

import os
from collections.abc import Iterable
from pathlib import Path

from discrepancy.result.read import read_diagnosis
from estimator.errors import InputError
from estimator.estimate.frames import seen_by_encoders
from estimator.estimate.result import PayloadEstimate
from estimator.files import check_target
from mocobot.api.given import Given, GivenCalibration, Robots, recordings_of
from mocobot_sim.scene.as_built import theta_x_zeros
from mocobot_sim.trial.truth import GroundTruth
from mocobot_view.payload import BodyFacts, Grasps
from mocobot_view.replay_trial import distinct_names, replay_trial

INSTALL = "pip install 'mocobot[replay]'"
SUFFIX = ".rrd"


def replay(
    recordings: Given | Iterable[Given],
    path: Path | str,
    *,
    estimate: PayloadEstimate | None = None,
    truth: GroundTruth | None = None,
    diagnosis: Path | str | None = None,
    payload: Path | str | None = None,
    calibration: GivenCalibration | None = None,
) -> list[str]:
    """Write a replay for the Rerun viewer: ``rerun NAME.rrd`` opens it.

    Args:
        recordings: one or several, shown side by side, or paths of their files.
        path: .rrd file to write.
        estimate: of the payload; made from each recording if not given.
        truth: of the payload, to be shown beside the estimate.
        diagnosis: folder of a diagnosis, whose causes are marked.
        payload: name or MJCF of the payload's geometry; what the recording's label names if not given.
        calibration: the robots as they are, or its file; None for what the recordings or the estimate say of them.

    Returns:
        What a viewer should know, sentences.

    Raises:
        InputError: the Rerun SDK is missing, a recording, estimate or diagnosis does not fit, or the file cannot be
            written.
    """
    target = Path(path)
    check_target(target, SUFFIX)
    check_rerun()
    from mocobot_view.stream import check_enabled, save_replay

    check_enabled()
    found = read_diagnosis(Path(diagnosis)) if diagnosis is not None else None
    each = list(recordings_of(recordings, robots=Robots(calibration)))
    names = distinct_names([Path(recording.name) for recording in each])
    facts = None if truth is None else facts_of_truth(truth, estimate)
    trials = [
        replay_trial(recording, name, estimate, facts, found, payload)
        for recording, name in zip(each, names, strict=True)
    ]
    save_replay(trials, target)
    return [f"{trial.name}: {note}" for trial in trials for note in trial.notes]


def facts_of_truth(truth: GroundTruth, estimate: PayloadEstimate | None) -> BodyFacts:
    """The drawable part of a truth, in the frames of an estimate, if there is one."""
    parts = [truth.R_1i, truth.p_1i, truth.p_1c, truth.R_1c]
    if estimate is not None and estimate.zero_sd_rad:
        parts = seen_by_encoders(theta_x_zeros(truth.units, len(truth.p_1i)), *parts)
    R, p, p_1c, R_1c = parts
    return BodyFacts(Grasps(R, p), truth.mass_kg, p_1c, R_1c, truth.principal_kgm2)


def check_rerun() -> None:
    """Refuse in one sentence if Rerun is missing, or is not the version that this code speaks to.

    Raises:
        InputError: it is.
    """
    os.environ.setdefault(
        "RUST_LOG", "off"
    )  # or the SDK repeats in its own words what we say in one sentence
    try:
        import rerun
        from rerun.chunk import RrdReader  # noqa: F401
    except ImportError as error:
        found = "is not installed" if error.name == "rerun" else "is not of the right version"
        raise InputError(f"replay needs the Rerun SDK, which {found}; get it with: {INSTALL}") from error
    version = str(getattr(rerun, "__version__", "unknown"))
    if not version.startswith("0.41."):
        raise InputError(f"replay needs the Rerun SDK 0.41; this is {version}; get it with: {INSTALL}")
    rerun.set_strict_mode(True)  # what Rerun cannot log is an error, not a warning among others
