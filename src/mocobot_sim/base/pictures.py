"""Pictures of a model in given states, rendered by MuJoCo without a screen, where the machine can.

Rendering happens in a process of its own: MuJoCo chooses its renderer when it is imported, and a broken OpenGL
installation may take the process with it. So whoever asks for pictures needs no OpenGL.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from estimator.errors import InputError

RENDERERS = ("egl", "osmesa")
LONGEST_S = 120.0


@dataclass(frozen=True)
class Camera:
    """From where to look: MuJoCo's free camera.

    Attributes:
        lookat: point in the middle of the picture [m], three numbers.
        distance: from there [m].
        azimuth, elevation: direction of view [deg].
    """

    lookat: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float


@dataclass
class Marks:
    """Lines and arrows drawn into a picture, in the world.

    Attributes:
        lines: rows of two end points [m], radius [m] and colour (red, green, blue, opacity): 11 numbers each.
        arrows: the same for arrows from the first point to the second.
    """

    lines: list[list[float]] = field(default_factory=list)
    arrows: list[list[float]] = field(default_factory=list)

    def path(self, points: ArrayLike, radius_m: float, rgba: Sequence[float]) -> None:
        """Add a line through points [m], shape (K, 3)."""
        points = np.asarray(points, dtype=float)
        for a, b in pairwise(points):
            self.lines.append([*a, *b, radius_m, *rgba])

    def arrow(self, start: ArrayLike, end: ArrayLike, radius_m: float, rgba: Sequence[float]) -> None:
        """Add an arrow between two points [m], shapes (3,)."""
        self.arrows.append([*np.asarray(start, dtype=float), *np.asarray(end, dtype=float), radius_m, *rgba])


def render(
    model: mujoco.MjModel,
    states: Sequence[NDArray[np.float64]],
    camera: Camera,
    marks: Sequence[Marks] | None = None,
    width: int = 1600,
    height: int = 1000,
) -> list[NDArray[np.uint8]] | str:
    """Render states of a model.

    The renderer is what MUJOCO_GL says, else EGL, else OSMesa, whichever works first.

    Args:
        model: what to look at.
        states: ``qpos`` of every picture, K arrays.
        camera: from where.
        marks: what to draw into every picture, K entries; None for nothing.
        width, height: size in pixels; at most what the model's ``offwidth`` and ``offheight`` say.

    Returns:
        K pictures, shape (height, width, 3), or one sentence that says why there are none.
    """
    chosen = os.environ.get("MUJOCO_GL", "")
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        task, result, binary = (Path(folder) / name for name in ("task.npz", "result.npz", "model.mjb"))
        mujoco.mj_saveModel(model, str(binary))
        drawn = list(marks) if marks is not None else [Marks() for _ in states]
        arrays = {f"lines{k}": np.array(mark.lines).reshape(-1, 11) for k, mark in enumerate(drawn)}
        arrays |= {f"arrows{k}": np.array(mark.arrows).reshape(-1, 11) for k, mark in enumerate(drawn)}
        view = np.array([*camera.lookat, camera.distance, camera.azimuth, camera.elevation])
        arrays |= {"qpos": np.array(states), "view": view, "size": np.array([width, height])}
        np.savez(task, **arrays)  # pyright: ignore[reportArgumentType]
        for renderer in (chosen,) if chosen else RENDERERS:
            command = [
                sys.executable,
                "-m",
                "mocobot_sim.base.render_process",
                str(binary),
                str(task),
                str(result),
            ]
            try:
                done = subprocess.run(
                    command, env=os.environ | {"MUJOCO_GL": renderer},
                    capture_output=True, text=True, timeout=LONGEST_S, check=False,
                )  # fmt: skip
            except (OSError, subprocess.TimeoutExpired) as error:
                failed.append(f"{renderer}: {type(error).__name__}")
                continue
            if done.returncode == 0 and result.is_file():
                with np.load(result) as made:
                    return list(made["pictures"])
            last = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
            failed.append(f"{renderer}: {last[0][:120]}")
    return f"pictures are skipped: MuJoCo cannot render without a screen here ({'; '.join(failed)})"


def make_folder(folder: Path) -> None:
    """Make a folder for pictures, before any work is done for them.

    Raises:
        InputError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be made a folder for pictures ({error.strerror or error})"
        ) from error
