"""Where the hand-written models are: in the repository, or inside an installed wheel."""

from functools import cache
from pathlib import Path

from estimator.errors import InputError


@cache
def models_dir() -> Path:
    """Folder that holds ``omnid`` and ``payload_*``.

    Raises:
        FileNotFoundError: the installation carries no models.
    """
    here = Path(__file__).resolve()
    for folder in (here.parents[1] / "mjcf", here.parents[3] / "models"):
        if (folder / "omnid" / "omnid.xml").is_file():
            return folder
    raise FileNotFoundError("the mocobot models are missing from this installation")


def payload_names() -> list[str]:
    """Names of the shipped payloads, such as ``a``."""
    return sorted(path.name.removeprefix("payload_") for path in models_dir().glob("payload_*"))


def payload_path(name: str) -> Path:
    """MJCF file of a shipped payload.

    Raises:
        InputError: there is no payload of that name.
    """
    if name not in payload_names():
        raise InputError(f"payload {name!r} does not exist; the payloads are {', '.join(payload_names())}")
    return models_dir() / f"payload_{name}" / "payload.xml"
