"""``mocobot replay``: recordings as moving scenes and time series, in the Rerun viewer, a browser or a file."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discrepancy.result.read import read_diagnosis
from estimator.errors import InputError
from estimator.recording.metadata import FREE
from mocobot.api.given import Robots
from mocobot.api.replay import check_rerun
from mocobot.files.recordings import read
from mocobot.options import Replay
from mocobot.progress import bar
from mocobot_view.payload import read_estimate, read_truth
from mocobot_view.replay_trial import ReplayTrial, distinct_names, replay_trial

if TYPE_CHECKING:
    from mocobot_view.joint_replay import JointReplay


def run(options: Replay) -> None:
    """Run the command.

    Raises:
        InputError: recordings or options that cannot be used, no Rerun, no display, or an output that cannot be
            written.
    """
    check_rerun()
    from mocobot_view.stream import (
        check_enabled,
        has_display,
        save_content,
        serve_content,
        show_content,
    )

    check_enabled()
    if options.save is None and not options.web and not has_display():
        raise InputError(
            "there is no display to open the viewer on; write a file with --save replay.rrd, or serve it to a browser "
            "with --web"
        )
    trials = _trials(options) if options.model is None else _joint_replays(options, options.model)
    for trial in trials:
        for note in trial.notes:
            print(f"{trial.name}: {note}")
    with bar(len(trials), "logging", "recording") as advance:
        content = partial(_log, trials, advance)
        if options.save is not None:
            save_content(content, options.save)
            print(f"{options.save}: {_size(options.save)}; open it with: rerun {options.save}")
            return
        if not options.web:
            show_content(content)
            return
        stream, address = serve_content(content)
    print(f"Open {address} in a browser; Ctrl+C ends it.", flush=True)
    try:
        while True:
            time.sleep(3600.0)
    except KeyboardInterrupt:
        stream.disconnect()


def _trials(options: Replay) -> list[ReplayTrial]:
    estimate = read_estimate(options.estimate) if options.estimate else None
    diagnosis = read_diagnosis(options.diagnosis) if options.diagnosis else None
    robots, trials = Robots(options.calibration), []
    with bar(len(options.rec), "reading", "recording") as advance:
        for path, name in zip(options.rec, distinct_names(options.rec), strict=True):
            recording = robots.of(read(path))
            held = recording.metadata.trial != FREE
            truth = read_truth(path, recording.metadata.robots, estimate) if options.truth and held else None
            trials.append(
                replay_trial(recording, name, estimate, truth, diagnosis, _payload(options.payload))
            )
            advance(1)
    return trials


def _joint_replays(options: Replay, model: Path) -> list[JointReplay]:
    from mocobot import serial
    from mocobot_view.joint_replay import joint_replay

    robot, replays = serial.read_model(model), []
    with bar(len(options.rec), "reading", "log") as advance:
        for path, name in zip(options.rec, distinct_names(options.rec), strict=True):
            parts = serial.read_logs(path, robot, map=options.map)
            for number, log in enumerate(parts, 1):
                replays.append(joint_replay(robot, log, f"{name}-part{number}" if len(parts) > 1 else name))
            advance(1)
    return replays


def _log(
    trials: list[ReplayTrial] | list[JointReplay], advance: Callable[[int], object], stream: Any
) -> None:
    from mocobot_view.joint_replay import JointReplay, log_joint_replay
    from mocobot_view.stream import log_replay

    joints = [trial for trial in trials if isinstance(trial, JointReplay)]
    if joints:
        log_joint_replay(stream, joints, advance)
    else:
        log_replay(stream, [trial for trial in trials if isinstance(trial, ReplayTrial)], advance)


def _payload(given: str | None) -> str | Path | None:
    return Path(given) if given is not None and given.endswith(".xml") else given


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"
