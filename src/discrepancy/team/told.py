"""A verdict on a team as JSON values, text and folder; ``discrepancy.result.json`` documents the keys."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.evidence.findings import Finding
from discrepancy.evidence.held import words_of
from discrepancy.result.folder import REPORT, draw
from discrepancy.result.read import AS_FOUND, EXTENDED, NAME
from discrepancy.result.remains import of_response
from discrepancy.result.report import format_verdict
from discrepancy.result.told import Told, Values
from discrepancy.team.causes import CAUSES
from discrepancy.team.diagnose import TeamOutcome
from discrepancy.team.gain import Gain, Response
from discrepancy.team.response import write_model
from discrepancy.team.rig import TeamRig
from discrepancy.team.signature import signature
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

    def finding(self, f: Finding) -> Values:
        words, robot = words_of(f, f.place), re.search(r"of robot (\d+)$", f.place)
        return super().finding(f) | words | ({"robot": int(robot[1])} if words and robot else {})

    def sentence(self, f: Finding, place: str, parameters: Mapping[str, Mapping[str, Any]]) -> str:
        candidate = self.verdict.candidates.get((f.cause, f.place))
        if f.law is not None:
            return f"{f.law.sentence(place[:1].upper() + place[1:])}."
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
        outcome: of the search.
        gain: responses in closed loop; None where there were none.
        not_simulated: why there were none.
        errors: of the payload's estimates ``before`` and ``after``, where the truth is known.
    """

    verdict: TeamVerdict
    outcome: TeamOutcome
    gain: Gain | None = None
    not_simulated: str | None = None
    errors: Mapping[str, Any] | None = None

    @cached_property
    def _values(self) -> Values:
        gain = gain_to_dict(self.gain, self.verdict.rig) if self.gain else NOT_SIMULATED
        gain = gain | {"estimates": dict(self.verdict.estimates)}
        if self.errors is not None:
            gain["errors"] = dict(self.errors)
        values = TeamTold(self.verdict).values(gain, not_simulated=self.not_simulated)
        return values | {"remains": [*values["remains"], *of_response(values)]}

    def to_dict(self) -> Values:
        """Strict JSON with units in the keys; see ``discrepancy.result.json`` for the keys."""
        return self._values

    def __str__(self) -> str:
        """At most five sentences and a table."""
        return format_verdict(self._values)

    def verbose_text(self) -> str:
        """All that there is to say."""
        return format_verdict(self._values, verbose=True)

    def write_into(self, folder: Path, *, pictures: bool = True, **more: Any) -> None:
        """Write models to take away, residuals, pictures, JSON and report into an existing folder.

        Args:
            folder: where.
            pictures: whether pictures are drawn, too.
            more: further keys of the JSON.

        Raises:
            InputError: something cannot be written.
        """
        values, found = self._values, {(f.cause, f.place) for f in self.verdict.findings}
        chosen = [c for c in self.outcome.state.chosen if c.group.key in found]
        models = [(EXTENDED, False)] if chosen else []
        if self.gain is not None and self.gain.is_better_as_found:
            models.append((AS_FOUND, True))
        for name, whole in models:
            try:
                write_model(self.outcome, chosen, folder / name, whole=whole)
            except InputError as error:  # values that no effect can have, such as a negative friction
                note = f"There is no {'model as found' if whole else 'extended model'}: {error}."
                values["notes"] = [*(n for n in values["notes"] if n != note), note]
        draw(
            values,
            self.verdict.traces(),
            self.verdict.rig.channels,
            TeamWords().unit,
            folder,
            pictures=pictures,
        )
        write_json(folder / NAME, values | more)
        write_text(folder / REPORT, f"{self.verbose_text()}\n")


def gain_to_dict(gain: Gain, rig: TeamRig) -> Values:
    """``gain`` of the JSON."""
    channels, removed = list(next((a.rms for a, _ in gain.pairs), {})), gain.removed()
    both = zip((rig.trials[t] for t in rig.resimulated), gain.before, gain.after, strict=True)
    told = {"before": gain.before, "after": gain.after, "as_found": gain.as_found}
    share = removed and {
        "share": removed[0],
        "interval": [x if np.isfinite(x) else None for x in removed[1:]],
    }
    return {
        "held_out": {name: _mean(each) for name, each in told.items()},
        "units": {name: TeamWords().unit(name) for name in channels},
        "noise": {f"{name}_rms": _noise(rig, name) for name in channels},
        "removed": share,
        "validated": gain.held_out,
        "trials": [{"name": name, "before": _response(a), "after": _response(b)} for name, a, b in both],
    }


def _noise(rig: TeamRig, channel: str) -> float:
    squares = [np.mean(rig.response_scale(t)[channel][0] ** 2) for t in range(len(rig.trials))]
    return float(np.sqrt(np.mean(squares)))


def _response(response: Response | None) -> dict[str, float] | None:
    if response is None:
        return None
    sizes = {f"{name}_nrmse": float(v) for name, v in response.nrmse.items()}
    sizes |= {f"{name}_rms": float(v) for name, v in response.rms.items()}
    return sizes | {"chi2_per_n": float(response.chi2_per_n)}


def _mean(responses: Sequence[Response | None]) -> dict[str, float] | None:
    """That of some trials is not to be held against that of all."""
    each = [values for values in map(_response, responses) if values is not None]
    whole = each and len(each) == len(responses)
    return {key: float(np.mean([values[key] for values in each])) for key in each[0]} if whole else None


def place_of(candidate: Candidate) -> dict[str, Any]:
    """Cause (its name, in words, in words at its place), family and place of a candidate, as all over the JSON."""
    return {
        "cause": candidate.cause,
        "kind": candidate.kind,
        "name": candidate.label,
        "family": candidate.family,
        "robot": candidate.robot,
        "joint": candidate.joint,
        "place": candidate.place,
    }
