"""A stricter stopping rule for MuJoCo's constraint solver."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


DEFAULT = 1e-8
WITH_KINKS = 1e-12


def precise(scene: TeamScene, tolerance: float = WITH_KINKS) -> None:
    """Let the solver of a scene stop later.

    By default it stops at 1e-8 of a cost that scales with the mean inertia. Sliding and sticking, limits and soft rows
    then end steps early now and then, and rods open by tens of micrometres; with 1e-12 by less than one.
    """
    option = scene.root.option
    option.tolerance = min(DEFAULT if option.tolerance is None else option.tolerance, tolerance)
