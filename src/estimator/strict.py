"""Read structured files strictly: report unknown, missing or invalid keys, and guess nothing.

Every message names the file, the key, the value and the allowed values.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeGuard

from estimator.errors import InputError
from estimator.inputs import JSON_BYTES, TOML_BYTES, parse_toml, plain, read_input

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_LARGEST = 1e300
Rules = Mapping[str, tuple[str, Callable[[Any], bool]]]
"""By key: description of the allowed values, and a test of a value."""


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Read the tables of a TOML file; ``what`` is its description in messages, without an article.

    Raises:
        InputError: it cannot be read, or is not TOML.
    """
    try:
        return parse_toml(read_input(Path(path), TOML_BYTES).decode("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            f"{path}: not a readable {what} ({getattr(error, 'strerror', None) or error})"
        ) from error


def read_json(path: Path, what: str) -> dict[str, Any]:
    """Read the object of a JSON file; ``what`` is its description in messages, with an article.

    Raises:
        InputError: the file is missing or unreadable, or is not a JSON object.
    """
    try:
        content = read_input(Path(path), JSON_BYTES)
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file; it would be {what}") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); it must be {what}") from error
    if content.startswith(b"PAR1"):
        raise InputError(f"{path}: a Parquet file, as recordings are; it must be {what}")
    return parse_json(content, str(path))


def parse_json(text: str | bytes, where: str) -> dict[str, Any]:
    """Parse a JSON object without repeated keys or NaN.

    Raises:
        InputError: it is not one.
    """
    try:
        values = plain(json.loads(text, object_pairs_hook=_unique, parse_constant=_no_constant))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not valid JSON ({error})") from error
    if not isinstance(values, dict):
        raise InputError(f"{where}: must be a JSON object, not {values!r:.60}")
    return values


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a value is a finite number and not a boolean."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST


def check_known(keys: Iterable[str], valid: Sequence[str], where: str, what: str = "key") -> None:
    """Refuse an unknown key, and suggest the nearest valid one.

    Raises:
        InputError: a key is unknown.
    """
    for key in keys:
        if key not in valid:
            close = difflib.get_close_matches(str(key), valid, n=1)
            hint = f" (did you mean {close[0]!r}?)" if close else ""
            raise InputError(f"{where}: unknown {what} {key!r:.60}{hint}; the {what}s are {', '.join(valid)}")


@dataclass(frozen=True)
class Fields:
    """An object with required and optional keys; every reader raises ``InputError`` with the key's path.

    ``where`` is the name of the object in messages, such as the file's name.
    """

    values: Mapping[str, Any]
    required: Sequence[str]
    where: str
    optional: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Check the keys."""
        if not isinstance(self.values, Mapping):
            raise InputError(f"{self.where} is {self.values!r:.60}; it must be an object")
        keys = [*self.required, *self.optional]
        check_known(self.values, keys, self.where)
        for key in self.required:
            if key not in self.values:
                rule = "required are" if self.optional else "the keys are"
                raise InputError(f"{self.where}: missing key {key!r}; {rule} {', '.join(self.required)}")

    def __contains__(self, key: str) -> bool:
        """Return whether an optional key is present."""
        return key in self.values

    def refuse(self, key: str, allowed: str) -> NoReturn:
        """Report the allowed values of a key.

        Raises:
            InputError: always.
        """
        raise InputError(f"{self.where}: {key} is {self.values[key]!r:.60}; it must be {allowed}")

    def check(self, rules: Rules) -> None:
        """Refuse the first value that is not allowed; absent keys are valid.

        Raises:
            InputError: a value is not allowed.
        """
        for key, (allowed, good) in rules.items():
            if key in self.values and not good(self.values[key]):
                self.refuse(key, allowed)

    def within(self, key: str, required: Sequence[str], optional: Sequence[str] = ()) -> Fields:
        """Read a nested object."""
        return Fields(self.object(key), required, f"{self.where}: {key}", optional)

    def number(self, key: str, least: float = -math.inf, *, above: float = -math.inf) -> float:
        """Read a finite number of at least ``least`` and greater than ``above``."""
        value = self.values[key]
        if not is_number(value):
            self.refuse(key, "a finite number")
        if value < least:
            self.refuse(key, f"a number of at least {least:g}")
        if value <= above:
            self.refuse(key, f"greater than {above:g}")
        return float(value)

    def whole(self, key: str, least: int = 1) -> int:
        """Read an integer of at least ``least``."""
        value = self.values[key]
        if type(value) is not int or value < least:
            self.refuse(key, f"a whole number of at least {least}")
        return value

    def flag(self, key: str) -> bool:
        """Read a boolean."""
        value = self.values[key]
        if type(value) is not bool:
            self.refuse(key, "true or false")
        return value

    def text(self, key: str) -> str:
        """Read printable text: no control characters or lone surrogates, which may disturb a terminal."""
        value = self.values[key]
        if not isinstance(value, str) or not value or not value.isprintable():
            self.refuse(key, "printable text")
        return value

    def words(self, key: str) -> str:
        """Read text with any characters, such as a file's name."""
        value = self.values[key]
        if not isinstance(value, str):
            self.refuse(key, "a text")
        return value

    def one_of(self, key: str, allowed: Iterable[str]) -> Any:
        """Read one of the allowed words."""
        value, allowed = self.values[key], tuple(allowed)
        if not isinstance(value, str) or value not in allowed:
            self.refuse(key, f"one of {', '.join(map(repr, allowed))}")
        return value

    def object(self, key: str) -> dict[str, Any]:
        """Read an object as a dictionary."""
        value = self.values[key]
        if not isinstance(value, dict):
            self.refuse(key, "an object")
        return value

    def list(self, key: str, length: int | None = None) -> list[Any]:
        """Read a list, of a given length if not None."""
        value = self.values[key]
        if not isinstance(value, list) or length not in (None, len(value)):
            self.refuse(key, "a list" if length is None else f"a list of {length} entries")
        return value

    def objects(
        self, key: str, required: Sequence[str], optional: Sequence[str] = (), length: int | None = None
    ) -> list[Fields]:
        """Read a list of objects, which messages count from 1."""
        values = self.list(key, length)
        return [
            Fields(value, required, f"{self.where}: {key}[{k}]", optional)
            for k, value in enumerate(values, 1)
        ]

    def texts(self, key: str) -> tuple[str, ...]:
        """Read a list of texts."""
        values = self.list(key)
        if not all(isinstance(value, str) for value in values):
            self.refuse(key, "a list of texts")
        return tuple(values)

    def array(self, key: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Read nested lists of finite numbers of a given shape."""
        value = self.values[key]
        if not _is_array(value, shape):
            self.refuse(key, f"{' x '.join(map(str, shape))} finite numbers")
        import numpy as np  # not needed for reading text only

        return np.array(value, dtype=float)


def _is_array(value: Any, shape: tuple[int, ...]) -> bool:
    if not shape:
        return is_number(value)
    return (
        isinstance(value, list | tuple)
        and len(value) == shape[0]
        and all(_is_array(v, shape[1:]) for v in value)
    )


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    names = [name for name, _ in pairs]
    if len(set(names)) != len(names):
        raise ValueError(f"key {max(names, key=names.count)!r} appears twice")
    return dict(pairs)


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number")
