"""Files of tolerances: how far a machine may be from its model without that being news."""

from collections.abc import Mapping
from pathlib import Path

from estimator.errors import InputError
from estimator.strict import is_number, read_toml


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
    for cause, values in read_toml(path, "file of tolerances").items():
        if cause not in tolerances or not isinstance(values, Mapping):
            raise InputError(f"{path}: unknown table {cause!r}; the causes are {', '.join(tolerances)}")
        for name, value in values.items():
            if name not in tolerances[cause]:
                raise InputError(
                    f"{path}: {cause} has no {name!r}; its parameters are {', '.join(tolerances[cause])}"
                )
            if not is_number(value) or not 0 <= value < 1e6:
                raise InputError(f"{path}: {cause}.{name} is {value!r}; it must be a number of at least 0")
            tolerances[cause][name] = float(value)
        zeros = [name for name, value in tolerances[cause].items() if value == 0]
        if zeros and len(zeros) < len(tolerances[cause]):
            raise InputError(
                f"{path}: {cause}.{zeros[0]} is 0; either all parameters of a cause have a tolerance or none "
                f"({', '.join(tolerances[cause])})"
            )
    return tolerances
