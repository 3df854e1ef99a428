"""``mocobot replay``: recordings as moving scenes and time series, in the Rerun viewer, a browser or a file."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

from estimator.errors import InputError
from estimator.recording.parquet import read_recording
from mocobot.files.targets import check_recordings, check_target
from mocobot.progress import bar

if TYPE_CHECKING:
    from mocobot.options import Replay
    from mocobot_view.replay.replay_trial import ReplayTrial

INSTALL = "pip install 'rerun-sdk>=0.41,<0.42'"
SUFFIX = ".rrd"


def run(options: Replay) -> None:
    """Run the command.

    Raises:
        InputError: recordings or options that cannot be used, no Rerun, no display, or an output that cannot be
            written.
    """
    _check(options)
    _check_rerun()
    import rerun as rr

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
    rr.set_strict_mode(True)  # what Rerun cannot log is an error, not a warning among others
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


def _check(options: Replay) -> None:
    """Everything that can be refused before a recording is read."""
    if not options.rec:
        raise InputError("no recording given; name at least one file")
    if options.save is not None and options.web:
        raise InputError("--save and --web are both given; choose a file or a browser")
    check_recordings(options.rec)
    if options.save is not None:
        if options.save.suffix != SUFFIX:
            raise InputError(f"{options.save}: the file's name must end in {SUFFIX}")
        check_target(options.save)


def _check_rerun() -> None:
    """Refuse in one sentence if Rerun is missing, or is not the version that this code speaks to."""
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


def _trials(options: Replay) -> list[ReplayTrial]:
    from discrepancy.result.read import read_diagnosis
    from mocobot_view.facts.fact_files import read_estimate, read_truth
    from mocobot_view.replay.replay_trial import distinct_names, replay_trial

    estimate = read_estimate(options.estimate) if options.estimate else None
    diagnosis = read_diagnosis(options.diagnosis) if options.diagnosis else None
    trials = []
    with bar(len(options.rec), "reading", "recording") as advance:
        for path, name in zip(options.rec, distinct_names(options.rec), strict=True):
            recording = read_recording(path)
            truth = read_truth(path, recording.metadata.robots) if options.truth else None
            trials.append(
                replay_trial(recording, name, estimate, truth, diagnosis, _payload(options.payload))
            )
            advance(1)
    return trials


def _payload(given: str | None) -> str | Path | None:
    return Path(given) if given is not None and given.endswith(".xml") else given


def _size(path: Path) -> str:
    return f"{path.stat().st_size / 1e6:.1f} MB"
