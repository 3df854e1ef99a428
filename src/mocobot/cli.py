"""The ``mocobot`` command: parse the arguments, run the command and turn every error into one sentence."""

import difflib
import io
import math
import os
import re
import shutil
import signal
import sys
import textwrap
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import Field, dataclass, field, fields
from functools import cache
from importlib import import_module
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NoReturn, TextIO, Union, cast, get_args, get_origin

from estimator.errors import InputError
from estimator.inputs import printable, set_max_unpacked
from mocobot_sim.errors import TrialError

TASKS = {
    "Begin": (
        {"example": "a robot's model and logs with one hidden fault, and the commands that find it"},
        "mocobot example arm",
    ),
    "Look at a log": (
        {
            "inspect": "stamps, channels, clocks, wiring, excitation, before anyone trusts a number",
            "map": "draft which column is which channel, by names, units and values",
            "convert": "to a recording on one grid and one clock, or a recording to another format",
        },
        "mocobot inspect monday.csv --map monday.toml",
    ),
    "Estimate": (
        {
            "estimate": "grasps, mass, centre of mass and inertia of what a team carries",
            "calibrate": "how robots differ from their model: masses, friction, rotors, zeros",
        },
        "mocobot estimate monday.parquet tuesday.parquet --out est.json",
    ),
    "Find what is wrong": (
        {
            "watch": "all of it at once: inspect, estimate, calibrate if need be, diagnose, and a page",
            "diagnose": "what the simulation gets wrong, the physical cause, and what fixing it is worth",
            "compare": "two estimates, calibrations or diagnoses: what changed beyond its errors",
        },
        "mocobot diagnose monday.csv --model robot.xml --out verdict",
    ),
    "Simulate and test": (
        {
            "simulate": "trials of a team, with effects hidden in it, and the truth beside each",
            "effects": "what can be hidden: parameters, units and ranges",
            "campaign": "try your own experiment blind, and count what is found, missed and invented",
            "paper": "the paper's experiment, published figures beside ours",
        },
        "mocobot simulate --effect sea_bias:robot=2,joint=1,bias=0.08 --out faulty.parquet",
    ),
    "Show": (
        {
            "report": "one HTML page of a result folder",
            "replay": "recordings as a moving scene, estimate against truth, all signals (Rerun)",
        },
        "mocobot report verdict",
    ),
}
"""Content of the help: for each task its commands with their purpose, and an example."""
COMMANDS = [name for commands, _ in TASKS.values() for name in commands]
"""Names of the commands. Each has a dataclass of options in ``mocobot.options``, a function in ``mocobot.checks`` that
refuses bad input before slow imports, and a function in ``mocobot.commands`` that runs it."""
PROG, CONFIG = "mocobot", "--config"
ABOUT = (
    "Find out from logs what a robot's simulation model gets wrong, name the cause, and write a better model. "
    "Simulate, estimate and calibrate teams of mobile cobots that carry a payload.",
    "Exit codes: 0 done; 1 done, and with --strict the answer is not good; 2 refused, with one sentence that says why; "
    "130 interrupted; 141 nobody reads the output any more. --version prints the version. COMMAND --help lists the "
    "options of a command; COMMAND --config FILE.toml takes more options from a file's table [COMMAND].",
)
NOT_GOOD, REFUSED, INTERRUPTED, CLOSED = 1, 2, 130, 141
"""Exit codes; the last two are 128 plus the number of the signal (SIGINT, SIGPIPE)."""
ENDING = (signal.SIGTERM, signal.SIGHUP)
"""Signals that end the command like an interruption: temporary files are removed."""
NARROWEST, WIDEST = 40, 100
"""Smallest and largest width of the help [columns]."""


class NotGood(Exception):
    """Raised with ``--strict`` after all output is written, if the result is bad; the message says why."""


