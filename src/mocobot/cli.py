"""The ``mocobot`` command: a thin edge over the estimator and the simulator."""

import io
import os
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Annotated, Any, Union

import tyro

from estimator.errors import InputError
from mocobot import options
from mocobot_sim.errors import TrialError

COMMANDS = {
    "paper": options.Paper,
    "estimate": options.Estimate,
    "diagnose": options.Diagnose,
    "convert": options.Convert,
    "map": options.Map,
    "replay": options.Replay,
    "inspect": options.Inspect,
    "report": options.Report,
    "simulate": options.Simulate,
}
"""Options by command; ``mocobot.commands`` has a module of each name, whose ``run`` takes them."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point: exit code 0, or 2 after one sentence on standard error.

    130 when interrupted, and 1 when standard output was closed before everything was printed.
    """
    try:
        _run(arguments)
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("mocobot: interrupted", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        # Python flushes again on its way out; that must not fail a second time.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)


def _run(arguments: Sequence[str] | None) -> None:
    if isinstance(sys.stdout, io.TextIOWrapper):  # names may hold what the terminal cannot show
        sys.stdout.reconfigure(errors="backslashreplace")
    kinds: Any = Union[  # noqa: UP007  (of a list that is made)
        tuple(Annotated[kind, tyro.conf.subcommand(name)] for name, kind in COMMANDS.items())
    ]
    parsed = tyro.cli(
        kinds,
        prog="mocobot",
        description="Simulate mobile cobots that carry an unknown payload together, estimate it, and find out what "
        "the simulation gets wrong.",
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
    )
    command = _command(parsed)
    try:
        command(parsed)
    except (InputError, TrialError) as error:
        print(f"mocobot: {error}", file=sys.stderr)
        sys.exit(2)


def _command(parsed: Any) -> Callable[[Any], None]:
    """What runs the options: imported only now, for the help needs neither MuJoCo nor the estimator."""
    name = next(name for name, kind in COMMANDS.items() if isinstance(parsed, kind))
    try:
        return import_module(f"mocobot.commands.{name}").run
    except (AttributeError, ImportError, RuntimeError) as error:
        renderer = os.environ.get("MUJOCO_GL")
        if not renderer:
            raise
        said = " ".join(str(error).split())
        print(
            f"mocobot: MUJOCO_GL is {renderer!r} and MuJoCo does not load so ({said}); unset it",
            file=sys.stderr,
        )
        sys.exit(2)


if __name__ == "__main__":
    main()
