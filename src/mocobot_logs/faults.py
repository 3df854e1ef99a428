"""What a library says of damaged bytes, fit for one sentence on a terminal."""

from __future__ import annotations

LONGEST = 200


def detail_of(error: BaseException) -> str:
    """The first line of an error's message, or its type where there is none: printable and short."""
    lines = str(error).splitlines()
    return shown(lines[0].strip() if lines else "", LONGEST) or type(error).__name__


def shown(text: str, longest: int = 60) -> str:
    """Text of a file as a terminal may show it."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[:longest])[:longest]
