"""A straight spring between something and the room."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from estimator.arrays import Array

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

SITE_M, WIDTH_M = 0.006, 0.002
"""Sizes of what is drawn of it."""
SPRING_RANGES = {
    "stiffness_N_per_m": (0.0, 1e4),
    "length_m": (0.0, 100.0),
    "stiffening_N_per_m2": (-1e4, 1e6),
}
"""Of what says how strong one is."""


def add_site(body: Any, name: str, at: Array | list[float]) -> Any:
    """A point of a body, in its frame [m], shape (3,)."""
    return body.add("site", name=name, pos=at, group=4, size=[SITE_M])


def tie(
    scene: TeamScene,
    name: str,
    site: Any,
    anchor_W: Array,
    stiffness_N_per_m: float,
    length_m: float = 0.0,
    stiffening_N_per_m2: float = 0.0,
) -> None:
    """Tie a site to a fixed point of the world [m], shape (3,), by a spatial tendon: slack below its length.

    Stretched by d beyond it, it pulls with k d + s d^2: MuJoCo's stiffness is a polynomial.
    """
    anchor = add_site(scene.root.worldbody, name, anchor_W)
    tendon = scene.root.tendon.add(
        "spatial", name=name, stiffness=stiffness_N_per_m, springlength=[0.0, length_m], width=WIDTH_M
    )
    if stiffening_N_per_m2:
        tendon.stiffness = [stiffness_N_per_m, stiffening_N_per_m2]
    tendon.add("site", site=site)
    tendon.add("site", site=anchor)
