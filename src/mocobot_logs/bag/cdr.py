"""Numbers out of CDR messages, many at a time.

Where a number lies in a CDR message depends on the lengths of the strings and arrays before it. Robots send messages
whose lengths never change, so one message is walked field by field to find where its numbers are (its layout), and all
messages with the same lengths, and the same joint names, are read at those places at once. A message with other lengths
gets a layout of its own.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.bag.messages import Messages, printable
from mocobot_logs.bag.types import MessageType
from mocobot_logs.bag.walk import CdrError, Walk
from mocobot_logs.log import Stamps

_NEW_LAYOUTS = 4
"""So many new layouts of one size are looked for among all messages of a block; beyond them, one by one."""
_KEPT_LAYOUTS = 64
_GROUP = 8192
"""So many messages are read at once."""


@dataclass(frozen=True)
class Selector:
    """One number of a message.

    Attributes:
        field: dotted path such as ``point.x`` or ``data[2]``; with a joint, the name of an array of numbers.
        joint: name of the joint whose number it is, or None.
    """

    field: str
    joint: str | None = None


class Layout:
    """Where the wanted numbers lie in messages of one size.

    Attributes:
        joints: names of the joints, if joints are wanted.
        lacking: for each selector, why messages of this layout have no such number; None where they do.
    """

    def __init__(self, message: bytes, kind: MessageType, selectors: Sequence[Selector], stamp: bool) -> None:
        """Find them in one message.

        Raises:
            CdrError: the message is not what its type says.
        """
        names = any(selector.joint is not None for selector in selectors)
        arrays = {re.sub(r"\[\d+\]$", "", selector.field) for selector in selectors}
        time = {"header.stamp.sec", "header.stamp.nanosec"} if stamp else set()
        walk = Walk(message, kind, arrays | time, names)
        self.joints = walk.joints
        self._at = np.array(walk.fixed, np.intp)
        self._fixed = np.frombuffer(message, np.uint8)[self._at]
        places: dict[str, tuple[str, int]] = {}
        for path in time:
            leaf = walk.leaves[path]
            places[path] = walk.order + leaf.kind, leaf.offset
        self.lacking: list[str | None] = []
        for number, selector in enumerate(selectors):
            place = self._place(selector, walk)
            self.lacking.append(place if isinstance(place, str) else None)
            if not isinstance(place, str):
                places[str(number)] = place
        self._record = np.dtype(
            {
                "names": list(places),
                "formats": [kind for kind, _ in places.values()],
                "offsets": [offset for _, offset in places.values()],
                "itemsize": len(message),
            }
        )

    @staticmethod
    def _place(selector: Selector, walk: Walk) -> tuple[str, int] | str:
        found = re.fullmatch(r"(.*)\[(\d+)\]", selector.field)
        path, index = (found[1], int(found[2])) if found else (selector.field, 0)
        if selector.joint is not None:
            if (times := walk.joints.count(selector.joint)) != 1:
                return "is missing" if not times else "is named more than once"
            index = walk.joints.index(selector.joint)
        leaf = walk.leaves.get(path)
        if leaf is None or index >= leaf.count:
            return f"has no {selector.field}" if selector.joint is not None else "is missing"
        return walk.order + leaf.kind, leaf.offset + index * np.dtype(leaf.kind).itemsize

    def fits(self, rows: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which messages, one per row, have this layout."""
        return (rows[:, self._at] == self._fixed).all(axis=1)

    def read(self, rows: NDArray[np.uint8]) -> tuple[Stamps, Array]:
        """Stamps [ns] (0 without a header) and the numbers, NaN where lacking, of messages that have this layout.

        Raises:
            CdrError: a stamp has a whole second or more in its nanoseconds.
        """
        table = np.ascontiguousarray(rows).view(self._record)[:, 0]
        stamps = np.zeros(len(rows), np.int64)
        if "header.stamp.sec" in (self._record.names or ()):
            nanoseconds = table["header.stamp.nanosec"].astype(np.int64)
            if (bad := nanoseconds >= 1_000_000_000).any():
                row = int(np.argmax(bad))
                raise CdrError(
                    f"the nanoseconds of its stamp are {nanoseconds[row]}; they must be below 1e9", row
                )
            stamps = table["header.stamp.sec"].astype(np.int64) * 1_000_000_000 + nanoseconds
        values = np.full((len(rows), len(self.lacking)), np.nan)
        for number, lacking in enumerate(self.lacking):
            if lacking is None:
                values[:, number] = table[str(number)]
        return stamps, values


