"""What a rig says about its causes in words; the JSON and the report take it from here."""

from collections.abc import Mapping
from typing import ClassVar

from discrepancy.candidate import Candidate
from discrepancy.causes.base import Cause
from discrepancy.causes.numbers import Numbers


class Words:
    """Sentences about one rig's causes and channels.

    Attributes:
        causes: the rig's catalogue.
        units: of closed-loop channels, and of quantities that a misfit may depend on.
    """

    causes: ClassVar[Mapping[str, Cause]]
    units: ClassVar[Mapping[str, str]]

    def describe(self, candidate: Candidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
        """What a cause does at its place, one sentence with its numbers; standard errors may be NaN."""
        cause = self.causes[candidate.cause]
        return f"{cause.place(candidate)}: {cause.sentence(Numbers(values, se))}."

    def separate(self, candidate: Candidate) -> str:
        """Which experiment would tell a cause from its look-alikes, one sentence, or nothing."""
        return self.causes[candidate.cause].separate

    def unit(self, name: str) -> str:
        """Unit of a closed-loop channel, or of a quantity that a misfit may depend on."""
        return self.units[name]
