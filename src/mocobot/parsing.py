"""Arguments of the command line as options, and whatever is wrong with them as one sentence."""

import difflib
import math
import os
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import Field, dataclass, fields
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import tyro
from tyro import _errors as failures
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from estimator.errors import InputError

OPTION = "--config"


@dataclass(frozen=True)
class Configured:
    """Arguments of the command line, with those of a file.

    Attributes:
        words: all of them, as if all had been given there.
        table: file and table, as a sentence names them.
        names: options that are the file's.
    """

    words: list[str]
    table: str = ""
    names: tuple[str, ...] = ()

    @contextmanager
    def told(self) -> Iterator[None]:
        """Say in whatever is refused meanwhile if it is of the file.

        Raises:
            InputError: as it was raised, with the file if it begins with an option of the file.
        """
        try:
            yield
        except InputError as error:
            begin = re.match(r"(?:--)?([a-z][a-z_-]*)\b", str(error))
            if begin and begin[1].replace("-", "_") in self.names:
                raise InputError(f"{self.table} {error}") from error
            raise


def with_config(commands: Mapping[str, type], arguments: Sequence[str]) -> Configured:
    """Arguments with the options of a file behind them; what the command line says itself goes before the file.

    Args:
        commands: dataclasses of options by command.
        arguments: of the command line, without the program's name.

    Raises:
        InputError: the file cannot be read, or has a table or key that is no command or option, or a value that none
            takes.
    """
    left, file = _taken(arguments)
    command = next((word for word in left if word in commands), None)
    if file is None or command is None:
        return Configured(left)
    from estimator.strict import read_toml  # numpy, which a refusal does not need

    tables = read_toml(Path(file), "file of options")
    for name, table in tables.items():
        if name not in commands or not isinstance(table, Mapping):
            hint = _close(name, commands) or f"its tables are named after commands: {', '.join(commands)}"
            raise InputError(f"{file}: there is no command {name!r}; {hint}")
    given = {word.partition("=")[0].replace("_", "-") for word in left if word.startswith("--")}
    known = {
        entry.name: entry
        for entry in fields(commands[command])
        if tyro.conf.Positional not in get_args(entry.type)
    }
    names = []
    for key, value in tables.get(command, {}).items():
        name = key.replace("-", "_")
        if name not in known:
            hint = _close(name, known) or f"its options are {', '.join(known)}"
            raise InputError(f"{file}: [{command}] has no option {key!r}; {hint}")
        flag = name.replace("_", "-")
        if not {f"--{flag}", f"--no-{flag}"} & given:
            left += _words(f"{file}: [{command}] {key}", flag, value, known[name])
            names.append(name)
    return Configured(left, f"{file}: [{command}]", tuple(names))


def _taken(arguments: Sequence[str]) -> tuple[list[str], str | None]:
    """The other arguments, and the file."""
    left, file, rest = [], None, iter(arguments)
    for word in rest:
        name, equals, value = word.partition("=")
        if name != OPTION:
            left.append(word)
            continue
        if file is not None:
            raise InputError(f"{OPTION} is given twice; one file can have tables for several commands")
        file = value if equals else next(rest, None)
        if not file:
            raise InputError(f"{OPTION} needs a file: {OPTION} FILE.toml")
    return left, file


def _words(where: str, flag: str, value: Any, entry: Field[Any]) -> list[str]:
    """A value as the command line has it."""
    kinds = get_args(entry.type)
    values = value if isinstance(value, list) else [value]
    if any(isinstance(each, Mapping | list) for each in values):
        raise InputError(f"{where} is {value!r}; it must be a value, or a list of values")
    if isinstance(value, bool):
        if entry.type is not bool and bool not in kinds:
            raise InputError(
                f"{where} is {str(value).lower()}; it is not an option that is switched on or off"
            )
        alone = tyro.conf.FlagCreatePairsOff in kinds
        return [f"--{flag}"] if value else [] if alone else [f"--no-{flag}"]
    if tyro.conf.UseAppendAction in kinds:
        return [word for each in values for word in (f"--{flag}", str(each))]
    return [f"--{flag}", *map(str, values)] if values else []


def _close(name: str, known: Mapping[str, Any]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}?" if close else ""


# Boxes of text would not be one sentence. The hook is not public; pyproject.toml says which versions have it.


PROG = "mocobot"
NARROWEST = 40
"""Columns that the help takes at least: what lays it out does not end in fewer than about ten."""
DESCRIPTION = (
    "Simulate mobile cobots that carry an unknown payload together, estimate it, and find out what the simulation "
    "gets wrong. Exit codes: 0 done; 1 done, and with --strict the answer is not good; 2 refused, with one sentence "
    "that says why; 130 interrupted; 141 nobody reads the output any more. --version "
    "prints the version; COMMAND --config FILE.toml takes more options from a file's table [COMMAND]."
)


