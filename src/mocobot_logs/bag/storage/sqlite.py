"""SQLite files (.db3) as the storage of a bag: tables ``topics``, ``messages`` and, in newer ones, definitions.

Messages come in the order in which they were inserted. The file is taken as it lies on the disk (immutable), so nothing
is ever written beside it; a database that somebody made to harm (views, loops of pages) is stopped by SQLite's own
limits and by rows that do not ascend. ``rosbags`` sets no limits (45 kB whose pages run in circles became 1.8 GB) and
refuses a whole bag for one topic whose definition or quality of service it does not know.
"""

import contextlib
import sqlite3
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import numpy as np

from estimator.errors import InputError
from mocobot_logs.bag.messages import BLOCK_BYTES, MESSAGE_BYTES, Messages, Topic, joined, merged
from mocobot_logs.faults import detail_of, readable
from mocobot_logs.formats import SQLITE as HEAD

_OPERATIONS = 1_000_000
"""SQLite reports after so many of its operations; a row takes some ten and at least eight bytes of the file."""
_REQUIRED = {
    "topics": ("id", "name", "type", "serialization_format"),
    "messages": ("topic_id", "timestamp", "data"),
}

_Row = tuple[int, bytes, int, int]  # topic, message, when it was logged [ns], number of the row


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
        self, topics: Collection[str], advance: Callable[[int], object], block_bytes: int = BLOCK_BYTES
    ) -> Iterator[dict[str, Messages]]:
        """Messages of some topics, see ``Storage.blocks``.

        Raises:
            InputError: the file is damaged.
        """
        ids = [key for key, name in self._ids.items() if name in topics]
        last, told, held = -(1 << 63), 0, 0
        with self._connected() as connection:
            marks = ",".join("?" * len(ids))
            # By rowid: no index is trusted, nothing sorted, and the file is read from front to back.
            rows = connection.execute(
                f"SELECT topic_id, data, timestamp, rowid FROM messages NOT INDEXED WHERE topic_id IN ({marks}) "
                "ORDER BY rowid",
                ids,
            )
            while found := self._next(rows, block_bytes):
                order = np.array([row[3] for row in found], np.int64)
                if order[0] <= last or (order[1:] <= order[:-1]).any():
                    raise InputError(f"{self.name}: damaged, its table 'messages' holds the same row twice")
                last = int(order[-1])
                held += sum(len(row[1]) for row in found)
                if held > self.size:
                    raise InputError(
                        f"{self.name}: damaged, its messages are larger than the file: they share pages"
                    )
                yield self._by_topic(found)
                now = int(self.size * min(max(last / self._last, 0.0), 1.0)) if self._last > 0 else 0
                advance(now - told)
                told = now
        advance(self.size - told)

    def _next(self, rows: Iterator[_Row], block_bytes: int) -> list[_Row]:
        """Rows of about one block."""
        found, held = [], 0
        try:
            for row in rows:
                found.append(row)
                held += len(row[1]) + 64
                if held > block_bytes:
                    break
        except TypeError as error:
            raise InputError(f"{self.name}: damaged, its table 'messages' has a row without data") from error
        return found

    def _by_topic(self, rows: list[_Row]) -> dict[str, Messages]:
        parts: dict[str, list[_Row]] = {name: [] for name in self._ids.values()}
        by_id = {key: parts[name] for key, name in self._ids.items()}  # one topic may be listed several times
        for row in rows:
            by_id[row[0]].append(row)
        found = {}
        for topic, part in parts.items():
            if not part:
                continue
            _, payloads, stamps, _ = zip(*part, strict=True)
            if {*map(type, payloads)} != {bytes} or {*map(type, stamps)} != {int}:
                raise InputError(
                    f"{self.name}: damaged, its table 'messages' has a row that holds no message"
                )
            where = f"{self.name}: topic {topic!r:.80}"
            found[topic] = joined(payloads, np.array(stamps, np.int64), where)
        return found

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
        with readable(self.name):
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
        if not head.startswith(HEAD):
            raise InputError(f"{self.name}: not an SQLite file, it begins with other bytes")
        page = int.from_bytes(head[16:18], "big")
        pages = int.from_bytes(head[28:32], "big") if head[24:28] == head[92:96] else 0  # else out of date
        whole = max(pages * (65536 if page == 1 else page), 100)
        if self.size < whole:
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
        except sqlite3.DataError as error:
            limit = f"a message of more than {MESSAGE_BYTES >> 20} MiB"
            raise InputError(
                f"{self.name}: {limit} ({error}); joint data are read from smaller ones"
            ) from error
        except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
            what = "its pages run in circles" if left < 0 else detail_of(error)
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
        topics: list[Topic] = []
        query = "SELECT id, name, type, serialization_format FROM topics LIMIT 10000"
        for key, name, kind, encoding in connection.execute(query):
            if not (type(key) is int and all(isinstance(text, str) for text in (name, kind, encoding))):
                raise InputError(
                    f"{self.name}: damaged, its table 'topics' has a row {(key, name, kind)!r:.80}"
                )
            topics.append(Topic(name, kind, encoding, *definitions.get(kind, ("", ""))))
            self._ids[key] = name
        return merged(topics, self.name)
