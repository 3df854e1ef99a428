"""Worker processes, which must not outlive the process that they work for."""

import errno
import os
import re
import shutil
import socket
import tempfile
import threading
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

_HOST = re.sub(r"\W", "", socket.gethostname())[:40]
_NAME = re.compile(rf"\.mocobot-{_HOST}-(\d{{1,9}})-[0-9a-f]{{8}}\.tmp")
_swept: set[Path] = set()


def scratch_name(folder: Path) -> Path:
    """A name in a folder that nothing has and that tells whose it is; scraps of dead processes there are removed."""
    if folder not in _swept:
        _swept.add(folder)
        with suppress(OSError):
            for path in folder.iterdir():
                found = _NAME.fullmatch(path.name)
                if found and not _is_alive(int(found[1])) and not path.with_suffix(".old").exists():
                    _remove(path)
    return folder / f".mocobot-{_HOST}-{os.getpid()}-{uuid.uuid4().hex[:8]}.tmp"


@contextmanager
def scratch_folder(where: Path | None = None) -> Iterator[Path]:
    """A folder that lasts as long as the block.

    Args:
        where: the folder to make it in; that of the system for temporary files if None.
    """
    path = scratch_name(Path(tempfile.gettempdir()) if where is None else where)
    path.mkdir(mode=0o700)
    try:
        yield path
    finally:
        _remove(path)


def _remove(path: Path) -> None:
    shutil.rmtree(path, ignore_errors=True)  # neither files nor links
    with suppress(OSError):
        path.unlink()


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except OSError as error:
        return error.errno != errno.ESRCH  # another user's
    return True


EVERY_S = 0.5


def end_with(parent: int) -> None:
    """End this process soon after its parent has ended, however that was killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(EVERY_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def ends_with_this() -> Mapping[str, Any]:
    """What makes the workers of ``joblib.Parallel`` end with this process."""
    return {"initializer": end_with, "initargs": (os.getpid(),)}
