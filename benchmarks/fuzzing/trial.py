"""One damaged log: read, refused, or a fault of the reader."""

from __future__ import annotations

import resource
import signal
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from estimator.errors import InputError
from fuzzing.damage import damaged
from fuzzing.of_commands import KINDS
from mocobot_logs.log import collect
from mocobot_logs.maps import read_map
from mocobot_logs.open_log import open_log

LONGEST_S = 20
MOST_BYTES = 1 << 30
"""A damaged log of some hundred kilobytes must not make its reader take more than this."""


@dataclass(frozen=True)
class Outcome:
    """What became of one damaged log.

    Attributes:
        kind, seed: which log, and which damage.
        result: read, refused, or one of the faults: ``raised`` (not an InputError), ``untidy`` (a refusal that is no
            sentence that names the log), ``hung``, ``swollen`` (in memory).
        detail: what was said, or the traceback.
        seconds: wall time.
    """

    kind: str
    seed: int
    result: Literal["read", "refused", "raised", "untidy", "hung", "swollen", "died"]
    detail: str
    seconds: float = 0.0

    @property
    def is_fault(self) -> bool:
        """Whether the reader did what it must not."""
        return self.result not in ("read", "refused")


def check_original(kind: str, log: Path) -> None:
    """Check that a log is read as long as it is not damaged.

    Raises:
        RuntimeError: it is not.
    """
    if (done := _read(kind, log))[0] != "read":
        raise RuntimeError(f"a good log of kind {kind!r} is {done[0]}: {done[1]}")


def try_damaged(kind: str, log: Path, file: Path, content: bytes, seed: int) -> Outcome:
    """Damage a file of a log, read the log, and put the file back.

    Args:
        kind: one of ``originals.FORMATS`` or ``of_commands.KINDS``.
        log: the log as a user would name it.
        file: the file in it to damage.
        content: what the file holds when it is good.
        seed: of the damage.
    """
    file.write_bytes(damaged(content, np.random.default_rng(seed)))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    try:
        with _alarm(), warnings.catch_warnings():
            warnings.simplefilter("error")
            result, detail = _read(kind, log)
    except TimeoutError:
        result, detail = "hung", f"after {LONGEST_S} s"
    finally:
        file.write_bytes(content)
    seconds = time.perf_counter() - start
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    if grown > MOST_BYTES:
        result, detail = "swollen", f"by {grown / 2**20:.0f} MiB ({detail})"
    return Outcome(kind, seed, result, detail, seconds)


def _read(kind: str, log: Path) -> tuple[Literal["read", "refused", "raised", "untidy"], str]:
    try:
        if kind in KINDS:
            KINDS[kind].read(log)
        elif kind == "map":
            read_map(log)
        else:
            collect(open_log(log))
    except InputError as error:
        message = str(error)
        tidy = str(log) in message and message.isprintable() and len(message) < 2000
        return ("refused" if tidy else "untidy"), message
    except TimeoutError:
        raise
    except BaseException:  # whatever it is, the user would have seen it
        return "raised", traceback.format_exc()
    return "read", ""


@contextmanager
def _alarm() -> Iterator[None]:
    def stop(*_: object) -> None:
        raise TimeoutError

    old = signal.signal(signal.SIGALRM, stop)
    signal.alarm(LONGEST_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, old)
