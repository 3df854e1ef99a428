"""Worker processes, which must not outlive the process that they work for."""

import os
import threading
import time
from collections.abc import Mapping
from typing import Any

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