class _Shown:
    """Standard output that escapes terminal control sequences in the printed text."""

    def __init__(self, out: TextIO) -> None:
        self._out = out

    def write(self, text: str) -> int:
        """Print escaped text."""
        return self._out.write(printable(text))

    def __getattr__(self, name: str) -> Any:
        """Forward every other attribute to standard output."""
        return getattr(self._out, name)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; end the process with an exit code unless the command succeeds.

    Exit codes: 1 done, but ``--strict`` rejects the result; 2 refused, with one sentence on standard error;
    130 interrupted; 141 standard output was closed before everything was printed; 143 terminated.
    """
    for each in ENDING:
        if signal.getsignal(each) == signal.SIG_DFL:  # keep SIGHUP ignored under nohup
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


def _run(arguments: Sequence[str]) -> None:
    if isinstance(sys.stdout, io.TextIOWrapper):  # the terminal may not encode all names
        sys.stdout.reconfigure(errors="backslashreplace")
    name = next((word for word in arguments if word in COMMANDS), None)
    if "--version" in arguments:
        print(f"mocobot {_version()}")
        return
    if name is None and {"-h", "--help"} & set(arguments):
        print(help_text())
        return
    told = with_config(arguments)
    try:
        options = parse(told.words)
        set_max_unpacked(getattr(options, "max_unpacked", None))
        command = type(options).__name__.lower()
        getattr(import_module("mocobot.checks"), f"check_{command}")(options)
        # joblib stops idle workers and starts new ones. No work is lost, and the user cannot prevent it.
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs", category=UserWarning)
        with redirect_stdout(cast("TextIO", _Shown(sys.stdout))):
            _command(command)(options)
    except InputError as error:
        raise InputError(told.in_words_of_the_user(str(error))) from error


def _command(name: str) -> Callable[[Any], None]:
    """Import the function that runs a command; help and refusals do without MuJoCo and the estimator."""
    try:
        return getattr(import_module("mocobot.commands"), name)
    except (AttributeError, ImportError, RuntimeError) as error:
        renderer = os.environ.get("MUJOCO_GL")
        if not renderer:
            raise
        said = " ".join(str(error).split())
        raise InputError(
            f"MUJOCO_GL is {renderer!r} and MuJoCo does not load so ({said}); unset it"
        ) from error


def help_text() -> str:
    """Format the help: the commands by task, with an example of each task."""
    width = max(NARROWEST, min(WIDEST, shutil.get_terminal_size((80, 24)).columns))
    lines = [f"usage: {PROG} COMMAND [OPTIONS]", "", *textwrap.wrap(ABOUT[0], width)]
    for task, (commands, example) in TASKS.items():
        lines += ["", f"{task}:"]
        for name, said in commands.items():
            lines += textwrap.wrap(said, width, initial_indent=f"  {name:11}", subsequent_indent=" " * 13)
        lines += textwrap.wrap(
            example, width, initial_indent="  $ ", subsequent_indent="      ", break_on_hyphens=False
        )
    return "\n".join([*lines, "", *textwrap.wrap(ABOUT[1], width)])


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version  # takes 20 ms; only --version needs it

    try:
        return version("mocobot")
    except PackageNotFoundError:
        return "(not installed, run from its source)"


def _end(number: int, _: object) -> NoReturn:
    for each in ENDING:
        signal.signal(each, signal.SIG_IGN)  # ignore further signals while the process ends
    sys.exit(128 + number)


def _flush() -> None:
    """Flush standard output; also needed after the help, which ends the process."""
    try:
        print(end="", flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        _forget()
        raise InputError(f"standard output: cannot be written ({error.strerror})") from error


def _forget() -> None:
    """Redirect standard output to the null device, so that Python's flush at exit cannot fail again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _exit(sentence: str, code: int) -> NoReturn:
    print(f"mocobot: {printable(sentence, keep='')}", file=sys.stderr)
    sys.exit(code)


@cache
def kinds() -> dict[str, type]:
    """Map each command to the dataclass of its options."""
    options = import_module("mocobot.options")
    return {name: getattr(options, name.capitalize()) for name in COMMANDS}


def flags(command: str) -> dict[str, Field[Any]]:
    """Map each option of a command, without leading dashes, to the dataclass field that it sets."""
    tyro = import_module("tyro")
    found = {}
    for entry in fields(kinds()[command]):
        if tyro.conf.Positional not in get_args(entry.type):
            names = [
                each.name for each in get_args(entry.type) if isinstance(getattr(each, "name", None), str)
            ]
            found[(names or [entry.name])[0].replace("_", "-")] = entry
    return found


@dataclass(frozen=True)
class Configured:
    """Arguments of the command line, merged with those of a configuration file.

    Attributes:
        words: all arguments, as if the command line had given them all.
        command: name of the command, or None.
        spelled: the user's spelling of each option, by option name.
        table: file and table, as error messages name them.
        names: options that come from the file.
    """

    words: list[str]
    command: str | None = None
    spelled: Mapping[str, str] = field(default_factory=dict)
    table: str = ""
    names: tuple[str, ...] = ()

    def in_words_of_the_user(self, sentence: str) -> str:
        """Rewrite an error message: spell options as the user did, and name the file that set the first one."""
        if self.command is None:
            return sentence
        by_field = {field.name: name for name, field in flags(self.command).items()}
        names = "|".join(by_field)
        verbs = "is|are|goes|names|must|needs"
        if begin := re.match(rf"({names})(?: and ({names}))?(?= (?:{verbs})\b)", sentence):
            named = " and ".join(f"--{by_field[name]}" for name in begin.groups() if name)
            sentence = named + sentence[begin.end() :]
        if not (begin := re.match(r"--([a-z][a-z-]*)\b", sentence)):
            return sentence
        sentence = self.spelled.get(begin[1], begin[0]) + sentence[begin.end() :]
        return f"{self.table} {sentence}" if begin[1] in self.names else sentence


