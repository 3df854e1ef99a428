"""A verdict on a robot of joints with all that is told, drawn and written of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from discrepancy.channel import Channel
from discrepancy.joints.effects import write_extended
from discrepancy.joints.findings import JointVerdict
from discrepancy.joints.json import unit_of, verdict_to_dict
from discrepancy.result.folder import REPORT, draw
from discrepancy.result.read import EXTENDED, NAME
from discrepancy.result.report import format_verdict
from estimator.errors import InputError
from estimator.files import write_json, write_text


@dataclass(frozen=True, eq=False)
class JointDiagnosed:
    """A verdict with what rollouts say.

    Attributes:
        verdict: of the engine.
        rollouts: plain JSON values, or None.
    """

    verdict: JointVerdict
    rollouts: Mapping[str, Any] | None = None

    @cached_property
    def _values(self) -> dict[str, Any]:
        return verdict_to_dict(self.verdict, self.rollouts)

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys; see ``discrepancy.result.json`` for the keys."""
        return self._values

    def __str__(self) -> str:
        """At most five sentences and a table."""
        return format_verdict(self._values)

    def verbose_text(self) -> str:
        """All that there is to say."""
        return format_verdict(self._values, verbose=True)

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> None:
        """Write extended model, residuals, pictures, JSON and report into an existing folder.

        Args:
            folder: where.
            pictures: whether pictures are drawn, too.
            more: further keys of the JSON.

        Raises:
            InputError: something cannot be written.
        """
        values, model = self._values, self.verdict.model
        if self.verdict.findings:
            try:
                write_extended(self.verdict, folder / EXTENDED)
            except InputError as error:  # values that no effect can have, such as a negative friction
                note = f"There is no extended model: {error}."
                values["notes"] = [*(n for n in values["notes"] if n != note), note]
        channels = [
            Channel(f"{name} torque", "torque", None, unit_of(model, j))
            for j, name in enumerate(model.joints)
        ]
        draw(values, self.verdict.traces(), channels, self._quantity_unit, folder, pictures=pictures)
        write_json(folder / NAME, values | more)
        write_text(folder / REPORT, f"{self.verbose_text()}\n")

    def _quantity_unit(self, name: str) -> str:
        """Unit of a quantity that a misfit may depend on."""
        of_position = name.removeprefix("position of joint ")
        if of_position.isdigit():
            return "m" if self.verdict.model.slides[int(of_position) - 1] else "rad"
        return "typical speeds" if name == "speed" else "N m"
