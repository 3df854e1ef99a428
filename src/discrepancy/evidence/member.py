"""One place of what a search found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Member:
    """One place of a finding.

    Attributes:
        place: name of the joint, link or base.
        joint: which joint, from 1; None of links and of the base.
        values: by parameter name, with the unit as suffix.
        errors: standard errors by the same names.
    """

    place: str
    joint: int | None
    values: Mapping[str, float]
    errors: Mapping[str, float]