def parse(commands: Mapping[str, type], arguments: Sequence[str]) -> Any:
    """The options of the command that the arguments name; help is printed, and ends the process.

    Args:
        commands: dataclasses of options by command.
        arguments: of the command line, without the program's name.

    Raises:
        InputError: the arguments cannot be understood.
    """
    kinds: Any = Union[  # noqa: UP007  (of a tuple that is made)
        tuple(Annotated[kind, tyro.conf.subcommand(name)] for name, kind in commands.items())
    ]

    def refuse(event: failures.ParseErrorEvent) -> None:
        command = next((argument for argument in arguments if argument in commands), None)
        raise InputError(_sentence(event, commands, command))

    if shutil.get_terminal_size().columns < NARROWEST:
        os.environ["COLUMNS"] = str(NARROWEST)
    with failures.on_parse_error(refuse):
        return tyro.cli(
            kinds,
            prog=PROG,
            description=DESCRIPTION,
            args=arguments,
            config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
            registry=_registry(),
        )


def _sentence(event: failures.ParseErrorEvent, commands: Mapping[str, type], command: str | None) -> str:
    """What is wrong, as the sentence of an error."""
    more = f"see {PROG} {command} --help" if command else f"see {PROG} --help"
    match event:
        case failures.MissingSubcommand():
            return f"no command given; it must be one of {', '.join(commands)}"
        case failures.UnrecognizedArgs(tokens=tokens):
            return _unknown(tokens, commands, command, more)
        case failures.MissingArgs(unrecognized_tokens=tokens) if tokens:
            return _unknown(tokens, commands, command, more)
        case failures.MissingArgs(missing_arguments=missing):
            names = [_name(each.arg, and_value=True) for each in missing]
            return f"{' and '.join(names)} must be given; {more}"
        case failures.InvalidChoice(argument=argument, value=value, choices=choices):
            return f"{_name(argument)} is {value!r}; it must be one of {', '.join(choices)}"
        case failures.BadValue(argument=argument):
            needs = "must be given" if argument.is_positional() else "needs a value"
            return f"{_name(argument, and_value=True)} {needs}; {more}"
        case failures.InstantiationFailure(argument=argument, message=message) if argument is not None:
            return f"{_name(argument)} {' '.join(message.split())}"
    return f"these arguments cannot be understood; {more}"


def _unknown(tokens: Sequence[str], commands: Mapping[str, type], command: str | None, more: str) -> str:
    """Arguments that nothing takes, and what may have been meant."""
    token = next((each for each in tokens if each.startswith("-")), tokens[0])
    if command is None and not token.startswith("-"):
        close = difflib.get_close_matches(token, commands, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"the commands are {', '.join(commands)}"
        return f"there is no command {token!r}; {hint}"
    if not token.startswith("-"):
        return f"{command} has no use for {token!r} there; {more}"
    options = [] if command is None else fields(commands[command])
    known = [o.name.replace("_", "-") for o in options if tyro.conf.Positional not in get_args(o.type)]
    close = difflib.get_close_matches(token.strip("-").partition("=")[0], known, n=1)
    hint = f"did you mean --{close[0]}?" if close else more
    return f"{command or 'the command line'} has no option {token}; {hint}"


def _name(argument: Any, *, and_value: bool = False) -> str:
    """How an argument is called on the command line."""
    metavar = str(argument.lowered.metavar)
    if argument.is_positional():
        return metavar
    flag = argument.lowered.name_or_flags[0]
    return f"{flag} {metavar}" if and_value else flag


def _registry() -> ConstructorRegistry:
    """How words become values: what may be left out cannot be named, and messages are for users."""
    registry = ConstructorRegistry()

    @registry.primitive_rule
    def _(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
        kind = _without_none(info.type)
        if get_origin(kind) is Literal and kind is not info.type:
            allowed = tuple(get_args(kind))
            return _spec(str, f"{{{','.join(allowed)}}}", allowed)
        return _spec(*KINDS[kind]) if kind in KINDS else None

    return registry


def _without_none(kind: Any) -> Any:
    """The type of a value that may be left out."""
    kinds = get_args(kind)
    if get_origin(kind) in (Union, UnionType) and len(kinds) == 2 and NoneType in kinds:
        return next(each for each in kinds if each is not NoneType)
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


KINDS: Mapping[Any, tuple[Callable[[str], Any], str]] = {
    int: (_whole, "INT"),
    float: (_number, "FLOAT"),
    str: (str, "NAME"),
    Path: (Path, "PATH"),
}
"""What makes a value of a word, and how the help calls it."""


def _spec(
    make: Callable[[str], Any], metavar: str, choices: tuple[str, ...] | None = None
) -> PrimitiveConstructorSpec[Any]:
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=metavar,
        instance_from_str=lambda words: make(words[0]),
        is_instance=lambda _: True,
        str_from_instance=lambda value: ["none" if value is None else str(value)],
        choices=choices,
    )
