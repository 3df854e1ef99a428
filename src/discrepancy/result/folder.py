"""A diagnosis as values, text and result folder: the common part for teams and single robots."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Generic, TypeVar

from discrepancy.evidence.findings import Verdict
from discrepancy.result.read import NAME
from discrepancy.result.report import format_verdict
from discrepancy.result.traces import NAME as RESIDUALS
from discrepancy.result.traces import Channel, Trace, save_traces
from estimator.errors import InputError
from estimator.extras import draws_plots
from estimator.files import write_json, write_text

REPORT = "report.txt"
V = TypeVar("V", bound=Verdict)


class Diagnosed(ABC, Generic[V]):
    """A verdict with its text, plots and files."""

    verdict: V

    @cached_property
    @abstractmethod
    def values(self) -> dict[str, Any]:
        """Plain JSON values; see ``discrepancy.result.json`` for the keys."""

    @property
    @abstractmethod
    def channels(self) -> Sequence[Channel]:
        """The residual channels."""

    @abstractmethod
    def unit(self, name: str) -> str:
        """Unit of a quantity on which a misfit may depend."""

    @abstractmethod
    def models(self) -> Iterator[tuple[str, str, Callable[[Path], None]]]:
        """Models to write: folder name, description, and a function that writes the model."""

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON values with units in the keys; see ``discrepancy.result.json``."""
        return self.values

    def __str__(self) -> str:
        """Report of at most five sentences and a table."""
        return format_verdict(self.values)

    def verbose_text(self) -> str:
        """Report with all details."""
        return format_verdict(self.values, verbose=True)

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> None:
        """Write models, residuals, plots, JSON and report into an existing folder.

        Args:
            folder: the folder.
            pictures: whether to draw plots.
            more: further keys of the JSON.

        Raises:
            InputError: a file cannot be written.
        """
        values = self.values
        for name, what, write in self.models():
            try:
                write(folder / name)
            except InputError as error:  # no effect has such values, such as a negative friction
                note = f"There is no {what}: {error}."
                values["notes"] = [*(n for n in values["notes"] if n != note), note]
        draw(values, self.verdict.traces(), self.channels, self.unit, folder, pictures=pictures)
        write_json(folder / NAME, values | more)
        write_text(folder / REPORT, f"{self.verbose_text()}\n")


def draw(
    values: Mapping[str, Any], traces: Sequence[Trace], channels: Sequence[Channel], unit: Callable[[str], str],
    folder: Path, *, pictures: bool = True,
) -> None:  # fmt: skip
    """Write the residuals of a diagnosis, and its plots if plotting is available; arguments as in ``save_plots``.

    Raises:
        InputError: a file cannot be written.
    """
    save_traces(traces, channels, folder / RESIDUALS)
    if pictures and draws_plots():
        from discrepancy.result.pictures import save_plots

        save_plots(values, traces, channels, unit, folder)
