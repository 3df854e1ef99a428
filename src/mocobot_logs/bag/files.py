"""SQLite files (.db3) as the storage of a bag: tables ``topics``, ``messages`` and, in newer ones, definitions.

Messages come in the order in which they were inserted. The file is taken as it lies on the disk (immutable), so nothing
is ever written beside it; a database that somebody made to harm (views, loops of pages) is stopped by SQLite's own
limits and by rows that do not ascend. ``rosbags`` sets no limits (45 kB whose pages run in circles became 1.8 GB) and
refuses a whole bag for one topic whose definition or quality of service it does not know.

From a path to the files of a bag: a single one, or a folder whose ``metadata.yaml`` names them (rosbag2).

Only the names of the files and their compression are taken from ``metadata.yaml``; its topics, times and counts say
nothing that the files do not say themselves, and are often wrong after a recording was interrupted or repaired.
"""

import contextlib
import re
import shutil
import sqlite3
import weakref
from collections.abc import Callable, Collection, Iterator
from itertools import accumulate
from pathlib import Path, PurePosixPath
from tempfile import mkdtemp
from typing import Any

import numpy as np
from ruamel.yaml import YAML
from ruamel.yaml.tokens import AnchorToken

from estimator.errors import InputError
from estimator.inputs import Unpacked, plain
from mocobot_logs.bag.mcap import McapBag
from mocobot_logs.bag.messages import (
    BLOCK_BYTES,
    MESSAGE_BYTES,
    Messages,
    Storage,
    Topic,
    UnpackError,
    joined,
    merged,
    unpack_file,
    unpack_message,
)
from mocobot_logs.faults import detail_of, read_small, readable
from mocobot_logs.formats import BAG_METADATA, MCAP, ROS1, SQLITE, has_bag_suffix
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


VERSIONS = range(1, 10)
"""Of ``metadata.yaml`` that are read; all that rosbag2 has written so far."""
STORAGES = {"mcap": MCAP, "sqlite3": SQLITE}
_ZSTD = b"\x28\xb5\x2f\xfd"
_METADATA_BYTES = 1 << 20
_DEEPEST = 64
_KEY = "rosbag2_bagfile_information"


class Scratch:
    """A temporary folder that goes when this goes."""

    def __init__(self, wanted_by: Path) -> None:
        """Create it.

        Raises:
            InputError: it cannot be created.
        """
        try:
            self.path = Path(mkdtemp(prefix="mocobot-bag-"))
        except OSError as error:
            raise InputError(
                f"{wanted_by}: cannot be unpacked, there is no temporary folder ({error})"
            ) from error
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


class BagFiles:
    """All files of a bag, opened.

    Attributes:
        topics: by name.
        size: bytes to read.
    """

    def __init__(self, path: Path) -> None:
        """Open them.

        Raises:
            InputError: there is no bag, its ``metadata.yaml`` is not usable, or a file is not complete.
        """
        paths, self._are_packed = _files_of(path)
        self._scratch: Scratch | None = None  # keeps unpacked copies, which go when this goes
        stored = sum(file.stat().st_size for file in paths if file.is_file())
        self._unpacked, self._on_disk = (
            Unpacked(str(path), stored),
            0,
        )  # in one reading of all, and of it those copies
        self._storages = [self._opened(file, number) for number, file in enumerate(paths)]
        self.topics = merged((t for storage in self._storages for t in storage.topics.values()), str(path))
        self.size = sum(storage.size for storage in self._storages)

    def has_messages(self, topic: str) -> bool:
        """Whether there is any message of a topic, as far as the files say.

        Raises:
            InputError: a file is damaged.
        """
        return any(storage.has_messages(topic) for storage in self._storages)

    def blocks(
        self, topics: Collection[str], advance: Callable[[int], object], block_bytes: int = BLOCK_BYTES
    ) -> Iterator[dict[str, Messages]]:
        """Messages of some topics in the order of the files, each unpacked (see ``Storage.blocks``).

        Raises:
            InputError: a file is damaged.
        """
        self._unpacked.size = self._on_disk
        for storage in self._storages:
            for block in storage.blocks(topics, advance, block_bytes):
                if self._are_packed:
                    yield from self._messages(block, storage.name)
                else:
                    yield block

    def _messages(self, block: dict[str, Messages], name: str) -> Iterator[dict[str, Messages]]:
        """Messages that are compressed one by one, about ``BLOCK_BYTES`` at a time, topics in step."""
        orders = {topic: np.maximum.accumulate(m.log_ns).tolist() for topic, m in block.items()}
        held, found = 0, {topic: ([], []) for topic in block}
        for _, topic, k in sorted(
            (at, topic, k) for topic, order in orders.items() for k, at in enumerate(order)
        ):
            try:
                payload = unpack_message(block[topic][k], MESSAGE_BYTES)
            except UnpackError as error:
                raise InputError(
                    f"{name}: topic {topic!r:.80}: damaged, a compressed message {error}"
                ) from error
            self._unpacked.add(len(payload))
            held += len(payload)
            found[topic][0].append(payload)
            found[topic][1].append(block[topic].log_ns[k])
            if held > BLOCK_BYTES:
                yield _joined(found, name)
                held, found = 0, {topic: ([], []) for topic in block}
        if last := _joined(found, name):
            yield last

    def _opened(self, path: Path, number: int) -> Storage:
        name, head = str(path), _head(path)
        if head.startswith(_ZSTD):
            self._scratch = self._scratch or Scratch(path)
            packed, path = path, self._scratch.path / str(number)
            before = self._unpacked.size
            unpack_file(packed, path, tuple(STORAGES.values()), name, self._unpacked)
            self._on_disk += self._unpacked.size - before
            head = _head(path)
        if head.startswith(MCAP):
            return McapBag(path, name, self._unpacked)
        if head.startswith(SQLITE):
            return SqliteBag(path, name)
        if head.startswith(ROS1):
            raise InputError(
                f"{name}: a bag of ROS 1; `rosbags-convert` makes a ROS 2 bag of it, which can be read"
            )
        what = (
            "is empty" if not head else "is neither an MCAP nor an SQLite file, as those of a ROS 2 bag are"
        )
        raise InputError(f"{name}: {what}")


