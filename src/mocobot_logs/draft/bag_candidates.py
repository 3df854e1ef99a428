"""What a bag has that may be a channel: joints of joint states, and numbers of other messages."""

from pathlib import Path

import numpy as np
from rosbags.interfaces import Nodetype

from estimator.errors import InputError
from mocobot_logs.bag.cdr import CdrReader, Selector
from mocobot_logs.bag.look import Look
from mocobot_logs.bag.storage.files import BagFiles
from mocobot_logs.bag.types import JOINT_STATE, MessageType, message_type
from mocobot_logs.draft.candidates import Candidate
from mocobot_logs.draft.reading import JOINED, read_name

_BYTES = 1 << 20
_DEEPEST, _MOST = 4, 64
_FLOATS = ("float32", "float64")


def of_bag(path: Path) -> tuple[list[Candidate], frozenset[str]]:
    """Candidates of a bag, and topics whose messages have no stamp of their own.

    Raises:
        InputError: it is damaged.
    """
    files = BagFiles(path)
    look = Look(str(path), files)
    found: list[Candidate] = []
    unstamped: set[str] = set()
    for name, topic in files.topics.items():
        try:
            kind = message_type(topic, str(path))
            selectors = _selectors(kind, look, name)
        except InputError:
            continue  # of a type that is not read, and so of no use
        messages = look.first(name, _BYTES) if selectors else None
        if messages is None:
            continue
        stamped = _is_stamped(kind)
        stamps, values = CdrReader(kind, selectors, stamped).read(messages)
        if not stamps.any():
            unstamped.add(name)
        for k, selector in enumerate(selectors):
            parts = [name, *([selector.joint] if selector.joint is not None else []), selector.field]
            keys = ("topic", "joint", "field") if selector.joint is not None else ("topic", "field")
            reading = read_name(JOINED.join(parts))
            given = values[np.isfinite(values[:, k]), k]
            if reading is not None and reading.group != "time" and len(given):
                found.append(Candidate(JOINED.join(parts), keys, reading, given))
    return found, frozenset(unstamped)


def _selectors(kind: MessageType, look: Look, topic: str) -> list[Selector]:
    if kind.name == JOINT_STATE:
        return [Selector(field, joint) for joint in look.joints(topic) for field in ("position", "effort")]
    return [Selector(path, None) for path in _numbers(kind, kind.name, 0)][:_MOST]


def _numbers(kind: MessageType, name: str, depth: int) -> list[str]:
    """Dotted paths of the floating numbers outside arrays."""
    paths = []
    for field, (node, detail) in kind.fields(name):
        if node == Nodetype.NAME and depth < _DEEPEST and field != "header":
            paths += [f"{field}.{rest}" for rest in _numbers(kind, str(detail), depth + 1)]
        elif node == Nodetype.BASE and detail[0] in _FLOATS:
            paths.append(field)
    return paths


def _is_stamped(kind: MessageType) -> bool:
    try:
        kind.require_stamp()
    except InputError:
        return False
    return True
