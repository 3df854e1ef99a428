"""How far a well-kept Omnid may be from its model without that being news: standard deviations per parameter."""

from pathlib import Path

from discrepancy import tolerances_file
from discrepancy.team.causes import CAUSES


def default_tolerances() -> dict[str, dict[str, float]]:
    """Those that the causes have, by cause and parameter."""
    return {
        name: dict(zip(cause.parameters, cause.tolerances, strict=True))
        for name, cause in CAUSES.items()
        if cause.tolerances
    }


def read_tolerances(path: Path | None) -> dict[str, dict[str, float]]:
    """The defaults, with what a TOML file changes; see ``discrepancy.tolerances_file``.

    Raises:
        InputError: the file cannot be read, or names something unknown, or a value is not a number of at least 0.
    """
    return tolerances_file.read_tolerances(path, default_tolerances())
