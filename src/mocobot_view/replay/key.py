"""Which colour is which line: a row of dots over the plots of a replay.

The viewer's own legend lies on top of a plot's first seconds, and shows six of nine lines where there is room.
"""

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from mocobot_view import colours
from mocobot_view.replay.replay_trial import ReplayTrial

PARTS = {"joints": ("1", "2", "3"), "axes": ("x", "y", "z"), "robots": ("",)}
"""Keys, and what the lines of one robot are."""
NAME, DOT, GAP = 2.4, 1.0, 0.6
"""Widths of a robot's name, of a dot, and between robots; in any unit."""
ROBOT = NAME + 3 * DOT + GAP
MIDDLE = 0.3, 0.6
"""What is in the middle of the strip, so narrow that its width counts; dots are at 0, and their names hang below."""


def log_keys(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log all keys below the series in the trial's root."""
    for key, parts in PARTS.items():
        places, labels, tones, radii = [], [], [], []
        for robot in range(1, trial.robots + 1):
            start = (robot - 1) * ROBOT
            places.append(start + 0.5 * NAME)
            labels.append(f"omnid{robot}")
            shades = colours.shades(robot) if len(parts) == 3 else [colours.of_robot(robot)]
            tones.append(colours.pale(colours.of_robot(robot)))
            radii.append(0.0)
            places += [start + NAME + (k + 0.5) * DOT for k in range(len(parts))]
            labels += parts
            tones += shades
            radii += [5.0] * len(parts)
        dots = rr.Points2D(
            np.column_stack([places, np.zeros(len(places))]),
            labels=labels,
            colors=tones,
            radii=rr.Radius.ui_points(radii),
            show_labels=True,
        )
        stream.log(_path(trial, key), dots, static=True)


def key_view(trial: ReplayTrial, key: str) -> rrb.Spatial2DView:
    """A key as a strip as wide as the plots below it."""
    return rrb.Spatial2DView(
        origin=f"/{_path(trial, key)}",
        name="key",
        titlebar=False,
        visual_bounds=rrb.VisualBounds2D(x_range=(0.0, max(trial.robots, 3) * ROBOT - GAP), y_range=MIDDLE),
    )


def _path(trial: ReplayTrial, key: str) -> str:
    return f"{trial.name}/series/key/{key}"
