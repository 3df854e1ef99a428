"""A finished diagnosis with all that is told, drawn and written of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from discrepancy.causes.words import Words
from discrepancy.engine.diagnose import Diagnosis
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.result.read import AS_FOUND, EXTENDED, NAME
from discrepancy.result.text import format_diagnosis
from discrepancy.result.traces import Trace
from discrepancy.result.traces_file import NAME as RESIDUALS
from discrepancy.result.traces_file import save_traces
from discrepancy.rig import Channel, Rig
from estimator.errors import InputError
from estimator.extras import draws_plots
from estimator.files import write_json, write_text

REPORT = "report.txt"


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """A verdict with the rig that it is of.

    Attributes:
        rig: what was diagnosed.
        diagnosis: the engine's result.
        words: of the rig.
        traces: makes the residuals for file and pictures.
        estimates: what the rig estimates ``before`` and ``after``, or None; ``errors`` may lie beside them.
        rollouts: what rollouts of a serial robot say, plain JSON values, or None.
    """

    rig: Rig
    diagnosis: Diagnosis
    words: Words
    traces: Callable[[], Sequence[Trace]]
    estimates: Mapping[str, Any] | None = None
    rollouts: Mapping[str, Any] | None = None

    @cached_property
    def _values(self) -> dict[str, Any]:
        return diagnosis_to_dict(self.diagnosis, self.rig, self.words, self.estimates, self.rollouts)

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys; see ``discrepancy.result.json`` for the keys."""
        return self._values

    def __str__(self) -> str:
        """The text report."""
        return format_diagnosis(self._values)

    def verbose_text(self) -> str:
        """The text report, which is whole in any case."""
        return str(self)

    def write_into(self, folder: Path, **more: Any) -> None:
        """Write extended models, residuals, pictures, JSON and report into an existing folder.

        Args:
            folder: where.
            more: further keys of the JSON.

        Raises:
            InputError: something cannot be written.
        """
        values, gain = self._values, self.diagnosis.gain
        models = [(EXTENDED, self.rig.write_extended)] if self.diagnosis.causes else []
        if gain is not None and gain.is_better_as_found:
            models.append((AS_FOUND, self.rig.write_as_found))
        for name, write in models:
            try:
                write(self.diagnosis.explanation, folder / name)
            except InputError as error:  # values that no effect can have, such as a negative friction
                note = f"There is no {'extended model' if name == EXTENDED else 'model as found'}: {error}."
                values["notes"] = [*(n for n in values["notes"] if n != note), note]
        draw(values, self.traces(), self.rig.channels, self.words.unit, folder)
        write_json(folder / NAME, values | more)
        write_text(folder / REPORT, f"{self}\n")


def draw(
    values: Mapping[str, Any], traces: Sequence[Trace], channels: Sequence[Channel], unit: Callable[[str], str],
    folder: Path,
) -> None:  # fmt: skip
    """Write residuals and, where plots can be drawn, pictures of a diagnosis.

    Args:
        values: the diagnosis, as in the JSON.
        traces: residuals of every trial.
        channels: what they are of.
        unit: of a quantity that a misfit may depend on.
        folder: an existing one.

    Raises:
        InputError: something cannot be written.
    """
    save_traces(traces, channels, folder / RESIDUALS)
    if draws_plots():
        from discrepancy.result.pictures.plots import save_plots

        save_plots(values, traces, channels, unit, folder)
