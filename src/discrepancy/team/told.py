"""A verdict on a team as JSON values, text and folder; ``discrepancy.result.json`` documents the keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from discrepancy.evidence.findings import Finding
from discrepancy.result.diagnosed import REPORT, draw
from discrepancy.result.evidence_list import place_of
from discrepancy.result.read import EXTENDED, NAME
from discrepancy.result.report import format_verdict
from discrepancy.result.signature import signature
from discrepancy.result.told import Told, Values
from discrepancy.team.causes import CAUSES
from discrepancy.team.verdict import TeamVerdict
from discrepancy.team.words import TeamWords
from estimator.errors import InputError
from estimator.files import write_json, write_text

NOT_SIMULATED: Values = {
    "held_out": {"before": None, "after": None, "as_found": None}, "units": {}, "noise": {}, "removed": None,
    "validated": False, "trials": [],
}  # fmt: skip
"""What ``gain`` has where nothing was simulated."""


class TeamTold(Told):
    """A verdict on a team as values with words."""

    machine = "team"
    verdict: TeamVerdict

    def at(self, cause: str, place: str, joint: int | None, partner: int | None = None) -> Values:
        candidate = self.verdict.candidates.get((cause, place))
        if candidate is not None:
            return place_of(candidate)
        kind = next((c.kind for (name, _), c in self.verdict.candidates.items() if name == cause), "")
        kind = kind or ("something unlisted" if cause in ("", "unlisted") else cause.replace("_", " "))
        return {"cause": cause, "kind": kind, "name": f"{kind} at {place}", "family": cause, "robot": None,
                "joint": joint, "place": place}  # fmt: skip

    def sentence(self, f: Finding, place: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        candidate = self.verdict.candidates.get((f.cause, f.place))
        if candidate is None or not parameters:
            return f"Something that no table lists acts at {place}."
        numbers = {name: entry["value"] for name, entry in parameters.items()}
        errors = {name: entry["se"] for name, entry in parameters.items() if entry["se"] is not None}
        return TeamWords().describe(candidate, numbers, errors)

    def separate(self, cause: str) -> str:
        return CAUSES[cause].separate if cause in CAUSES else ""

    def signature(self, which: str) -> Values:
        chi2 = self.verdict.chi2_per_n[0 if which == "before" else 2]
        return signature(self.verdict.rig, self.verdict.left[which]) | {"chi2_per_n": chi2}

    def undecidable(self) -> list[Values]:
        return self.verdict.rig.undecidable()


@dataclass(frozen=True, eq=False)
class TeamDiagnosed:
    """A verdict with what simulations say.

    Attributes:
        verdict: of the engine.
        gain: what a comparison in closed loop says, as ``gain`` of the JSON; None where there was none.
        not_simulated: why there was none.
        errors: of the payload's estimates ``before`` and ``after``, where the truth is known.
        write_extended: writes a model with the findings in it into a new folder.
    """

    verdict: TeamVerdict
    gain: Mapping[str, Any] | None = None
    not_simulated: str | None = None
    errors: Mapping[str, Any] | None = None
    write_extended: Callable[[Path], object] | None = None

    @cached_property
    def _values(self) -> Values:
        gain: Values = {**(self.gain or NOT_SIMULATED), "estimates": dict(self.verdict.estimates)}
        if self.errors is not None:
            gain["errors"] = dict(self.errors)
        return TeamTold(self.verdict).values(gain, not_simulated=self.not_simulated)

    def to_dict(self) -> Values:
        """Strict JSON with units in the keys; see ``discrepancy.result.json`` for the keys."""
        return self._values

    def __str__(self) -> str:
        """At most five sentences and a table."""
        return format_verdict(self._values)

    def verbose_text(self) -> str:
        """All that there is to say."""
        return format_verdict(self._values, verbose=True)

    def write_into(self, folder: Path, **more: Any) -> None:
        """Write extended model, residuals, pictures, JSON and report into an existing folder.

        Args:
            folder: where.
            more: further keys of the JSON.

        Raises:
            InputError: something cannot be written.
        """
        values = self._values
        if self.verdict.findings and self.write_extended is not None:
            try:
                self.write_extended(folder / EXTENDED)
            except InputError as error:  # values that no effect can have, such as a negative friction
                note = f"There is no extended model: {error}."
                values["notes"] = [*(n for n in values["notes"] if n != note), note]
        draw(values, self.verdict.traces(), self.verdict.rig.channels, TeamWords().unit, folder)
        write_json(folder / NAME, values | more)
        write_text(folder / REPORT, f"{self.verbose_text()}\n")
