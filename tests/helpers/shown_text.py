"""Compare what a page shows with what a program prints."""

from __future__ import annotations

import re

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")


def in_words(line: str) -> str:
    """A line without its numbers, whose last digits differ between processors, and their widths."""
    return re.sub(r"\s+", " ", NUMBER.sub("#", line)).strip()
