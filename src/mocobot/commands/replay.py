"""``mocobot replay``: recordings as moving scenes and time series, in the Rerun viewer, a browser or a file."""

import time
from pathlib import Path

from discrepancy.result.read import read_diagnosis
from estimator.errors import InputError
from estimator.recording.metadata import FREE
from mocobot.api.given import Robots
from mocobot.api.replay import check_rerun
from mocobot.files.recordings import read
from mocobot.options import Replay
from mocobot.progress import bar
from mocobot_view.facts.fact_files import read_estimate, read_truth
from mocobot_view.replay.replay_trial import ReplayTrial, distinct_names, replay_trial


def run(options: Replay) -> None:
    """Run the command.

    Raises:
        InputError: recordings or options that cannot be used, no Rerun, no display, or an output that cannot be
            written.
    """
    check_rerun()
    from mocobot_view.replay.outputs import (
        check_enabled,
        has_display,
        save_replay,
        serve_replay,
        show_replay,
    )

    check_enabled()
    if options.save is None and not options.web and not has_display():
        raise InputError(
            "there is no display to open the viewer on; write a file with --save replay.rrd, or serve it to a browser "
            "with --web"
        )
    trials = _trials(options)
    for trial in trials:
        for note in trial.notes:
            print(f"{trial.name}: {note}")
    with bar(len(trials), "logging", "recording") as advance:
        if options.save is not None:
            save_replay(trials, options.save, advance)
            print(f"{options.save}: {_size(options.save)}; open it with: rerun {options.save}")
            return
        if not options.web:
            show_replay(trials, advance)
            return
        stream, address = serve_replay(trials, advance)
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
            truth = read_truth(path, recording.metadata.robots) if options.truth and held else None
            trials.append(
                replay_trial(recording, name, estimate, truth, diagnosis, _payload(options.payload))
            )
            advance(1)
    return trials


def _payload(given: str | None) -> str | Path | None:
    return Path(given) if given is not None and given.endswith(".xml") else given


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"
