"""Numbers that say something about a kind of motion, and about no other."""

from collections.abc import Sequence

from estimator.errors import InputError


def check_fits(name: str, value: float | None, needed: tuple[str, ...], trajectories: Sequence[str]) -> None:
    """Refuse a number that says nothing about any of the motions.

    Raises:
        InputError: it is given, and no trajectory is one of those that need it.
    """
    if value is not None and not set(needed) & set(trajectories):
        given = "this one is" if len(trajectories) == 1 else "these are"
        raise InputError(
            f"{name} is for a {' or '.join(needed)} trajectory; {given} {', '.join(trajectories)}"
        )
