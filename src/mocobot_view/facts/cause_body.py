"""Which body of a robot a cause sits at."""

from __future__ import annotations

from discrepancy.result.read import NamedCause
from mocobot_view.bodies.robot import GIMBAL

GIMBAL_CAUSES = ("theta_zero", "gimbal_friction")
AT_GRASP = ("grasp_flex", "grasp_play", "tether")
"""Causes of a whole robot that act where it holds the payload; those of other robots are marked at the base."""


def body_of(cause: NamedCause) -> str | None:
    """The robot's body, such as ``proximal1``; None for the base, or the payload."""
    if cause.robot is not None and cause.joint is not None:
        return GIMBAL[cause.joint - 1] if cause.name in GIMBAL_CAUSES else f"proximal{cause.joint}"
    return "flange" if cause.robot is not None and cause.name in AT_GRASP else None
