"""Laws that no catalogue lists: the error as it was located, and the formula through it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from discrepancy.numbers import fitting
from discrepancy.result.pictures.plots_against import AFTER, BEFORE, titled

Values = Mapping[str, Any]


def law_figure(values: Values) -> Figure | None:
    """Every stated law that was located: over time in the first trial, and against its signal in all; None without."""
    laws = [cause for cause in values["causes"] if cause.get("law") and cause["law"]["traces"]]
    if not laws:
        return None
    figure = Figure(figsize=(12.0, 3.6 * len(laws) + 0.6), layout="constrained")
    rows = figure.subplots(len(laws), 2, squeeze=False)
    for cause, (over_time, against) in zip(laws, rows, strict=True):
        _drawn(cause, over_time, against)
    over_time = rows[0][0]
    handles = [
        over_time.errorbar([], [], [], fmt=".", color=BEFORE, elinewidth=0.8),
        over_time.plot([], [], color=AFTER)[0],
    ]
    words = ["error that explains most there, found without a formula (1 standard error)", "the formula"]
    return titled(figure, "What nobody listed", handles, words, 2)


def strongest(traces: Sequence[Values]) -> int:
    """The component of which a law says most."""
    sizes = [
        np.std(np.concatenate([trace["law"][k] for trace in traces])) for k in range(len(traces[0]["law"]))
    ]
    return int(np.argmax(sizes))


def _drawn(cause: Values, over_time: Axes, against: Axes) -> None:
    law, traces = cause["law"], cause["law"]["traces"]
    k = strongest(traces)
    largest = max(np.abs(np.concatenate([trace["law"][k] for trace in traces])).max(), 1e-300)
    unit, scale = fitting(law["unit"], float(largest))
    label = f"{law['targets'][k].replace('_', ' ')} [{unit}]"
    first = traces[0]
    _points(over_time, first["time_s"], first, k, scale)
    over_time.plot(first["time_s"], scale * np.array(first["law"][k]), color=AFTER)
    over_time.set_xlabel("time in the first trial [s]")
    over_time.set_ylabel(label)
    over_time.set_title(cause["name"], loc="left", fontsize=9, wrap=True)
    for trace in traces:
        _points(against, trace["signal"], trace, k, scale)
    signal, value = (
        np.concatenate([trace[key] if key == "signal" else trace["law"][k] for trace in traces])
        for key in ("signal", "law")
    )
    order = np.argsort(signal)
    alone = law["times"] is None and law["function"] not in ("play", "lag", "second_order")
    against.plot(signal[order], scale * value[order], "-" if alone else ".", color=AFTER, markersize=3)
    against.set_xlabel(law["of"].replace("_", " "))
    against.set_ylabel(label)
    for axis in (over_time, against):
        axis.grid(alpha=0.25)
        reach = 1.6 * scale * largest
        axis.set_ylim(
            -reach if np.min(value) < 0 else -0.4 * reach, reach if np.max(value) > 0 else 0.4 * reach
        )


def _points(axis: Axes, x: Sequence[float], trace: Values, k: int, scale: float) -> None:
    error, se = scale * np.array(trace["error"][k]), scale * np.array(trace["se"][k])
    axis.errorbar(x, error, se, fmt=".", color=BEFORE, elinewidth=0.6, markersize=3, alpha=0.6)
