"""Residuals for plots, their statistics, and their file ``residuals.npz``.

facts                  bytes of a JSON object: format "mocobot-residuals", version 1, channels: list of
                       {name, kind, robot, unit}, and trials: list of {name, moving, rate_hz, quantities [names]}
time<k>                [s] of each row of trial k (from 0), shape (n,), float64
before<k>, after<k>    physical residuals without and with the named causes, shape (n, C)
sigma<k>               standard deviations of clean data, shape (n, C)
white_before<k>, white_after<k>   whitened residuals, shape (n, C)
quantity<k>_<j>        quantity j of trial k, shape (n,)
measured<k>            measured values, shape (n, C), and
cause<k>_<i>           contribution of named cause i (from 0), shape (n, C): of a robot of joints only, where the key
                       ``causes`` of the trial is the number of contributions
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
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
        kind: group in which it is reported, such as ``kinematic``.
        robot: number of its robot, from 1, or None.
        unit: physical unit of the residual before whitening.
    """

    name: str
    kind: str
    robot: int | None
    unit: str


@dataclass(frozen=True, eq=False)
class Trace:
    """Residuals of one trial without and with the named causes, in C channels.

    Attributes:
        name: name of the trial.
        time: time of each row [s], shape (n,).
        moving: number of leading rows that form a time series; the others are means over holds.
        rate_hz: sampling rate of the series.
        before, after: physical residuals, shape (n, C).
        sigma: standard deviations of clean data, shape (n, C).
        white_before, white_after: whitened residuals, shape (n, C), with unit variance for clean data.
        quantities: quantities on which a misfit may depend, shape (n,) each.
        measured: measured values of which the residuals are a part, shape (n, C); None: not known.
        causes: what each named cause contributes to them, shape (n, C) each; the remainder of before - after is within
            the tolerances.
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
    measured: Array | None = None
    causes: tuple[Array, ...] = ()


@dataclass(frozen=True)
class Group:
    """Channels in one plot, such as the three components of a force.

    Attributes:
        name: such as ``grasp 2 rotation``.
        unit: physical unit of the residual.
        columns: channel indices.
        components: names of the components, such as x, y, z.
    """

    name: str
    unit: str
    columns: tuple[int, ...]
    components: tuple[str, ...]


def group_units(traces: Sequence[Trace], grouped: Sequence[Group]) -> dict[str, Shown]:
    """Display unit of each unit in the groups, chosen by the largest rms of the simulation without causes."""
    return one_each(
        (group.unit, float(np.sqrt(np.mean(trace.before[:, k] ** 2))))
        for trace in traces for group in grouped for k in group.columns
    )  # fmt: skip


def groups(channels: Sequence[Channel]) -> list[Group]:
    """Group channels whose names differ only in the last word."""
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
    """Running rms over ``RUNNING_S`` from squared values, shape (n,) -> (n,)."""
    width = max(1, round(RUNNING_S * rate_hz))
    if not len(square):
        return np.zeros(0)
    return np.sqrt(np.maximum(uniform_filter1d(square, min(width, len(square)), mode="nearest"), 0.0))


def multiples(trace: Trace, white: Array, columns: Sequence[int]) -> Array:
    """Rms of some whitened channels over time, shape (n,): running for the time series, by row for holds."""
    square = np.mean(white[:, list(columns)] ** 2, axis=1)
    moving = running_rms(square[: trace.moving], trace.rate_hz)
    return np.concatenate([moving, np.sqrt(square[trace.moving :])])


def binned(traces: Sequence[Trace], attribute: str, columns: list[int], quantity: str) -> tuple[Array, Array]:
    """Mean of a quantity and rms of some channels in bins of equal counts, shape (b,) each."""
    x = np.concatenate([trace.quantities[quantity] for trace in traces])
    square = np.concatenate([np.mean(getattr(trace, attribute)[:, columns] ** 2, axis=1) for trace in traces])
    order = np.argsort(x, kind="stable")
    parts = [part for part in np.array_split(order, min(BINS, len(x))) if len(part)]
    return np.array([x[p].mean() for p in parts]), np.array([np.sqrt(square[p].mean()) for p in parts])


def spectrum(traces: Sequence[Trace], attribute: str, columns: list[int]) -> tuple[Array, Array] | None:
    """Frequencies [Hz] and square root of the power density over that of unit white noise, shape (f,) each.

    Uses only rows in motion, from sufficiently long trials with the rate of the first trial. Pauses between rows are
    ignored. None if there is no such trial.
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
    # The mean of each segment is removed, so drop frequency zero. Welch does not double the Nyquist frequency.
    if segment % 2 == 0:
        height[-1] *= np.sqrt(2.0)
    return np.asarray(np.fft.rfftfreq(segment, 1.0 / rate)[1:], dtype=float), height[1:]


