"""The ``mocobot`` command: a thin edge over the estimator and the simulator."""

import io
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from importlib import import_module
from typing import Any, NoReturn, TextIO, cast

from estimator.errors import InputError
from estimator.inputs import printable, set_max_unpacked
from mocobot import options
from mocobot.parsing import parse, with_config
from mocobot.strict import NotGood
from mocobot_sim.errors import TrialError

COMMANDS = {
    "watch": options.Watch,
    "paper": options.Paper,
    "estimate": options.Estimate,
    "calibrate": options.Calibrate,
    "diagnose": options.Diagnose,
    "convert": options.Convert,
    "map": options.Map,
    "replay": options.Replay,
    "inspect": options.Inspect,
    "report": options.Report,
    "compare": options.Compare,
    "campaign": options.Campaign,
    "simulate": options.Simulate,
    "effects": options.Effects,
}
"""Options by command; ``mocobot.commands`` has a module of each name, whose ``run`` takes them, and ``mocobot.checks``
a function that refuses what it can before anything is loaded that takes time."""
NOT_GOOD, REFUSED, INTERRUPTED, CLOSED = 1, 2, 130, 141
"""Exit codes; the last two are 128 and the signal that other programs die of."""
ENDING = (signal.SIGTERM, signal.SIGHUP)
"""Signals that end the command as an interruption does: with what it began cleared away."""


class _Shown:
    """Standard output with what is printed escaped where it would be a command to a terminal."""

    def __init__(self, out: TextIO) -> None:
        self._out = out

    def write(self, text: str) -> int:
        """Print."""
        return self._out.write(printable(text))

    def __getattr__(self, name: str) -> Any:
        """All else is standard output's own."""
        return getattr(self._out, name)


def _end(number: int, _: object) -> NoReturn:
    for each in ENDING:
        signal.signal(each, signal.SIG_IGN)  # once is enough
    sys.exit(128 + number)


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: ends the process with a code of docs/commands, unless all is well.

    0 done; 1 done, and with ``--strict`` the answer is not good; 2 refused after one sentence on standard error;
    130 interrupted; 141 standard output was closed before everything was printed; 143 terminated.
    """
    for each in ENDING:
        if signal.getsignal(each) == signal.SIG_DFL:  # not where nohup ignores it
            signal.signal(each, _end)
    try:
        try:
            _run(sys.argv[1:] if arguments is None else arguments)
        finally:
            _flush()
    except (InputError, TrialError) as error:
        _exit(str(error), REFUSED)
    except NotGood as error:
        _exit(str(error), NOT_GOOD)
    except KeyboardInterrupt:
        _exit("interrupted", INTERRUPTED)
    except BrokenPipeError:
        _forget()
        sys.exit(CLOSED)


def _flush() -> None:
    """Print what is still to be printed; help ends the process, so that there may be some whatever happened."""
    try:
        print(end="", flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        _forget()
        raise InputError(f"standard output: cannot be written ({error.strerror})") from error


def _forget() -> None:
    """Let go of what cannot be printed: Python tries again on its way out, and that must not fail a second time."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _exit(sentence: str, code: int) -> NoReturn:
    print(f"mocobot: {printable(sentence, keep='')}", file=sys.stderr)
    sys.exit(code)


def _run(arguments: Sequence[str]) -> None:
    if isinstance(sys.stdout, io.TextIOWrapper):  # names may hold what the terminal cannot show
        sys.stdout.reconfigure(errors="backslashreplace")
    if "--version" in arguments:
        print(f"mocobot {_version()}")
        return
    configured = with_config(COMMANDS, arguments)
    with configured.told():
        try:
            options = parse(COMMANDS, configured.words)
        except OSError as error:
            if error.filename is None:  # a closed pipe
                raise
            raise InputError(
                f"{error.filename}: cannot be written ({error.strerror})"
            ) from error  # a completion
        name = next(name for name, kind in COMMANDS.items() if isinstance(options, kind))
        set_max_unpacked(getattr(options, "max_unpacked", None))
        getattr(import_module("mocobot.checks"), f"check_{name}")(options)
        # joblib stops workers that idle, and starts others: nothing is lost, and nobody can do anything about it.
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs", category=UserWarning)
        with redirect_stdout(cast("TextIO", _Shown(sys.stdout))):
            _command(name)(options)


def _version() -> str:
    """Of the installed package."""
    from importlib.metadata import PackageNotFoundError, version  # 20 ms that nothing else needs

    try:
        return version("mocobot")
    except PackageNotFoundError:
        return "(not installed, run from its source)"


def _command(name: str) -> Callable[[Any], None]:
    """What runs the options: imported only now, for neither the help nor a refusal needs MuJoCo or the estimator."""
    try:
        return import_module(f"mocobot.commands.{name}").run
    except (AttributeError, ImportError, RuntimeError) as error:
        renderer = os.environ.get("MUJOCO_GL")
        if not renderer:
            raise
        said = " ".join(str(error).split())
        raise InputError(
            f"MUJOCO_GL is {renderer!r} and MuJoCo does not load so ({said}); unset it"
        ) from error


if __name__ == "__main__":
    main()