class CdrReader:
    """Reads the same numbers from all messages of one topic.

    Attributes:
        joints: names of all joints seen, in order.
        lacking: for each selector, why no message so far had such a number; None where some did.
        count: messages read.
    """

    def __init__(self, kind: MessageType, selectors: Sequence[Selector], stamp: bool) -> None:
        """Prepare.

        Args:
            kind: type of the messages.
            selectors: the numbers.
            stamp: whether to read ``header.stamp``.
        """
        self._kind, self._selectors, self._stamp = kind, tuple(selectors), stamp
        self._layouts: dict[int, list[Layout]] = {}
        self._kept = 0
        self.joints: dict[str, None] = {}
        self.lacking: list[str | None] = ["is missing"] * len(self._selectors)
        self.count = 0

    def read(self, messages: Messages) -> tuple[Stamps, Array]:
        """Stamps [ns] (0 if not wanted), shape (q,), and numbers, NaN where a message lacks one, shape (q, S).

        Raises:
            InputError: a message is not what its type says.
        """
        stamps = np.zeros(len(messages), np.int64)
        values = np.empty((len(messages), len(self._selectors)))
        memory = np.frombuffer(messages.block, np.uint8)
        for begin in range(0, len(messages), _GROUP):
            part = messages.size[begin : begin + _GROUP]
            order = np.argsort(part, kind="stable")
            sizes, begins = np.unique(part[order], return_index=True)
            for size, index in zip(sizes, np.split(order + begin, begins[1:]), strict=True):
                if not size:
                    raise self._error(int(index[0]), CdrError("it is empty"))
                rows = np.lib.stride_tricks.sliding_window_view(memory, int(size))[messages.start[index]]
                self._read_rows(rows, index, stamps, values)
        self.count += len(messages)
        return stamps, values

    def _read_rows(
        self, rows: NDArray[np.uint8], index: NDArray[np.intp], stamps: Stamps, values: Array
    ) -> None:
        """Read messages of one size: with the known layouts one after the other, then with new ones."""
        known = self._layouts.setdefault(rows.shape[1], [])
        tried = 0
        while len(rows):
            is_new = tried >= len(known)
            layout = self._learn(rows[0], int(index[0]), known) if is_new else known[tried]
            tried += 1
            alone = tried > len(known) + _NEW_LAYOUTS
            fits = np.arange(len(rows)) == 0 if alone else layout.fits(rows)
            if not fits.any():
                continue
            every = bool(fits.all())
            here, at = (rows, index) if every else (rows[fits], index[fits])
            try:
                stamps[at], values[at] = layout.read(here)
            except CdrError as error:
                raise self._error(int(at[error.row]), error) from error
            for number, lacking in enumerate(layout.lacking):
                if self.lacking[number] is not None:
                    self.lacking[number] = lacking
            rows, index = (rows[:0], index[:0]) if every else (rows[~fits], index[~fits])

    def _learn(self, row: NDArray[np.uint8], index: int, known: list[Layout]) -> Layout:
        try:
            layout = Layout(row.tobytes(), self._kind, self._selectors, self._stamp)
        except CdrError as error:
            raise self._error(index, error) from error
        for joint in layout.joints:
            if len(self.joints) < 1000:
                self.joints[joint] = None
        if self._kept < _KEPT_LAYOUTS:
            self._kept += 1
            known.append(layout)
        return layout

    def _error(self, index: int, error: CdrError) -> InputError:
        kind = printable(self._kind.name)
        return InputError(
            f"{self._kind.where}: message {self.count + index} is not a readable {kind}: {error}"
        )
