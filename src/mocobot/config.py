"""Options from a file: ``mocobot COMMAND --config FILE.toml`` adds those of its table ``[COMMAND]``."""

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import Field, dataclass, fields
from pathlib import Path
from typing import Any, get_args

import tyro

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
