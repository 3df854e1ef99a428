"""Open the files of a bag: a single one, or a folder whose ``metadata.yaml`` names them (rosbag2).

Only file names and compression are taken from ``metadata.yaml``. Its topics, times and counts are redundant, and
often wrong after an interrupted or repaired recording.
"""

import re
import shutil
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
from mocobot_logs.bag.storage import (
    BLOCK_BYTES,
    McapBag,
    Messages,
    SqliteBag,
    UnpackError,
    joined,
    merged,
    unpack_file,
    unpack_message,
)
from mocobot_logs.formats import (
    BAG_METADATA,
    MCAP,
    ROS1,
    SQLITE,
    detail_of,
    has_bag_suffix,
    read_small,
    readable,
)

VERSIONS = range(1, 10)  # supported versions of ``metadata.yaml``, all that rosbag2 has written so far
STORAGES = {"mcap": MCAP, "sqlite3": SQLITE}
_ZSTD = b"\x28\xb5\x2f\xfd"
_METADATA_BYTES = 1 << 20
_DEEPEST = 64
_KEY = "rosbag2_bagfile_information"


class BagFiles:
    """All files of a bag, opened.

    Attributes:
        topics: topics by name.
        size: bytes to read.
    """

    def __init__(self, path: Path) -> None:
        paths, self._are_packed = _files_of(path)
        self._scratch: Path | None = None
        stored = sum(file.stat().st_size for file in paths if file.is_file())
        self._unpacked = Unpacked(str(path), stored)  # per pass over all files
        self._on_disk = 0  # part of it: unpacked copies on disk
        self._storages = [self._opened(file, number) for number, file in enumerate(paths)]
        self.topics = merged((t for storage in self._storages for t in storage.topics.values()), str(path))
        self.size = sum(storage.size for storage in self._storages)

    def has_messages(self, topic: str) -> bool:
        """Return whether a topic has messages, or may have some if the files do not say."""
        return any(storage.has_messages(topic) for storage in self._storages)

    def blocks(
        self, topics: Collection[str], advance: Callable[[int], object], block_bytes: int = BLOCK_BYTES
    ) -> Iterator[dict[str, Messages]]:
        """Yield messages of some topics in the order of the files, about ``block_bytes`` at a time.

        Topics without messages in a block are left out. ``advance`` is called with the bytes read since the last call.
        """
        self._unpacked.size = self._on_disk
        for storage in self._storages:
            for block in storage.blocks(topics, advance, block_bytes):
                if self._are_packed:
                    yield from self._messages(block, storage.name)
                else:
                    yield block

    def _messages(self, block: dict[str, Messages], name: str) -> Iterator[dict[str, Messages]]:
        """Yield individually compressed messages, about ``BLOCK_BYTES`` at a time, topics in step."""
        orders = {topic: np.maximum.accumulate(m.log_ns).tolist() for topic, m in block.items()}
        held, found = 0, {topic: ([], []) for topic in block}
        for _, topic, k in sorted((at, t, k) for t, order in orders.items() for k, at in enumerate(order)):
            try:
                payload = unpack_message(block[topic][k])
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

    def _opened(self, path: Path, number: int) -> McapBag | SqliteBag:
        name, head = str(path), _head(path)
        if head.startswith(_ZSTD):
            packed, path = path, self._scratch_folder(path) / str(number)
            before = self._unpacked.size
            unpack_file(packed, path, tuple(STORAGES.values()), self._unpacked)
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

    def _scratch_folder(self, wanted_by: Path) -> Path:
        """Return a temporary folder that is deleted with this object."""
        if self._scratch is None:
            try:
                self._scratch = Path(mkdtemp(prefix="mocobot-bag-"))
            except OSError as error:
                raise InputError(
                    f"{wanted_by}: cannot be unpacked, there is no temporary folder ({error})"
                ) from error
            weakref.finalize(self, shutil.rmtree, self._scratch, ignore_errors=True)
        return self._scratch


def _files_of(path: Path) -> tuple[list[Path], bool]:
    """Return the files, and whether messages are compressed individually."""
    try:
        exists, is_folder = path.exists(), path.is_dir()
    except (OSError, ValueError) as error:  # a name too long for the system, or with a NUL
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
    """Return the names of the files, and whether messages are compressed individually."""
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
    mode = str(values.get("compression_mode") or "none").lower()
    for key, value, allowed in (
        ("storage_identifier", values.get("storage_identifier"), tuple(STORAGES)),
        ("compression_mode", mode, ("none", "file", "message")),
        ("compression_format", "zstd" if mode == "none" else values.get("compression_format"), ("zstd",)),
    ):
        if value not in allowed:
            raise InputError(f"{path}: {key} is {value!r:.40}; it must be one of {', '.join(allowed)}")
    files = values.get("relative_file_paths")
    if not isinstance(files, list) or not files or not all(isinstance(name, str) for name in files):
        raise InputError(f"{path}: relative_file_paths is {files!r:.60}; it must list the bag's files")
    names = [PurePosixPath(name).name for name in files]  # the oldest versions prepend the bag's folder
    if "" in names or ".." in names or len(set(names)) < len(names) or any("\0" in name for name in names):
        raise InputError(
            f"{path}: relative_file_paths is {files!r:.60}; each must be another file in the folder"
        )
    return names, mode == "message"


def _load(content: bytes, path: Path) -> dict[str, Any]:
    text = content.decode("utf-8", errors="replace")
    depth = accumulate((1 if mark in "[{" else -1 for mark in re.findall(r"[\[\]{}]", text)), initial=0)
    if re.search(r"<<\s*:|(?:^|\s)!\S|^\s*%", text, re.MULTILINE) or max(depth) > _DEEPEST:
        # Merged keys grow without bound, tags create objects, and deep nesting takes minutes; recorders write none of
        # them.
        raise InputError(f"{path}: holds YAML beyond plain values, which no bag's metadata does")
    try:
        if "&" in text and any(isinstance(t, AnchorToken) for t in YAML(typ="safe", pure=True).scan(text)):
            raise ValueError("it has anchors, which no bag's metadata has")
        values = plain(YAML(typ="safe", pure=True).load(text))
    except Exception as error:  # for damaged text the parser raises many types, not all of them its own
        raise InputError(f"{path}: not readable YAML ({detail_of(error)})") from error
    return values if isinstance(values, dict) else {}
