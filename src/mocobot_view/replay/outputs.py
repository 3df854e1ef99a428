"""Where a replay goes: a file, a browser, or the viewer."""

import os
import shutil
import sys
import warnings
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from urllib.parse import quote

import rerun as rr
from rerun.chunk import RrdReader

from estimator.errors import InputError
from estimator.files import whole_file
from mocobot_view.replay.replay_trial import ReplayTrial
from mocobot_view.replay.stream import log_replay, new_stream

Progress = Callable[[int], object] | None
Content = Callable[[rr.RecordingStream], object]

WEB_PORT, DATA_PORT = 9090, 9876
"""Ports of the web viewer and of its data: Rerun's own."""
FLUSH_S = 20.0
"""How long a viewer may take to accept everything; a long recording takes it one."""


def has_display() -> bool:
    """Whether a window could be opened."""
    return not sys.platform.startswith("linux") or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


def check_enabled() -> None:
    """Find out that Rerun is switched off, when it takes everything and keeps nothing.

    Raises:
        InputError: it is.
    """
    if not rr.is_enabled(new_stream()):
        raise InputError(
            f"RERUN is {os.environ.get('RERUN', '')!r} in the environment, which turns Rerun off; unset it"
        )


def save_replay(trials: Sequence[ReplayTrial], path: Path, progress: Progress = None) -> None:
    """Write a replay as an .rrd file, which takes the place of an earlier one only when it is complete.

    Raises:
        InputError: it cannot be written.
    """
    save_content(_content(trials, progress), path)


def show_replay(trials: Sequence[ReplayTrial], progress: Progress = None) -> None:
    """Open the viewer, or use one that is open, and return when it has everything.

    Raises:
        InputError: the viewer does not start.
    """
    show_content(_content(trials, progress))


def serve_replay(trials: Sequence[ReplayTrial], progress: Progress = None) -> tuple[rr.RecordingStream, str]:
    """Serve a replay to browsers until the process, or the stream that is returned, ends.

    Returns:
        The stream, to be kept, and the address to open.

    Raises:
        InputError: the servers do not start; another one may be using their ports.
    """
    return serve_content(_content(trials, progress))


def _content(trials: Sequence[ReplayTrial], progress: Progress) -> Content:
    return lambda stream: log_replay(stream, trials, progress)


def save_content(content: Content, path: Path) -> None:
    """Write whatever logs itself into a stream as an .rrd file, as ``save_replay`` does.

    Raises:
        InputError: it cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.touch(exist_ok=False)  # the SDK's message would name the temporary file
        stream = new_stream()
        try:
            stream.save(temporary)
            content(stream)
            stream.flush()
            stream.disconnect()
        except RuntimeError as error:  # the SDK's writer, which does not say what the system told it
            raise InputError(f"{path}: cannot be written ({_line(error)}); is the disk full?") from error
        _check_complete(temporary)


def show_content(content: Content) -> None:
    """Show whatever logs itself into a stream, as ``show_replay`` does.

    Raises:
        InputError: the viewer does not start.
    """
    stream = new_stream()
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    try:
        rr.spawn(executable_path=beside, hide_welcome_screen=True, recording=stream)
        content(stream)
        stream.flush(timeout_sec=FLUSH_S)
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError(
            f"the Rerun viewer does not open ({_line(error)}); write a file with --save, or use --web"
        ) from error
    stream.disconnect()


def serve_content(content: Content) -> tuple[rr.RecordingStream, str]:
    """Serve whatever logs itself into a stream, as ``serve_replay`` does.

    Returns:
        The stream, to be kept, and the address to open.

    Raises:
        InputError: the servers do not start; another one may be using their ports.
    """
    stream = new_stream()
    try:
        data = stream.serve_grpc()
        rr.serve_web_viewer(web_port=WEB_PORT, open_browser=False)
        content(stream)
        stream.flush(timeout_sec=FLUSH_S)
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError(
            f"the replay cannot be served ({_line(error)}); is another one running on ports {WEB_PORT} and {DATA_PORT}?"
        ) from error
    # Labels are drawn for the dark theme, whatever the browser prefers.
    address = f"http://localhost:{WEB_PORT}?url={quote(data, safe='')}&theme=dark"
    if has_display():
        webbrowser.open(address)
    return stream, address


def _check_complete(path: Path) -> None:
    """The SDK writes in the background and only logs what goes wrong there, so read back what it says it wrote."""
    try:
        with warnings.catch_warnings():  # about a missing footer, which is an error here
            warnings.simplefilter("ignore")
            reader = RrdReader(path)
            whole = (
                len(reader.recordings()) == 1 and len(reader.blueprints()) >= 1 and len(reader.store()) > 0
            )
    except (RuntimeError, ValueError):
        whole = False
    if not whole:
        raise OSError("only a part of it arrived; is the disk full?")


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
