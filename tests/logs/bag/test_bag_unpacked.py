"""What a bag unpacks to has one limit in all; messages that are compressed one by one never fill the memory."""

from __future__ import annotations

import sqlite3
import tracemalloc
from pathlib import Path

import pytest
from mcap.writer import CompressionType

from bag_refusals import refuses
from bags import Team, assert_holds, raw_mcap, rosbags_bag
from estimator import inputs
from estimator.errors import InputError
from estimator.inputs import set_max_unpacked
from mocobot_logs.bag.files import BagFiles

TEAM = Team.draw(rows=60)
MEGABYTE = "x" * 1_000_000


@pytest.fixture(autouse=True)
def _usual(monkeypatch: pytest.MonkeyPatch):
    """What is free is lowered, so that tests need no gigabytes."""
    monkeypatch.setattr(inputs, "FREE_BYTES", 50 << 20)
    yield
    set_max_unpacked(None)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_messages_that_are_compressed_one_by_one(tmp_path: Path, storage: str) -> None:
    """180 MB in some 100 kB."""
    path = rosbags_bag(tmp_path / "bag", TEAM.said(frame=MEGABYTE), storage, "message")
    refuses(
        path, r"unpacks to at least 0\.0\d+ GiB; the limit is 0\.04883 GiB, which --max-unpacked GIB changes"
    )
    set_max_unpacked(0.25)
    tracemalloc.start()
    assert_holds(path, TEAM)
    assert tracemalloc.get_traced_memory()[1] < 40e6  # all of them at once: 180 MB
    tracemalloc.stop()


def test_chunks(tmp_path: Path) -> None:
    path = raw_mcap(
        tmp_path / "a.mcap", TEAM.said(frame=MEGABYTE), compression=CompressionType.ZSTD, chunk_size=2_000_000
    )
    refuses(path, r"unpacks to at least 0\.0\d+ GiB; the limit is 0\.04883 GiB")
    set_max_unpacked(0.25)
    assert_holds(path, TEAM)  # the limit is for one reading, of which there are several here


def test_several_files_have_one_limit(tmp_path: Path) -> None:
    """Each would pass alone."""
    said = TEAM.said(frame=MEGABYTE)
    path = rosbags_bag(tmp_path / "bag", said[:40], "mcap", "file")
    other = rosbags_bag(tmp_path / "other", said[40:80], "mcap", "file")
    assert_read = "unpacks to at least 0.0"
    (first,) = path.glob("*.zstd")
    (second,) = other.glob("*.zstd")
    second.rename(path / "second.mcap.zstd")
    yaml = path / "metadata.yaml"
    yaml.write_text(
        yaml.read_text().replace(f"- {first.name}\n  ros", f"- {first.name}\n  - second.mcap.zstd\n  ros")
    )
    assert "second" in yaml.read_text()
    refuses(path, assert_read)


def test_stored_bags_have_no_limit(tmp_path: Path) -> None:
    set_max_unpacked(1e-6)
    assert_holds(rosbags_bag(tmp_path / "bag", TEAM.said(), "mcap"), TEAM)
    assert_holds(rosbags_bag(tmp_path / "other", TEAM.said(), "sqlite3"), TEAM)


def test_rows_that_share_their_pages(tmp_path: Path) -> None:
    """A hundred messages of 300 kB whose later pages are those of the first: 30 MB in 2 MB."""
    path = rosbags_bag(tmp_path / "bag", Team.draw(robots=1, rows=1).said(), "sqlite3") / "bag.db3"
    large, page = 300_000, 4096
    small = large - 69 * (page - 4)  # as many bytes of it are in the row's own page
    connection = sqlite3.connect(path, isolation_level=None)
    (topic,) = connection.execute("SELECT id FROM topics").fetchone()
    connection.execute("DELETE FROM messages")
    for k in range(100):
        row = topic, k + 2, bytes(small if k else large)
        connection.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", row)
    connection.close()
    content, first, least = bytearray(path.read_bytes()), None, (page - 12) * 32 // 255 - 23
    own = least + (large + 8 - least) % (page - 4)  # https://www.sqlite.org/fileformat.html, "B-tree Pages"
    for at in range(page, len(content), page):
        for k in range(int.from_bytes(content[at + 3 : at + 5], "big") if content[at] == 13 else 0):
            cell = at + int.from_bytes(content[at + 8 + 2 * k : at + 10 + 2 * k], "big")
            parts = [slice(cell, cell + 3), slice(cell + 8, cell + 11), slice(cell + 4 + own, cell + 8 + own)]
            if content[cell + 4 : cell + 7] == b"\x07\x00\x09":  # a message: its sizes, and where it goes on
                first = first or [content[part] for part in parts]
                for part, value in zip(parts, first, strict=True):
                    content[part] = value
    path.write_bytes(content)
    connection = sqlite3.connect(path)
    assert connection.execute("SELECT sum(length(data)) FROM messages").fetchone() == (100 * large,)
    connection.close()
    files = BagFiles(path)
    with pytest.raises(InputError, match=r"damaged, its messages are larger than the file: they share pages"):
        list(files.blocks(tuple(files.topics), lambda _: None))
