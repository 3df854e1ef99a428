"""Rooms stay small enough to be looked over."""

from __future__ import annotations

from collections import Counter

from source_tree import SRC

MOST_LINES = 300
MOST_FILES = 15
CATALOGUES = {"causes", "effects"}
"""Folders with one file an entry."""


def test_no_file_is_too_long() -> None:
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in SRC.rglob("*.py")}
    assert len(lines) > 300
    assert not {str(path): n for path, n in lines.items() if n > MOST_LINES}


def test_no_room_is_crowded() -> None:
    rooms = Counter(path.parent for path in SRC.rglob("*.py") if path.name != "__init__.py")
    assert len(rooms) > 20
    crowded = {str(room): count for room, count in rooms.items() if count > MOST_FILES}
    assert not {room for room in crowded if room.rsplit("/", 1)[-1] not in CATALOGUES}
