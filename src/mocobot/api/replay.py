"""Replay recordings in Rerun: the scene in motion by the measured angles, estimate and truth, all signals."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discrepancy.result.read import read_diagnosis
from discrepancy.result.traces import NAME as RESIDUALS
from discrepancy.result.traces import Trace, load_traces
from estimator.arm.unit import seen_by_encoders
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.files import check_target
from estimator.recording.metadata import FREE
from estimator.recording.model import Recording
from estimator.two_bodies.result import TwoBodies
from mocobot.api.recordings import Given, Robots, Say, quiet, read
from mocobot.option_types import made
from mocobot.options import ReplayOptions
from mocobot_sim.scene.as_built import theta_x_zeros
from mocobot_sim.trial.truth import GroundTruth
from mocobot_view.payload import BodyFacts, Grasps, read_any_estimate, read_truth
from mocobot_view.replay_trial import ReplayTrial, distinct_names, replay_trial

if TYPE_CHECKING:
    from mocobot.api.joints import GivenModel
    from mocobot_view.joint_replay import JointReplay

INSTALL = "pip install 'mocobot[replay]'"
SUFFIX = ".rrd"


def replay(
    logs: Given | Iterable[Given],
    path: Path | str | None = None,
    model: GivenModel | None = None,
    options: ReplayOptions | None = None,
    *,
    note: Say = quiet,
    advance: Callable[[int], object] = quiet,
    **fields: Any,
) -> list[str]:
    """Write a replay for the Rerun viewer (``rerun NAME.rrd`` opens it), or show it.

    Args:
        logs: recordings or paths of their files, shown side by side; with a model, logs of its joints.
        path: .rrd file to write; None opens the viewer, or with the option ``web`` serves until interrupted.
        model: single robot whose joints were logged, or path of its file; None for a team.
        options: what to show; ``fields`` replace its fields. The truth may be a ``GroundTruth``.
        note: called with each note for the viewer, one sentence at a time.
        advance: called with 1 after every recording.

    Returns:
        All notes.

    Raises:
        InputError: the Rerun SDK is missing; a recording, estimate or diagnosis does not fit; there is no display; or
            the file cannot be written.
    """
    chosen = made(ReplayOptions, options, fields)
    chosen.check_for(path, model)
    if path is not None:
        check_target(Path(path), SUFFIX)
    check_rerun()
    from mocobot_view import stream as outputs

    outputs.check_enabled()
    if path is None and not chosen.web and not outputs.has_display():
        raise InputError(
            "there is no display to open the viewer on; write a file with --out replay.rrd, or serve it to a browser "
            "with --web"
        )
    each = [logs] if isinstance(logs, Recording | Path | str) else list(logs)
    names = distinct_names([Path(one.name if isinstance(one, Recording) else one) for one in each])
    trials: Sequence[ReplayTrial | JointReplay]
    if model is None:
        trials = team = _trials(each, names, chosen)
        content = partial(outputs.log_replay, trials=team, progress=advance)
    else:
        from mocobot_view.joint_replay import log_joint_replay

        trials = replays = _joint_replays(each, names, model, chosen)
        content = partial(log_joint_replay, replays=replays, progress=advance)
    notes = [f"{trial.name}: {text}" for trial in trials for text in trial.notes]
    for text in notes:
        note(text)
    if path is not None:
        outputs.save_content(content, Path(path))
    elif not chosen.web:
        outputs.show_content(content)
    else:
        stream, address = outputs.serve_content(content)
        note(f"Open {address} in a browser; Ctrl+C ends it.")
        try:
            while True:
                time.sleep(3600.0)
        except KeyboardInterrupt:
            stream.disconnect()
    return notes


def _trials(logs: list[Any], names: list[str], chosen: ReplayOptions) -> list[ReplayTrial]:
    given, payload, trials = chosen.estimate, chosen.payload, []
    made_already = isinstance(given, PayloadEstimate | TwoBodies | None)
    estimate = given if made_already else read_any_estimate(Path(given))
    diagnosis = read_diagnosis(Path(chosen.diagnosis)) if chosen.diagnosis is not None else None
    if isinstance(payload, str) and payload.endswith(".xml"):
        payload = Path(payload)
    robots = Robots(chosen.calibration)
    for log, name in zip(logs, names, strict=True):
        recording = robots.of(log if isinstance(log, Recording) else read(Path(log)))
        path, truth = Path(recording.name if isinstance(log, Recording) else log), None
        if isinstance(chosen.truth, GroundTruth):
            truth = facts_of_truth(chosen.truth, estimate)
        elif chosen.truth and recording.metadata.trial != FREE:
            truth = read_truth(path, recording.metadata.robots, estimate)
        trials.append(replay_trial(recording, name, estimate, truth, diagnosis, payload))
    return trials


def _joint_replays(
    logs: list[Any], names: list[str], model: GivenModel, chosen: ReplayOptions
) -> list[JointReplay]:
    from mocobot.api.joints import read_logs, read_model
    from mocobot_view.joint_replay import joint_replay

    robot, replays = read_model(model, lock=chosen.lock, base=chosen.base), []
    traces, columns = [], []
    if chosen.diagnosis is not None:
        traces, columns = _torques(Path(chosen.diagnosis), robot.joints)
    for log, name in zip(logs, names, strict=True):
        parts = read_logs(log, robot, map=chosen.map, episode=chosen.episode)
        stem = re.escape(Path(parts[0].name).stem)
        own = [trace for trace in traces if re.fullmatch(rf"{stem}( [\d.]+-[\d.]+ s)?", trace.name)]
        if chosen.diagnosis is not None and (not own or len(own) < len(parts)):
            known = ", ".join(dict.fromkeys(trace.name for trace in traces))
            raise InputError(
                f"{chosen.diagnosis}: is a diagnosis of {known}, not of {log}; leave --diagnosis out"
            )
        for number, part in enumerate(parts, 1):
            found = own if len(parts) == 1 else own[number - 1 : number]
            shown = f"{name}-part{number}" if len(parts) > 1 else name
            replays.append(joint_replay(robot, part, shown, found, columns))
    return replays


def _torques(path: Path, joints: tuple[str, ...]) -> tuple[list[Trace], list[int]]:
    """Read the residuals of a diagnosis with measured torques, and the joint of each of their channels, from 0."""
    folder = path.parent if path.suffix == ".json" else path
    if not read_diagnosis(path).of_joints:
        raise InputError(f"{path}: is a diagnosis of a team; with a model it must be of a robot of joints")
    traces, channels = load_traces(folder / RESIDUALS)
    names = [channel.name.removesuffix(" torque") for channel in channels]
    if not set(names) <= set(joints):
        raise InputError(
            f"{path}: is of a robot with the joints {', '.join(names)}; the model's are {', '.join(joints)}"
        )
    if any(trace.measured is None for trace in traces):
        raise InputError(f"{path}: is of an earlier version, without torques over time; diagnose again")
    return traces, [joints.index(name) for name in names]


def facts_of_truth(truth: GroundTruth, estimate: PayloadEstimate | TwoBodies | None) -> BodyFacts:
    """Extract the quantities of a truth that a replay draws, in the frames of the estimate if one is given."""
    parts = [truth.R_1i, truth.p_1i, truth.p_1c, truth.R_1c]
    if isinstance(estimate, PayloadEstimate) and estimate.zero_sd_rad:
        parts = seen_by_encoders(theta_x_zeros(truth.units, len(truth.p_1i)), *parts)
    R, p, p_1c, R_1c = parts
    return BodyFacts(Grasps(R, p), truth.mass_kg, p_1c, R_1c, truth.principal_kgm2)


def check_rerun() -> None:
    """Check that the Rerun SDK is installed in the supported version.

    Raises:
        InputError: the SDK is missing or has another version.
    """
    # The SDK would otherwise print its own messages about errors that this package reports.
    os.environ.setdefault("RUST_LOG", "off")
    try:
        import rerun
        from rerun.chunk import RrdReader  # noqa: F401
    except ImportError as error:
        found = "is not installed" if error.name == "rerun" else "is not of the right version"
        raise InputError(f"replay needs the Rerun SDK, which {found}; get it with: {INSTALL}") from error
    version = str(getattr(rerun, "__version__", "unknown"))
    if not version.startswith("0.41."):
        raise InputError(f"replay needs the Rerun SDK 0.41; this is {version}; get it with: {INSTALL}")
    rerun.set_strict_mode(True)  # turn warnings about data that Rerun cannot log into errors
