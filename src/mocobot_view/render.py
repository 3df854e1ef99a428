"""Render models off-screen with MuJoCo, if the machine supports it.

A separate process renders, because MuJoCo chooses its renderer at import and a broken OpenGL installation can crash
the process. The calling process needs no OpenGL.
"""

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.extras import NO_PLOTS, has_plots
from estimator.files import scratch_folder
from mocobot_view.camera import Camera, Marks, pixels

Picture = NDArray[np.uint8]

RENDERERS = ("egl", "osmesa")
LONGEST_S = 120.0
REMEDY = "install EGL (Debian and Ubuntu: libegl1) or OSMesa (libosmesa6)"


@dataclass(frozen=True, eq=False)
class Shot:
    """Description of a picture to render."""

    model: mujoco.MjModel  # model to show
    qpos: Array  # state of the model, shape (nq,)
    camera: Camera  # camera pose
    marks: Marks = field(default_factory=Marks)  # marks to draw into the picture
    says: str = ""  # caption of one or two sentences


def render(
    model: mujoco.MjModel,
    states: Sequence[Array],
    camera: Camera,
    marks: Sequence[Marks] | None = None,
    width: int = 1600,
    height: int = 1000,
) -> list[Picture] | str:
    """Render states of a model.

    Args:
        model: model to show.
        states: ``qpos`` of every picture, K arrays.
        camera: camera pose.
        marks: marks of every picture, K entries; None for no marks.
        width, height: size [px].

    Returns:
        K pictures of shape (height, width, 3), or one sentence that explains why there are none.
    """
    drawn = marks if marks is not None else [Marks() for _ in states]
    shots = [Shot(model, qpos, camera, mark) for qpos, mark in zip(states, drawn, strict=True)]
    return render_shots(shots, width, height)


def render_shots(shots: Sequence[Shot], width: int = 1600, height: int = 1000) -> list[Picture] | str:
    """Render several pictures (height, width, 3) in one process, or return one sentence that says why there are none.

    The environment variable MUJOCO_GL selects the renderer; without it, EGL and then OSMesa are tried.
    """
    if not shots:
        return []
    if not has_plots():
        return NO_PLOTS
    from mocobot_view.camera import with_labels  # imports matplotlib, an optional dependency

    with scratch_folder() as folder:
        _write_task(folder, shots, width, height)
        plain = _run(folder)
    if isinstance(plain, str):
        return plain
    pictures = []
    for picture, shot in zip(plain, shots, strict=True):
        points = [label.point for label in shot.marks.labels]
        at = pixels(shot.camera, points, width, height, float(shot.model.vis.global_.fovy))
        pictures.append(with_labels(picture, shot.marks.labels, at))
    return pictures


def _write_task(folder: Path, shots: Sequence[Shot], width: int, height: int) -> None:
    """Write the task of the render process: every model once, and the data of every shot."""
    models: list[mujoco.MjModel] = []
    arrays: dict[str, NDArray[np.float64] | NDArray[np.int64]] = {"size": np.array([width, height])}
    for k, shot in enumerate(shots):
        known = next((m for m, model in enumerate(models) if model is shot.model), len(models))
        if known == len(models):
            models.append(shot.model)
            mujoco.mj_saveModel(shot.model, str(folder / f"model{known}.mjb"))
        camera, marks = shot.camera, shot.marks
        arrays |= {
            f"model{k}": np.array(known),
            f"qpos{k}": np.asarray(shot.qpos),
            f"view{k}": np.array([*camera.lookat, camera.distance, camera.azimuth, camera.elevation]),
            f"lines{k}": np.array(marks.lines).reshape(-1, 11),
            f"arrows{k}": np.array(marks.arrows).reshape(-1, 11),
            f"ellipsoids{k}": np.array(marks.ellipsoids).reshape(-1, 19),
        }
    arrays["count"] = np.array(len(shots))
    np.savez(folder / "task.npz", **arrays)  # pyright: ignore[reportArgumentType]


def _run(folder: Path) -> NDArray[np.uint8] | str:
    """Run the render process on a task; return pictures of shape (K, height, width, 3), or the reason for none."""
    chosen, failed = os.environ.get("MUJOCO_GL", ""), []
    result = folder / "result.npy"
    for renderer in (chosen,) if chosen else RENDERERS:
        env = os.environ | {"MUJOCO_GL": renderer}
        if not chosen:
            env.pop("PYOPENGL_PLATFORM", None)  # a value for another renderer would break this one
        try:
            done = subprocess.run(
                [sys.executable, "-m", "mocobot_view.render_process", str(folder)],
                env=env, capture_output=True, text=True, timeout=LONGEST_S, check=False,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired) as error:
            failed.append(f"{renderer}: {type(error).__name__}")
            continue
        if done.returncode == 0 and result.is_file():
            return np.load(result)
        last = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        failed.append(f"{renderer}: {last[0][:200]}")
    remedy = "unset MUJOCO_GL to have EGL and OSMesa tried" if chosen else REMEDY
    reasons = "; ".join(failed)
    return f"pictures are skipped: MuJoCo cannot render without a screen here ({reasons}); {remedy}"
