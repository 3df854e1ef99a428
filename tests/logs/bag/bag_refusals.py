"""How bags are refused."""

import time
import tracemalloc

import pytest

from bags import Team
from estimator.errors import InputError
from mocobot_logs.bag.read import open_bag
from mocobot_logs.log import collect

TEAM = Team.draw(rows=20)


def refuses(path, match, log_map=None):
    """An InputError that names the file, in time and in memory."""
    begin = time.perf_counter()
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=match) as caught:
            collect(open_bag(path, log_map))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    message = str(caught.value)
    assert message.startswith(str(path)[:70]) or message.startswith(repr(str(path))[:70])
    assert message.isprintable()
    assert peak < 700e6
    assert time.perf_counter() - begin < 10.0
