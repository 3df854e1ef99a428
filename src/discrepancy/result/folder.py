"""A diagnosis as values, text and folder: what teams and robots of joints have in common."""

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
    """A verdict with all that is told, drawn and written of it."""

    verdict: V

    @cached_property
    @abstractmethod
    def values(self) -> dict[str, Any]:
        """Plain JSON values; see ``discrepancy.result.json`` for the keys."""

    @property
    @abstractmethod
    def channels(self) -> Sequence[Channel]:
        """What residuals are of."""

    @abstractmethod
    def unit(self, name: str) -> str:
        """Unit of a quantity that a misfit may depend on."""

    @abstractmethod
    def models(self) -> Iterator[tuple[str, str, Callable[[Path], None]]]:
        """Models to take away: folder, what it is in words, and what writes it."""

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys; see ``discrepancy.result.json`` for the keys."""
        return self.values

    def __str__(self) -> str:
        """At most five sentences and a table."""
        return format_verdict(self.values)

    def verbose_text(self) -> str:
        """All that there is to say."""
        return format_verdict(self.values, verbose=True)

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> None:
        """Write models to take away, residuals, pictures, JSON and report into an existing folder.

        Args:
            folder: where.
            pictures: whether pictures are drawn, too.
            more: further keys of the JSON.

        Raises:
            InputError: something cannot be written.
        """
        values = self.values
        for name, what, write in self.models():
            try:
                write(folder / name)
            except InputError as error:  # values that no effect can have, such as a negative friction
                note = f"There is no {what}: {error}."
                values["notes"] = [*(n for n in values["notes"] if n != note), note]
        draw(values, self.verdict.traces(), self.channels, self.unit, folder, pictures=pictures)
        write_json(folder / NAME, values | more)
        write_text(folder / REPORT, f"{self.verbose_text()}\n")


def draw(
    values: Mapping[str, Any], traces: Sequence[Trace], channels: Sequence[Channel], unit: Callable[[str], str],
    folder: Path, *, pictures: bool = True,
) -> None:  # fmt: skip
    """Write residuals and, where plots can be drawn, pictures of a diagnosis; arguments as of ``save_plots``.

    Raises:
        InputError: something cannot be written.
    """
    save_traces(traces, channels, folder / RESIDUALS)
    if pictures and draws_plots():
        from discrepancy.result.pictures import save_plots

        save_plots(values, traces, channels, unit, folder)