def _files_of(path: Path) -> tuple[list[Path], bool]:
    """The files, and whether every message is compressed by itself."""
    try:
        exists, is_folder = path.exists(), path.is_dir()
    except (OSError, ValueError) as error:  # a name too long for the system, or with a NUL in it
        raise InputError(f"{str(path)!r:.80}: not a usable file name ({error})") from error
    if not exists:
        raise InputError(f"{path}: there is no such file or folder")
    if not is_folder:
        return [path], False
    names, are_packed = _read_metadata(path)
    return [path / name for name in names], are_packed


def _joined(found: dict[str, tuple[list[bytes], list[int]]], name: str) -> dict[str, Messages]:
    return {
        topic: joined(payloads, np.array(log_ns, np.int64), f"{name}: topic {topic!r:.80}")
        for topic, (payloads, log_ns) in found.items()
        if payloads
    }


def _head(path: Path) -> bytes:
    with readable(str(path)):
        if not path.exists():
            raise InputError(f"{path}: there is no such file, though the bag's {BAG_METADATA} names it")
        if not path.is_file():
            raise InputError(f"{path}: is not a regular file")
        with path.open("rb") as file:
            return file.read(16)


def _read_metadata(folder: Path) -> tuple[list[str], bool]:
    """Names of the files, and whether every message is compressed by itself."""
    path = folder / BAG_METADATA
    with readable(str(path)):
        if not path.is_file():
            found = sorted(entry.name for entry in folder.iterdir() if has_bag_suffix(entry))
            if not found:
                raise InputError(
                    f"{folder}: is a folder without a bag ({BAG_METADATA} and .mcap or .db3 files)"
                )
            raise InputError(
                f"{folder}: has no {BAG_METADATA}; `ros2 bag reindex` writes it, or name a single file such as "
                f"{folder / found[0]}"
            )
    content = read_small(path, _METADATA_BYTES, str(path), "bag's metadata")
    values = _load(content, path).get(_KEY)
    if not isinstance(values, dict):
        raise InputError(f"{path}: has no table {_KEY!r}, so it is not the metadata of a bag")
    version = values.get("version")
    if type(version) is not int or version not in VERSIONS:
        raise InputError(
            f"{path}: version is {version!r:.40}; bags of versions {VERSIONS[0]} to {VERSIONS[-1]} are read"
        )
    _one_of(values.get("storage_identifier"), tuple(STORAGES), "storage_identifier", path)
    mode = str(values.get("compression_mode") or "none").lower()
    _one_of(mode, ("none", "file", "message"), "compression_mode", path)
    if mode != "none":
        _one_of(values.get("compression_format"), ("zstd",), "compression_format", path)
    files = values.get("relative_file_paths")
    if not isinstance(files, list) or not files or not all(isinstance(name, str) for name in files):
        raise InputError(f"{path}: relative_file_paths is {files!r:.60}; it must list the bag's files")
    names = [PurePosixPath(name).name for name in files]  # the oldest versions put the bag's folder before it
    if "" in names or ".." in names or len(set(names)) < len(names) or any("\0" in name for name in names):
        raise InputError(
            f"{path}: relative_file_paths is {files!r:.60}; each must be another file in the folder"
        )
    return names, mode == "message"


def _load(content: bytes, path: Path) -> dict[str, Any]:
    text = content.decode("utf-8", errors="replace")
    depth = accumulate((1 if mark in "[{" else -1 for mark in re.findall(r"[\[\]{}]", text)), initial=0)
    if re.search(r"<<\s*:|(?:^|\s)!\S|^\s*%", text, re.MULTILINE) or max(depth) > _DEEPEST:
        # Merged keys grow without bound, tags make objects, deep nesting takes minutes: no recorder writes them.
        raise InputError(f"{path}: holds YAML beyond plain values, which no bag's metadata does")
    try:
        if "&" in text and any(isinstance(t, AnchorToken) for t in YAML(typ="safe", pure=True).scan(text)):
            raise ValueError("it has anchors, which no bag's metadata has")
        values = plain(YAML(typ="safe", pure=True).load(text))
    except Exception as error:  # on damaged text the parser raises many types, not all of them its own
        raise InputError(f"{path}: not readable YAML ({detail_of(error)})") from error
    if not isinstance(values, dict):
        raise InputError(f"{path}: has no table {_KEY!r}, so it is not the metadata of a bag")
    return values


def _one_of(value: object, allowed: tuple[str, ...], key: str, path: Path) -> None:
    if value not in allowed:
        raise InputError(f"{path}: {key} is {value!r:.40}; it must be one of {', '.join(allowed)}")
