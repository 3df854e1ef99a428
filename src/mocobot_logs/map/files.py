"""Maps by file or by name: where a log has each channel, and in which unit, sign and zero (docs/measured-data.md)."""

from functools import cache
from importlib import resources
from pathlib import Path

from estimator.errors import InputError
from estimator.inputs import parse_toml
from mocobot_logs.faults import detail_of, read_small
from mocobot_logs.map.log_map import ChannelMap, CsvMap, LogMap, TimeMap
from mocobot_logs.map.parse import parse_map

__all__ = ["MAPS", "ChannelMap", "CsvMap", "LogMap", "TimeMap", "builtin_map", "builtin_map_text", "read_map"]

MAPS = (
    "omnid-ros2",
    "mocobot-ros2",
    "mocobot",
    "mocobot-wrist",
    "mocobot-arrays",
    "mocobot-arrays-wrist",
)
"""Built-in maps."""
_LARGEST_BYTES = 1 << 20


def read_map(path_or_name: Path | str) -> LogMap:
    """A map from its file, or a built-in one by name; a name comes first.

    Raises:
        InputError: there is no such map, the file is not TOML, or its keys or values are not allowed.
    """
    if str(path_or_name) in MAPS:
        return builtin_map(str(path_or_name))
    path = Path(path_or_name)
    return parse_map(toml_values(path), str(path))


@cache
def builtin_map(name: str) -> LogMap:
    """A built-in map.

    Raises:
        InputError: there is none of that name.
    """
    return parse_map(_values(builtin_map_text(name), f"map {name}"), name)


def builtin_map_text(name: str) -> str:
    """The TOML of a built-in map, to start one's own from.

    Raises:
        InputError: there is none of that name.
    """
    if name not in MAPS:
        raise InputError(f"map {name!r} does not exist; the built-in maps are {', '.join(MAPS)}")
    return (resources.files("mocobot_logs.map") / "builtin" / f"{name}.toml").read_text(encoding="utf-8")


def toml_values(path: Path) -> dict[str, object]:
    """Keys and values of a map's file.

    Raises:
        InputError: there is no such file, or it is not TOML.
    """
    return _values(_read(path), f"map {path}")


def _read(path: Path) -> str:
    names = ", ".join(MAPS)
    try:
        if not path.exists():
            raise InputError(f"map {path}: there is no such file, and the built-in maps are {names}")
        if not path.is_file():
            raise InputError(f"map {path}: is not a file; name a TOML file or one of {names}")
        return read_small(path, _LARGEST_BYTES, f"map {path}", "map").decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"map {path}: is not a text file in UTF-8 ({error.reason})") from error
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"map {str(path)!r:.80}: cannot be read ({detail_of(error)})") from error


def _values(text: str, where: str) -> dict[str, object]:
    try:
        return parse_toml(text)
    except (RecursionError, ValueError) as error:
        raise InputError(f"{where}: is not TOML ({detail_of(error)})") from error