def with_config(arguments: Sequence[str]) -> Configured:
    """Append the options of the ``--config`` file to the arguments; the command line takes precedence.

    Raises:
        InputError: the file cannot be read, or names an unknown command or option.
    """
    left, file = _taken(arguments)
    command = next((word for word in left if word in COMMANDS), None)
    if command is None:
        return Configured(left)
    left, spelled = _renamed(left, command)
    if file is None:
        return Configured(left, command, spelled)
    from estimator.strict import read_toml

    tables = read_toml(Path(file), "file of options")
    for name, table in tables.items():
        if name not in COMMANDS or not isinstance(table, Mapping):
            hint = _close(name, COMMANDS) or f"its tables are named after commands: {', '.join(COMMANDS)}"
            raise InputError(f"{file}: there is no command {name!r}; {hint}")
    given = {word.partition("=")[0].replace("_", "-") for word in left if word.startswith("--")}
    known, names = flags(command), []
    for key, value in tables.get(command, {}).items():
        flag = _newer(key.replace("_", "-"), known)
        if flag not in known:
            listed = [name.replace("-", "_") for name in known]
            hint = _close(key, listed) or f"its options are {', '.join(listed)}"
            raise InputError(f"{file}: [{command}] has no option {key!r}; {hint}")
        if not {f"--{flag}", f"--no-{flag}"} & given:
            left += _words(f"{file}: [{command}] {key}", flag, value, known[flag])
            names.append(flag)
    return Configured(left, command, spelled, f"{file}: [{command}]", tuple(names))


def _taken(arguments: Sequence[str]) -> tuple[list[str], str | None]:
    """Split the arguments into all others and the path of the ``--config`` file, or None."""
    left, file, rest = [], None, iter(arguments)
    for word in rest:
        name, equals, value = word.partition("=")
        if name != CONFIG:
            left.append(word)
            continue
        if file is not None:
            raise InputError(f"{CONFIG} is given twice; one file can have tables for several commands")
        file = value if equals else next(rest, None)
        if not file:
            raise InputError(f"{CONFIG} needs a file: {CONFIG} FILE.toml")
    return left, file


def _newer(flag: str, known: Mapping[str, Any]) -> str:
    """Translate an earlier name of an option, if the command has only the new one."""
    newer = import_module("mocobot.options").OLD_NAMES.get(flag)
    return newer if newer in known and flag not in known else flag


def _renamed(words: list[str], command: str) -> tuple[list[str], dict[str, str]]:
    """Replace earlier option names by the new ones; also return the user's spelling of each option."""
    known, out, spelled = flags(command), [], {}
    for word in words:
        name, equals, value = word.partition("=")
        if name.startswith("--"):
            flag = _newer(name[2:].replace("_", "-"), known)
            if spelled.setdefault(flag, name) != name:
                raise InputError(f"{spelled[flag]} and {name} are two names of one option; give one of them")
            name = f"--{flag}" if flag in known else name
        out.append(name + equals + value)
    if command == "convert" and "--out" in out[:-1]:  # convert takes its output as a positional argument
        at = out.index("--out")
        out = [*out[:at], *out[at + 2 :], out[at + 1]]
    return out, spelled


def _words(where: str, flag: str, value: Any, entry: Field[Any]) -> list[str]:
    """Translate a value of the configuration file into command-line arguments."""
    tyro, allowed = import_module("tyro"), get_args(entry.type)
    values = value if isinstance(value, list) else [value]
    if any(isinstance(each, Mapping | list) for each in values):
        raise InputError(f"{where} is {value!r}; it must be a value, or a list of values")
    if isinstance(value, bool):
        if entry.type is not bool and bool not in allowed:
            raise InputError(
                f"{where} is {str(value).lower()}; it is not an option that is switched on or off"
            )
        alone = tyro.conf.FlagCreatePairsOff in allowed
        return [f"--{flag}"] if value else [] if alone else [f"--no-{flag}"]
    if tyro.conf.UseAppendAction in allowed:
        return [word for each in values for word in (f"--{flag}", str(each))]
    return [f"--{flag}", *map(str, values)] if values else []


def _close(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}?" if close else ""


