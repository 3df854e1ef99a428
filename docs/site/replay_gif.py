"""A recording replayed from its measured angles, as a GIF, without a screen: python docs/site/replay_gif.py [out.gif]

The picture of the README: payload (a) on a periodic motion, the team where joint angles and estimated grasps have it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import mocobot
from mocobot.pictures import render
from mocobot_sim.scene.models import posed
from mocobot_view.camera import clearest, corners
from mocobot_view.pictures import measured_team

WIDTH, HEIGHT = 640, 360
BEGIN_S, FRAMES, FRAME_MS = 12.0, 50, 80
FASTER = 2.5
COLOURS = 128
VIEW_DEG = (-60.0, -24.0)
PAYLOAD_RGBA = (0.75, 0.62, 0.40, 1.0)


def main(out: Path) -> None:
    """Write the picture, or say why there is none."""
    random, periodic = mocobot.simulate_trials("a", ["random", "periodic"], vias=20, duration_s=40, seed=1)
    estimate = mocobot.estimate([random, periodic])
    times = BEGIN_S + FASTER * 1e-3 * FRAME_MS * np.arange(FRAMES)
    teams = [measured_team(periodic, estimate, "a", time) for time in times]
    model = teams[0].model
    seen = np.concatenate([corners(model, team.qpos) for team in teams[::6]])
    feet = posed(model, teams[0].qpos).xpos[[model.body(f"omnid{i + 1}/base").id for i in range(3)]]
    camera = clearest(seen, feet, *VIEW_DEG, WIDTH / HEIGHT, float(model.vis.global_.fovy))
    for geom in range(model.ngeom):  # nothing to be seen inside it here
        if model.body(model.geom_bodyid[geom]).name.startswith("payload/"):
            model.geom_rgba[geom], model.geom_matid[geom] = PAYLOAD_RGBA, -1
    pictures = render(model, [team.qpos for team in teams], camera, width=WIDTH, height=HEIGHT)
    if isinstance(pictures, str):
        sys.exit(pictures)
    frames = [Image.fromarray(picture) for picture in pictures]
    # One palette for all frames, undithered: what does not move costs nothing.
    palette = frames[0].quantize(COLOURS, dither=Image.Dither.NONE)
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    small[0].save(out, save_all=True, append_images=small[1:], duration=FRAME_MS, loop=0, optimize=True)
    print(f"{out}: {out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "replay.gif"))
