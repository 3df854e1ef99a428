"""Files of tolerances: how far a machine may be from its model without that being news."""

import tomllib
from collections.abc import Mapping
from pathlib import Path

from estimator.errors import InputError


def read_tolerances(
    path: Path | None, defaults: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """The defaults, with what a TOML file of tables ``[cause]`` and keys ``parameter = value`` changes.

    Args:
        path: the file, or None.
        defaults: standard deviations by cause and parameter.

    Raises:
        InputError: the file cannot be read, or names something unknown, or a value is not a number of at least 0.
    """
    tolerances = {cause: dict(values) for cause, values in defaults.items()}
    if path is None:
        return tolerances
    try:
        given = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{path}: not a readable file of tolerances ({error})") from error
    for cause, values in given.items():
        if cause not in tolerances or not isinstance(values, Mapping):
            raise InputError(f"{path}: unknown table {cause!r}; the causes are {', '.join(tolerances)}")
        for name, value in values.items():
            if name not in tolerances[cause]:
                raise InputError(
                    f"{path}: {cause} has no {name!r}; its parameters are {', '.join(tolerances[cause])}"
                )
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not 0 <= value < 1e6:
                raise InputError(f"{path}: {cause}.{name} is {value!r}; it must be a number of at least 0")
            tolerances[cause][name] = float(value)
        zeros = [name for name, value in tolerances[cause].items() if value == 0]
        if zeros and len(zeros) < len(tolerances[cause]):
            raise InputError(
                f"{path}: {cause}.{zeros[0]} is 0; either all parameters of a cause have a tolerance or none "
                f"({', '.join(tolerances[cause])})"
            )
    return tolerances
