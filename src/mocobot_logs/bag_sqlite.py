"""SQLite files (.db3) as the storage of a bag: tables ``topics``, ``messages`` and, in newer ones, definitions.

Messages come in the order in which they were inserted. The file is taken as it lies on the disk (immutable), so nothing
is ever written beside it; a database that somebody made to harm (views, loops of pages) is stopped by SQLite's own
limits and by rows that do not ascend.
"""

from __future__ import annotations

import contextlib
import sqlite3
from array import array
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import numpy as np

from estimator.errors import InputError
from mocobot_logs.bag_messages import BLOCK_BYTES, MESSAGE_BYTES, Messages, Topic, joined

HEAD = b"SQLite format 3\0"
_OPERATIONS = 1_000_000
"""SQLite reports after so many of its operations; a row takes some ten and at least eight bytes of the file."""
_REQUIRED = {
    "topics": ("id", "name", "type", "serialization_format"),
    "messages": ("topic_id", "timestamp", "data"),
}


class SqliteBag:
    """One SQLite file, see ``Storage``."""

    def __init__(self, path: Path, name: str) -> None:
        """Find the topics.

        Raises:
            InputError: not a complete SQLite file with the tables of a bag, or a damaged one.
        """
        self.path, self.name = path, name
        self._check_file()
        with self._connected() as connection:
            self._check_tables(connection)
            self._ids: dict[int, str] = {}
            self.topics = self._read_topics(connection)
            self._last = connection.execute("SELECT max(rowid) FROM messages").fetchone()[0] or 0

    def blocks(
        self, topics: Collection[str], advance: Callable[[int], object]
    ) -> Iterator[dict[str, Messages]]:
        """Messages of some topics, see ``Storage.blocks``.

        Raises:
            InputError: the file is damaged.
        """
        ids = [key for key, name in self._ids.items() if name in topics]
        told = 0
        with self._connected() as connection:
            marks = ",".join("?" * len(ids))
            # By rowid: no index is trusted, nothing sorted, and the file is read from front to back.
            rows = connection.execute(
                f"SELECT rowid, topic_id, timestamp, data FROM messages NOT INDEXED WHERE topic_id IN ({marks}) "
                "ORDER BY rowid",
                ids,
            )
            previous = -(1 << 63)
            while found := self._next(rows, previous):
                previous, parts = found
                yield {
                    topic: part.joined(f"{self.name}: topic {topic!r:.80}") for topic, part in parts.items()
                }
                now = int(self.size * min(max(previous / self._last, 0.0), 1.0)) if self._last > 0 else 0
                advance(now - told)
                told = now
        advance(self.size - told)

    def _next(
        self, rows: Iterator[tuple[int, int, int, bytes]], previous: int
    ) -> tuple[int, dict[str, _Rows]] | None:
        """Rows of about one block by topic, and the last one's number."""
        found: dict[str, _Rows] = {}
        held = 0
        for order, (row, topic, stamp, data) in enumerate(rows):
            if row <= previous or type(data) is not bytes or type(stamp) is not int:
                raise InputError(f"{self.name}: damaged in row {row} of its messages")
            previous = row
            part = found.get(name := self._ids[topic])
            if part is None:
                part = found[name] = _Rows()
            part.log_ns.append(stamp)
            part.order.append(order)
            part.data.append(data)
            held += len(data) + 64
            if held > BLOCK_BYTES:
                break
        return (previous, found) if found else None

    def has_messages(self, topic: str) -> bool:
        """Whether there is any message of a topic.

        Raises:
            InputError: the file is damaged.
        """
        ids = [key for key, name in self._ids.items() if name == topic]
        with self._connected() as connection:
            marks = ",".join("?" * len(ids))
            query = f"SELECT 1 FROM messages NOT INDEXED WHERE topic_id IN ({marks}) LIMIT 1"
            return connection.execute(query, ids).fetchone() is not None

    def _check_file(self) -> None:
        try:
            with self.path.open("rb") as file:
                head = file.read(100)
            self.size = self.path.stat().st_size
            for suffix in ("-wal", "-journal"):
                side = self.path.with_name(self.path.name + suffix)
                if side.exists() and side.stat().st_size:
                    raise InputError(
                        f"{self.name}: its recording was not closed, {side.name} holds a part of it; "
                        f"`sqlite3 {self.path.name} 'PRAGMA wal_checkpoint(TRUNCATE)'` puts it in place"
                    )
        except OSError as error:
            raise InputError(f"{self.name}: cannot be read ({error.strerror or error})") from error
        if not head.startswith(HEAD):
            raise InputError(f"{self.name}: not an SQLite file, it begins with other bytes")
        page = int.from_bytes(head[16:18], "big")
        pages = int.from_bytes(head[28:32], "big")
        whole = pages * (65536 if page == 1 else page)
        if len(head) < 100 or self.size < whole:
            raise InputError(f"{self.name}: cut off, the SQLite file has {self.size} of {whole} bytes")

    @contextlib.contextmanager
    def _connected(self) -> Iterator[sqlite3.Connection]:
        uri = f"{self.path.absolute().as_uri()}?mode=ro&immutable=1"
        left = 16 + 16 * self.size // _OPERATIONS

        def stop() -> bool:
            nonlocal left
            left -= 1
            return left < 0

        try:
            with contextlib.closing(sqlite3.connect(uri, uri=True)) as connection:
                connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MESSAGE_BYTES)
                for setting in ("trusted_schema = OFF", "cell_size_check = ON", "mmap_size = 0"):
                    connection.execute(f"PRAGMA {setting}")
                connection.set_progress_handler(stop, _OPERATIONS)
                yield connection
        except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
            what = "its pages run in circles" if left < 0 else (str(error).splitlines() or ["unreadable"])[0]
            raise InputError(f"{self.name}: damaged, or not a bag ({what})") from error

    def _check_tables(self, connection: sqlite3.Connection) -> None:
        for table, columns in _REQUIRED.items():
            query = "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?"
            created = connection.execute(query, (table,)).fetchone()
            if created is None or not str(created[0]).upper().startswith("CREATE TABLE"):
                raise InputError(f"{self.name}: not a bag, the SQLite file has no table {table!r}")
            there = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
            for column in columns:
                if column not in there:
                    raise InputError(f"{self.name}: not a bag, its table {table!r} has no column {column!r}")

    def _read_topics(self, connection: sqlite3.Connection) -> dict[str, Topic]:
        definitions: dict[str, tuple[str, str]] = {}
        if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
            query = (
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions LIMIT 10000"
            )
            for kind, encoding, text in connection.execute(query):
                if isinstance(kind, str) and isinstance(encoding, str) and isinstance(text, str):
                    definitions[kind] = encoding, text
        topics: dict[str, Topic] = {}
        query = "SELECT id, name, type, serialization_format FROM topics LIMIT 10000"
        for key, name, kind, encoding in connection.execute(query):
            if not (type(key) is int and all(isinstance(text, str) for text in (name, kind, encoding))):
                raise InputError(
                    f"{self.name}: damaged, its table 'topics' has a row {(key, name, kind)!r:.80}"
                )
            known = topics.setdefault(name, Topic(name, kind, encoding, *definitions.get(kind, ("", ""))))
            if (known.type, known.encoding) != (kind, encoding):
                raise InputError(
                    f"{self.name}: topic {name!r:.80} holds both {known.type!r:.80} and {kind!r:.80}"
                )
            self._ids[key] = name
        return topics


class _Rows:
    """Messages of one topic, row by row."""

    def __init__(self) -> None:
        self.log_ns, self.order, self.data = array("q"), array("q"), []

    def joined(self, where: str) -> Messages:
        log_ns, order = (np.frombuffer(values, np.int64) for values in (self.log_ns, self.order))
        return joined(self.data, log_ns, order, where)
