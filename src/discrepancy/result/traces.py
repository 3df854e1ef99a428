"""Residuals as a plot wants them, their statistics, and their file ``residuals.npz``.

facts                  bytes of a JSON object: format "mocobot-residuals", version 1, channels: list of
                       {name, kind, robot, unit}, and trials: list of {name, moving, rate_hz, quantities [names]}
time<k>                [s] of every row of trial k (from 0), shape (n,), float64
before<k>, after<k>    physical residuals without and with the named causes, shape (n, C)
sigma<k>               standard deviations of clean data, shape (n, C)
white_before<k>, white_after<k>   whitened residuals, shape (n, C)
quantity<k>_<j>        quantity j of trial k, shape (n,)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import welch

from discrepancy.numbers import Shown, one_each
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import read_archive, system_errors, words, write_archive


@dataclass(frozen=True)
class Channel:
    """One residual channel.

    Attributes:
        name: such as ``grasp 2 rotation x``.
        kind: group that is reported together, such as ``kinematic``.
        robot: whose channel it is, counted from 1, or None.
        unit: physical unit of the unwhitened residual.
    """

    name: str
    kind: str
    robot: int | None
    unit: str


@dataclass(frozen=True, eq=False)
class Trace:
    """One trial's residual without and with the named causes; C channels.

    Attributes:
        name: the trial.
        time: of every row [s], shape (n,).
        moving: number of leading rows that are a series; the others are means of holds.
        rate_hz: of the series.
        before, after: physical residuals, shape (n, C).
        sigma: standard deviations of clean data, shape (n, C).
        white_before, white_after: whitened residuals, shape (n, C); unit variance if clean.
        quantities: what a misfit may depend on, shape (n,) each.
    """

    name: str
    time: Array
    moving: int
    rate_hz: float
    before: Array
    after: Array
    sigma: Array
    white_before: Array
    white_after: Array
    quantities: dict[str, Array]


@dataclass(frozen=True)
class Group:
    """Channels that are shown together, such as the three components of a force.

    Attributes:
        name: such as ``grasp 2 rotation``.
        unit: of the physical residual.
        columns: their indices.
        components: what tells them apart, such as x, y, z.
    """

    name: str
    unit: str
    columns: tuple[int, ...]
    components: tuple[str, ...]


def group_units(traces: Sequence[Trace], grouped: Sequence[Group]) -> dict[str, Shown]:
    """For every unit of some channels the one in which all of them are shown, by the largest rms as simulated."""
    return one_each(
        (group.unit, float(np.sqrt(np.mean(trace.before[:, k] ** 2))))
        for trace in traces for group in grouped for k in group.columns
    )  # fmt: skip


def groups(channels: Sequence[Channel]) -> list[Group]:
    """Channels whose names differ in the last word only."""
    found: dict[str, list[int]] = {}
    for k, channel in enumerate(channels):
        stem, _, last = channel.name.rpartition(" ")
        found.setdefault(stem or last, []).append(k)
    return [
        Group(name, channels[at[0]].unit, tuple(at), tuple(channels[k].name.split()[-1] for k in at))
        for name, at in found.items()
    ]


RUNNING_S = 1.0
BINS = 12
SEGMENT_S, LEAST_ROWS = 10.0, 16


def running_rms(square: Array, rate_hz: float) -> Array:
    """Root of the mean over ``RUNNING_S`` of a squared series, shape (n,) -> (n,)."""
    width = max(1, round(RUNNING_S * rate_hz))
    if not len(square):
        return np.zeros(0)
    return np.sqrt(np.maximum(uniform_filter1d(square, min(width, len(square)), mode="nearest"), 0.0))


def multiples(trace: Trace, white: Array, columns: Sequence[int]) -> Array:
    """Rms of some whitened channels over time in multiples of clean data, shape (n,): running, but for holds."""
    square = np.mean(white[:, list(columns)] ** 2, axis=1)
    moving = running_rms(square[: trace.moving], trace.rate_hz)
    return np.concatenate([moving, np.sqrt(square[trace.moving :])])


def binned(traces: Sequence[Trace], attribute: str, columns: list[int], quantity: str) -> tuple[Array, Array]:
    """Mean of a quantity and rms of some channels in bins of equal counts, shapes (b,)."""
    x = np.concatenate([trace.quantities[quantity] for trace in traces])
    square = np.concatenate([np.mean(getattr(trace, attribute)[:, columns] ** 2, axis=1) for trace in traces])
    order = np.argsort(x, kind="stable")
    parts = [part for part in np.array_split(order, min(BINS, len(x))) if len(part)]
    return np.array([x[p].mean() for p in parts]), np.array([np.sqrt(square[p].mean()) for p in parts])


def spectrum(traces: Sequence[Trace], attribute: str, columns: list[int]) -> tuple[Array, Array] | None:
    """Frequencies [Hz] and root of the power density over that of white noise of unit variance, shapes (f,).

    Only rows in motion count, and only trials of the first one's rate that are long enough; pauses between them are
    passed over. None where there is no such trial.
    """
    rate = traces[0].rate_hz
    used = [trace for trace in traces if trace.moving >= LEAST_ROWS and trace.rate_hz == rate]
    if not used:
        return None
    segment = min(round(SEGMENT_S * rate), min(trace.moving for trace in used))
    total = np.zeros(segment // 2 + 1)
    for trace in used:
        series = getattr(trace, attribute)[: trace.moving, columns]
        _, density = welch(series, rate, nperseg=segment, axis=0, detrend="constant")
        total += trace.moving * density.mean(axis=1) * rate / 2.0
    height = np.sqrt(total / sum(trace.moving for trace in used))
    # The mean is taken out of every segment, so frequency 0 says nothing; the last one is not doubled.
    if segment % 2 == 0:
        height[-1] *= np.sqrt(2.0)
    return np.asarray(np.fft.rfftfreq(segment, 1.0 / rate)[1:], dtype=float), height[1:]


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
