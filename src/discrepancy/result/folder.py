"""Residuals and pictures of a diagnosis, written into a folder."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from discrepancy.channel import Channel
from discrepancy.result.traces import Trace
from discrepancy.result.traces_file import NAME as RESIDUALS
from discrepancy.result.traces_file import save_traces
from estimator.extras import draws_plots

REPORT = "report.txt"


def draw(
    values: Mapping[str, Any], traces: Sequence[Trace], channels: Sequence[Channel], unit: Callable[[str], str],
    folder: Path, *, pictures: bool = True,
) -> None:  # fmt: skip
    """Write residuals and, where plots can be drawn, pictures of a diagnosis.

    Args:
        values: the diagnosis, as in the JSON.
        traces: residuals of every trial.
        channels: what they are of.
        unit: of a quantity that a misfit may depend on.
        folder: an existing one.
        pictures: whether pictures are drawn, too.

    Raises:
        InputError: something cannot be written.
    """
    save_traces(traces, channels, folder / RESIDUALS)
    if pictures and draws_plots():
        from discrepancy.result.pictures.plots import save_plots

        save_plots(values, traces, channels, unit, folder)
