"""Render process that ``mocobot_view.render`` starts: python -m mocobot_view.render_process FOLDER

The folder holds ``task.npz`` and the models that it names; the pictures go to ``result.npy``.
"""

import sys
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import mujoco
import numpy as np

NOISE = 4
"""Largest difference between two renderings of one scene [of 255], because software renderers round differently."""


def main(folder: Path) -> None:
    with np.load(folder / "task.npz") as file:
        task = dict(file)
    width, height = (int(size) for size in task["size"])
    pictures, renderers = [], {}
    with ExitStack() as stack:
        for k in range(int(task["count"])):
            name = int(task[f"model{k}"])
            if name not in renderers:
                model = mujoco.MjModel.from_binary_path(str(folder / f"model{name}.mjb"))
                model.vis.global_.offwidth = max(model.vis.global_.offwidth, width)
                model.vis.global_.offheight = max(model.vis.global_.offheight, height)
                renderers[name] = model, stack.enter_context(mujoco.Renderer(model, height, width))
            pictures.append(_picture(*renderers[name], task, k))
    np.save(folder / "result.npy", np.array(pictures))


def _picture(
    model: mujoco.MjModel, renderer: mujoco.Renderer, task: Mapping[str, np.ndarray], k: int
) -> np.ndarray:
    data, camera, view = mujoco.MjData(model), mujoco.MjvCamera(), task[f"view{k}"]
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = view[:3], *view[3:]
    data.qpos[:] = task[f"qpos{k}"]
    mujoco.mj_forward(model, data)
    renderer.update_scene(data, camera)
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = True
    plain = renderer.render()
    if not any(len(task[f"{kind}{k}"]) for kind in ("lines", "arrows", "ellipsoids")):
        return plain
    # Marks must not cast shadows, so the pixels that they change come from a rendering without shadows.
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
    bare = renderer.render()
    _mark(renderer.scene, task, k)
    marked = renderer.render()
    changed = np.abs(marked.astype(int) - bare).max(axis=-1, keepdims=True) > NOISE
    return np.where(changed, marked, plain)


def _mark(scene: mujoco.MjvScene, task: Mapping[str, np.ndarray], k: int) -> None:
    for row in task[f"lines{k}"]:
        _connect(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, row)
    for row in task[f"arrows{k}"]:
        _connect(scene, mujoco.mjtGeom.mjGEOM_ARROW, row)
    for row in task[f"ellipsoids{k}"]:
        _add(scene, mujoco.mjtGeom.mjGEOM_ELLIPSOID, row[12:15], row[:3], row[3:12], row[15:])


def _connect(scene: mujoco.MjvScene, kind: mujoco.mjtGeom, row: np.ndarray) -> None:
    """Add one geom between two points."""
    if np.linalg.norm(row[3:6] - row[:3]) < 1e-9:
        return
    geom = _add(scene, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), row[7:])
    if geom is not None:
        mujoco.mjv_connector(geom, kind, row[6], row[:3], row[3:6])


def _add(
    scene: mujoco.MjvScene,
    kind: mujoco.mjtGeom,
    size: np.ndarray,
    centre: np.ndarray,
    R: np.ndarray,
    rgba: np.ndarray,
) -> mujoco.MjvGeom | None:
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, size, centre, R, rgba.astype(np.float32))
    scene.ngeom += 1
    return geom


if __name__ == "__main__":
    main(Path(sys.argv[1]))
