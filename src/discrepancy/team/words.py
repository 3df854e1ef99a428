"""A team's causes in the words of a lab."""

from discrepancy.causes.words import Words
from discrepancy.team.causes import CAUSES


class TeamWords(Words):
    """Sentences about a mocobot team."""

    causes = CAUSES
    units = {"phi": "rad", "theta": "rad", "tau": "N m", "speed": "m/s", "position": "m", "load": "N m"}  # noqa: RUF012
