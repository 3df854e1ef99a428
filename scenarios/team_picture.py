"""Render a team at rest to a PNG, without a screen: python scenarios/team_picture.py [a|b|c|d] [picture.png]"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # or osmesa; must be set before mujoco is imported

import mujoco
from matplotlib.image import imsave

from mocobot_sim.assemble import assemble_at_home
from mocobot_sim.scene import build_team
from mocobot_sim.team_index import TeamIndex


def render(payload: str, picture: Path, width: int = 1600, height: int = 1000) -> None:
    """Put the team at rest in its home pose and write a picture of it."""
    scene = build_team(payload)
    model = scene.compile()
    data = mujoco.MjData(model)
    assemble_at_home(scene, model, data, TeamIndex.of(model))
    camera = mujoco.MjvCamera()
    camera.lookat[:] = [*scene.X_1i.translation.mean(axis=0)[:2], 0.48]
    camera.distance, camera.azimuth, camera.elevation = 2.7, 125.0, -21.0
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera)
        imsave(picture, renderer.render())


if __name__ == "__main__":
    name = sys.argv[1] if len(sys.argv) > 1 else "a"
    target = Path(sys.argv[2] if len(sys.argv) > 2 else f"team_{name}.png")
    render(name, target)
    print(target)
