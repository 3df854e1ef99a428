"""One channel of a residual."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Channel:
    """One residual channel.

    Attributes:
        name: such as ``grasp 2 rotation x``.
        kind: group that is reported together, such as ``kinematic``.
        robot: whose channel it is, counted from 1, or None.
        unit: physical unit of the unwhitened residual.
    """

    name: str
    kind: str
    robot: int | None
    unit: str
