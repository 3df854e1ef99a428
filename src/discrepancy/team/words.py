"""A team's causes in the words of a lab."""

from collections.abc import Mapping
from typing import Any

from discrepancy.candidate import Candidate
from discrepancy.numbers import Numbers
from discrepancy.team.causes import CAUSES

UNDECIDABLE = (
    (
        "zero of the last gimbal axis",
        "it turns the grasp frame by a constant, and the grasp frame is itself unknown",
        "a grasp whose orientation is known",
    ),
    (
        "mass of the gimbal and the platform",
        "a point mass at the wrist is a part of the payload",
        "a run of the arm alone",
    ),
    (
        "a scale common to all torques",
        "it scales the payload's mass and inertia and nothing else",
        "a known weight on the payload",
    ),
    (
        "which robot's gimbal rubs",
        "a pure moment about parallel axes is the same wherever it acts; only the axis shows",
        "one robot released at a time",
    ),
)
"""What recordings of a parked team that holds one rigid payload cannot decide: what, why, and what would."""


class TeamWords:
    """Sentences about a mocobot team."""

    units = {"phi": "rad", "theta": "rad", "tau": "N m", "speed": "m/s", "position": "m", "load": "N m"}  # noqa: RUF012

    def describe(self, candidate: Candidate, values: Mapping[str, float], se: Mapping[str, float]) -> str:
        """What a cause does at its place, one sentence with its numbers; standard errors may be NaN."""
        cause = CAUSES[candidate.cause]
        return f"{cause.place(candidate)}: {cause.sentence(Numbers(values, se))}."

    def separate(self, candidate: Candidate) -> str:
        """Which experiment would tell a cause from its look-alikes, one sentence, or nothing."""
        return CAUSES[candidate.cause].separate

    def unit(self, name: str) -> str:
        """Unit of a closed-loop channel, or of a quantity that a misfit may depend on."""
        return self.units[name]


def statements(robots: int, *, aligned: bool) -> list[dict[str, Any]]:
    """What, why, and what would decide it, for a team of N robots whose clocks the motion may have set (aligned)."""
    said = [{"what": what, "why": why, "remedy": remedy} for what, why, remedy in UNDECIDABLE]
    if aligned:
        why = "the conversion has taken out what the motion tells of the clocks"
        said.append(
            {"what": "the robots' clocks", "why": why, "remedy": "one clock for all, and no --clock correct"}
        )
    if robots == 1:
        what = "every error of angles, lengths, bases and grasps of a single robot"
        said.append(
            {"what": what, "why": "no other robot tells where the payload is", "remedy": "a second robot"}
        )
    return said
