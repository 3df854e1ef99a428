"""Residuals of a diagnosis in one file, ``residuals.npz``: compressed float32, no pickles.

facts                  bytes of a JSON object: format "mocobot-residuals", version 1, channels: list of
                       {name, kind, robot, unit}, and trials: list of {name, moving, rate_hz, quantities [names]}
time<k>                [s] of every row of trial k (from 0), shape (n,), float64
before<k>, after<k>    physical residuals without and with the named causes, shape (n, C)
sigma<k>               standard deviations of clean data, shape (n, C)
white_before<k>, white_after<k>   whitened residuals, shape (n, C)
quantity<k>_<j>        quantity j of trial k, shape (n,)
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discrepancy.channel import Channel
from discrepancy.result.traces import Trace
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import read_archive, system_errors, words, write_archive

NAME = "residuals.npz"
FORMAT, VERSION = "mocobot-residuals", 1
TABLES = ("before", "after", "sigma", "white_before", "white_after")


def save_traces(traces: Sequence[Trace], channels: Sequence[Channel], path: Path) -> None:
    """Write the residuals of all trials; what is beyond float32 is lost.

    Args:
        traces: of every trial, C channels each.
        channels: what they are.
        path: file to write.

    Raises:
        InputError: it cannot be written.
    """
    facts = {
        "format": FORMAT,
        "version": VERSION,
        "channels": [asdict(channel) for channel in channels],
        "trials": [
            {"name": t.name, "moving": t.moving, "rate_hz": t.rate_hz, "quantities": list(t.quantities)}
            for t in traces
        ],
    }
    arrays: dict[str, NDArray[Any]] = {}
    for k, trace in enumerate(traces):
        arrays[f"time{k}"] = np.asarray(trace.time, dtype=float)
        tables = {f"{name}{k}": getattr(trace, name) for name in TABLES}
        tables |= {f"quantity{k}_{j}": values for j, values in enumerate(trace.quantities.values())}
        arrays |= {name: np.asarray(values, dtype=np.float32) for name, values in tables.items()}
    with system_errors(path):
        write_archive(path, facts, arrays, compress=True)


def load_traces(path: Path) -> tuple[list[Trace], list[Channel]]:
    """Read what ``save_traces`` wrote.

    Raises:
        InputError: there is no such file, or it is not whole.
    """
    facts, arrays = read_archive(path, "the residuals of a diagnosis")
    try:
        if facts["format"] != FORMAT or facts["version"] != VERSION:
            raise ValueError(f"it must have format {FORMAT!r} and version {VERSION}")
        channels = [_channel(entry) for entry in facts["channels"]]
        traces = [_trace(entry, k, len(channels), arrays) for k, entry in enumerate(facts["trials"])]
    except KeyError as error:
        raise InputError(f"{path}: not the residuals of a diagnosis; {error.args[0]!r} is missing") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: not the residuals of a diagnosis ({words(error)})") from error
    return traces, channels


def _channel(entry: Mapping[str, Any]) -> Channel:
    robot = entry["robot"]
    if robot is not None and type(robot) is not int:
        raise ValueError(f"a channel's robot is {robot!r:.40}")
    return Channel(str(entry["name"]), str(entry["kind"]), robot, str(entry["unit"]))


def _trace(entry: Mapping[str, Any], k: int, channels: int, arrays: Mapping[str, NDArray[Any]]) -> Trace:
    time = _numbers(arrays, f"time{k}", (-1,))
    n, moving, rate_hz = len(time), entry["moving"], entry["rate_hz"]
    if type(moving) is not int or not 0 <= moving <= n:
        raise ValueError(f"moving is {moving!r:.40} in trial {k + 1}; it must be a number of its {n} rows")
    if not isinstance(rate_hz, int | float) or not 0 < rate_hz < np.inf:
        raise ValueError(f"rate_hz is {rate_hz!r:.40} in trial {k + 1}; it must be positive")
    tables = {name: _numbers(arrays, f"{name}{k}", (n, channels)) for name in TABLES}
    quantities = {
        str(name): _numbers(arrays, f"quantity{k}_{j}", (n,)) for j, name in enumerate(entry["quantities"])
    }
    return Trace(str(entry["name"]), time, moving, float(rate_hz), quantities=quantities, **tables)


def _numbers(arrays: Mapping[str, NDArray[Any]], name: str, shape: tuple[int, ...]) -> Array:
    """An array of finite numbers; -1 stands for any length."""
    values = arrays[name]
    fits = values.ndim == len(shape) and all(
        want in (-1, has) for want, has in zip(shape, values.shape, strict=True)
    )
    if not fits or values.dtype.kind != "f" or not np.isfinite(values).all():
        raise ValueError(f"{name} must hold finite numbers")
    return values.astype(float)
