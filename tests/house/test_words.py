"""Words that only this project would understand do not stand in ``src`` and ``docs``."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from source_tree import SRC

ROOT = SRC.parent
PRIVATE = {
    "nought": re.compile(r"\bnought\b", re.IGNORECASE),
    "foretold": re.compile(r"\b(?:un)?foret(?:old|ells?|elling)\b", re.IGNORECASE),
    "sentences that begin with 'Of'": re.compile(r"(?:^[#\s*-]*|[.:;!?] |\"\"\"|\| )Of [a-z]", re.MULTILINE),
    "six-digit seeds": re.compile(r"(?<![\w.,+-])[1-9]\d{5}(?![\w.,])"),
}
"""What is counted: zero is not ``nought``, a prediction is not ``foretold``, and a seed means nothing to a reader."""


def occurrences(folder: Path, suffix: str) -> dict[str, int]:
    """How often each kind of private word stands in the files of a folder."""
    files = sorted(folder.rglob(f"*{suffix}"))
    assert files, f"no {suffix} below {folder}"
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    return {name: len(found) for name, pattern in PRIVATE.items() if (found := pattern.findall(text))}


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("a torque of nought", "nought"),
        ("what is foretold of it", "foretold"),
        ("One is there. Of the other nothing is known.", "sentences that begin with 'Of'"),
        ('"""Of a robot."""', "sentences that begin with 'Of'"),
        ("the set 176824 is right", "six-digit seeds"),
    ],
)
def test_private_words_are_found(text: str, kind: str) -> None:
    assert [name for name, pattern in PRIVATE.items() if pattern.search(text)] == [kind]


@pytest.mark.parametrize("text", ["zero", "All of it. Often.", "a share of 0.123456", "100 000 runs"])
def test_plain_words_are_not(text: str) -> None:
    assert [name for name, pattern in PRIVATE.items() if pattern.search(text)] == []


def test_the_pages_have_none() -> None:
    assert occurrences(ROOT / "docs", ".md") == {}
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [name for name, pattern in PRIVATE.items() if pattern.search(page)] == []


@pytest.mark.parametrize("package", sorted(path.parent.name for path in SRC.glob("*/__init__.py")))
def test_a_package_has_none(package: str) -> None:
    assert occurrences(SRC / package, ".py") == {}