NAME = "residuals.npz"
FORMAT, VERSION = "mocobot-residuals", 1
TABLES = ("before", "after", "sigma", "white_before", "white_after")


def save_traces(traces: Sequence[Trace], channels: Sequence[Channel], path: Path) -> None:
    """Write the residuals of all trials in float32.

    Args:
        traces: residuals of each trial, C channels each.
        channels: the channels.
        path: file to write.

    Raises:
        InputError: the file cannot be written.
    """
    facts = {
        "format": FORMAT,
        "version": VERSION,
        "channels": [asdict(channel) for channel in channels],
        "trials": [
            {"name": t.name, "moving": t.moving, "rate_hz": t.rate_hz, "quantities": list(t.quantities)}
            | ({} if t.measured is None else {"causes": len(t.causes)})
            for t in traces
        ],
    }
    arrays: dict[str, NDArray[Any]] = {}
    for k, trace in enumerate(traces):
        arrays[f"time{k}"] = np.asarray(trace.time, dtype=float)
        tables = {f"{name}{k}": getattr(trace, name) for name in TABLES}
        tables |= {f"quantity{k}_{j}": values for j, values in enumerate(trace.quantities.values())}
        if trace.measured is not None:
            tables |= {f"measured{k}": trace.measured}
            tables |= {f"cause{k}_{i}": values for i, values in enumerate(trace.causes)}
        arrays |= {name: np.asarray(values, dtype=np.float32) for name, values in tables.items()}
    with system_errors(path):
        write_archive(path, facts, arrays, compress=True)


def load_traces(path: Path) -> tuple[list[Trace], list[Channel]]:
    """Read a file of ``save_traces``.

    Raises:
        InputError: the file is missing or damaged.
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
    tables: dict[str, Any] = {name: _numbers(arrays, f"{name}{k}", (n, channels)) for name in TABLES}
    quantities = {
        str(name): _numbers(arrays, f"quantity{k}_{j}", (n,)) for j, name in enumerate(entry["quantities"])
    }
    found = Trace(str(entry["name"]), time, moving, float(rate_hz), quantities=quantities, **tables)
    count = entry.get("causes")
    if count is None:
        return found
    if type(count) is not int or count < 0:
        raise ValueError(f"causes is {count!r:.40} in trial {k + 1}; it must be a number of causes")
    measured, *causes = (
        _numbers(arrays, name, (n, channels))
        for name in (f"measured{k}", *(f"cause{k}_{i}" for i in range(count)))
    )
    return replace(found, measured=measured, causes=tuple(causes))


def _numbers(arrays: Mapping[str, NDArray[Any]], name: str, shape: tuple[int, ...]) -> Array:
    """An array of finite numbers; -1 in ``shape`` matches any length."""
    values = arrays[name]
    fits = values.ndim == len(shape) and all(
        want in (-1, has) for want, has in zip(shape, values.shape, strict=True)
    )
    if not fits or values.dtype.kind != "f" or not np.isfinite(values).all():
        raise ValueError(f"{name} must hold finite numbers")
    return values.astype(float)