def parse(words: Sequence[str]) -> Any:
    """Parse arguments into the options of their command; ``--help`` prints the help and ends the process.

    Raises:
        InputError: the arguments do not fit the command.
    """
    import tyro
    from tyro import (
        _errors,
    )  # private, to report errors as one sentence instead of boxes; pyproject.toml restricts the versions

    def refuse(event: _errors.ParseErrorEvent) -> None:
        raise InputError(_sentence(event, next((word for word in words if word in COMMANDS), None)))

    if shutil.get_terminal_size().columns < NARROWEST:
        os.environ["COLUMNS"] = str(NARROWEST)
    subcommands: Any = Union[  # noqa: UP007  (of a tuple that is made)
        tuple(Annotated[kind, tyro.conf.subcommand(name)] for name, kind in kinds().items())
    ]
    with _errors.on_parse_error(refuse):
        try:
            return tyro.cli(
                subcommands,
                prog=PROG,
                args=words,
                config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
                registry=_registry(),
            )
        except OSError as error:
            if error.filename is None:  # the pipe is closed
                raise
            said = f"{error.filename}: cannot be written ({error.strerror})"  # a shell completion of tyro
            raise InputError(said) from error


def _sentence(event: Any, command: str | None) -> str:
    """Turn a parse error of tyro into one sentence."""
    from tyro import _errors

    more = f"see {PROG} {command} --help" if command else f"see {PROG} --help"
    match event:
        case _errors.MissingSubcommand():
            return f"no command given; it must be one of {', '.join(COMMANDS)}"
        case _errors.UnrecognizedArgs(tokens=tokens):
            return _unknown(tokens, command, more)
        case _errors.MissingArgs(unrecognized_tokens=tokens) if tokens:
            return _unknown(tokens, command, more)
        case _errors.MissingArgs(missing_arguments=missing):
            names = [_name(each.arg, and_value=True) for each in missing]
            return f"{' and '.join(names)} must be given; {more}"
        case _errors.InvalidChoice(argument=argument, value=value, choices=choices):
            return f"{_name(argument)} is {value!r}; it must be one of {', '.join(choices)}"
        case _errors.BadValue(argument=argument):
            needs = "must be given" if argument.is_positional() else "needs a value"
            return f"{_name(argument, and_value=True)} {needs}; {more}"
        case _errors.InstantiationFailure(argument=argument, message=message) if argument is not None:
            return f"{_name(argument)} {' '.join(message.split())}"
    return f"these arguments cannot be understood; {more}"


def _unknown(tokens: Sequence[str], command: str | None, more: str) -> str:
    """Report an unknown argument and suggest a similar one."""
    token = next((each for each in tokens if each.startswith("-")), tokens[0])
    if command is None and not token.startswith("-"):
        hint = _close(token, COMMANDS) or f"the commands are {', '.join(COMMANDS)}"
        return f"there is no command {token!r}; {hint}"
    if not token.startswith("-"):
        return f"{command} has no use for {token!r} there; {more}"
    known = list(flags(command)) if command else []
    close = difflib.get_close_matches(token.strip("-").partition("=")[0], known, n=1)
    hint = f"did you mean --{close[0]}?" if close else more
    return f"{command or 'the command line'} has no option {token}; {hint}"


def _name(argument: Any, *, and_value: bool = False) -> str:
    """Return the flag of an option, or the metavar of a positional argument."""
    metavar = str(argument.lowered.metavar)
    if argument.is_positional():
        return metavar
    flag = argument.lowered.name_or_flags[0]
    return f"{flag} {metavar}" if and_value else flag


def _registry() -> Any:
    """Make tyro's registry of value parsers: an optional value does not accept "none", and errors suit users."""
    from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec

    registry = ConstructorRegistry()

    @registry.primitive_rule
    def _(info: Any) -> Any:
        kind, choices = _without_none(info.type), None
        if get_origin(kind) is Literal and kind is not info.type:
            choices = tuple(get_args(kind))
            make, metavar = str, f"{{{','.join(choices)}}}"
        elif kind in VALUES:
            make, metavar = VALUES[kind]
        else:
            return None
        return PrimitiveConstructorSpec(
            nargs=1,
            metavar=metavar,
            instance_from_str=lambda words: make(words[0]),
            is_instance=lambda _: True,
            str_from_instance=lambda value: ["none" if value is None else str(value)],
            choices=choices,
        )

    return registry


def _without_none(kind: Any) -> Any:
    """Return T for the type T | None, and any other type unchanged."""
    allowed = get_args(kind)
    if get_origin(kind) in (Union, UnionType) and len(allowed) == 2 and NoneType in allowed:
        return next(each for each in allowed if each is not NoneType)
    return kind


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"is {text!r}; it must be a whole number") from None


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"is {text!r}; it must be a number")
    return value


VALUES: Mapping[Any, tuple[Callable[[str], Any], str]] = {
    int: (_whole, "INT"),
    float: (_number, "FLOAT"),
    str: (str, "NAME"),
    Path: (Path, "PATH"),
}
"""For each type, the function that parses its text and its metavar in the help."""
