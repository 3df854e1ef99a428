"""Payloads for teams of other sizes than three: a plate on N grasps, written as MJCF."""

from __future__ import annotations

from pathlib import Path

import numpy as np

SPACING_M = 1.0
MASS_PER_ROBOT_KG = 3.5
LARGEST_RADIUS_M = 0.95
"""Of the circle: turned about its middle by 3.4 deg a payload moves the grasps of a larger one out of reach."""


def write_plate(robots: int, path: Path) -> Path:
    """Grasps on a circle, a metre apart or as near as it takes; the mass off the middle and below the grasps.

    Two grasps alone let the payload swing, so it must hang.
    """
    radius = min(LARGEST_RADIUS_M, SPACING_M / (2.0 * np.sin(np.pi / robots)))
    angles = 2.0 * np.pi * np.arange(robots) / robots
    places = radius * np.column_stack([np.cos(angles) - 1.0, np.sin(angles)])
    sites = "\n".join(
        f'      <site name="grasp{k + 1}" pos="{x} {y} {0.01 * (k % 3)}" euler="0 0 {angle}"/>'
        for k, ((x, y), angle) in enumerate(zip(places, angles, strict=True))
    )
    mass = MASS_PER_ROBOT_KG * robots
    across = mass * max(0.3, radius) ** 2 / 4.0
    path.write_text(
        f"""<mujoco model="plate{robots}">
  <compiler angle="radian"/>
  <worldbody>
    <body name="payload">
      <inertial pos="{-0.9 * radius} {0.05 * radius} -0.15" mass="{mass}"
                diaginertia="{across} {1.3 * across} {2.1 * across}"/>
{sites}
    </body>
  </worldbody>
</mujoco>
""",
        encoding="utf-8",
    )
    return path
