"""Words of a draft."""

DOUBTFUL = "doubtful: "
"""Begins what a line that needs a look says."""


def printable(text: str) -> str:
    """Text as a comment may hold it: in one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text)
