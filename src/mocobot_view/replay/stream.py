"""A replay as one Rerun recording."""

from collections.abc import Callable, Sequence

import rerun as rr

from mocobot_view.replay.blueprint import blueprint
from mocobot_view.replay.key import log_keys
from mocobot_view.replay.log_payload import log_payload
from mocobot_view.replay.log_robots import log_causes, log_robots
from mocobot_view.replay.log_series import log_series
from mocobot_view.replay.replay_trial import ReplayTrial
from mocobot_view.replay.summary import summary

APPLICATION = "mocobot"


def new_stream() -> rr.RecordingStream:
    """An empty stream; connect a file, a server or a viewer before anything is logged."""
    return rr.RecordingStream(APPLICATION)


def log_replay(
    stream: rr.RecordingStream,
    trials: Sequence[ReplayTrial],
    progress: Callable[[int], object] | None = None,
    tab: str | None = None,
) -> None:
    """Log trials side by side, each below the root of its name, all on one timeline that starts at 0.

    Args:
        stream: where to.
        trials: what is shown.
        progress: called with 1 after each trial.
        tab: tab that is open at first (see ``blueprint``).
    """
    stream.send_blueprint(blueprint(trials, tab), make_active=True, make_default=True)
    stream.send_recording_name(", ".join(trial.name for trial in trials))
    for trial in trials:
        stream.log(f"{trial.name}", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log(
            f"{trial.name}/summary", rr.TextDocument(summary(trial), media_type="text/markdown"), static=True
        )
        log_robots(stream, trial)
        log_payload(stream, trial)
        log_causes(stream, trial)
        log_series(stream, trial)
        log_keys(stream, trial)
        if progress:
            progress(1)
