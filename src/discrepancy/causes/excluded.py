"""Causes that are left out of a catalogue on request."""

from collections.abc import Collection, Iterable

from estimator.errors import InputError


def excluded_from(catalogue: Collection[str], names: Iterable[str]) -> frozenset[str]:
    """The names, all of them in the catalogue.

    Raises:
        InputError: one is not.
    """
    for name in sorted(set(names) - set(catalogue)):
        raise InputError(f"cause {name!r} does not exist; the causes are {', '.join(catalogue)}")
    return frozenset(names)
