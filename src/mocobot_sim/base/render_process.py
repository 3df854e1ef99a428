"""The process in which ``pictures`` renders: python -m mocobot_sim.base.render_process MODEL.mjb TASK.npz RESULT.npz"""

from __future__ import annotations

import sys

import mujoco
import numpy as np


def main(model_path: str, task_path: str, result_path: str) -> None:
    """Render every state of a task."""
    model = mujoco.MjModel.from_binary_path(model_path)
    data = mujoco.MjData(model)
    with np.load(task_path) as task:
        states, view, (width, height) = task["qpos"], task["view"], task["size"]
        lines = [task[f"lines{k}"] for k in range(len(states))]
        arrows = [task[f"arrows{k}"] for k in range(len(states))]
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = view[:3], *view[3:]
    model.vis.global_.offwidth = max(model.vis.global_.offwidth, int(width))
    model.vis.global_.offheight = max(model.vis.global_.offheight, int(height))
    pictures = []
    with mujoco.Renderer(model, int(height), int(width)) as renderer:
        for k, qpos in enumerate(states):
            data.qpos[:] = qpos
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera)
            for row in lines[k]:
                _connect(renderer.scene, mujoco.mjtGeom.mjGEOM_CAPSULE, row)
            for row in arrows[k]:
                _connect(renderer.scene, mujoco.mjtGeom.mjGEOM_ARROW, row)
            pictures.append(renderer.render())
    np.savez(result_path, pictures=np.array(pictures))


def _connect(scene: mujoco.MjvScene, kind: mujoco.mjtGeom, row: np.ndarray) -> None:
    """Add one geom between two points."""
    if scene.ngeom >= scene.maxgeom or np.linalg.norm(row[3:6] - row[:3]) < 1e-9:
        return
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), row[7:].astype(np.float32))
    mujoco.mjv_connector(geom, kind, row[6], row[:3], row[3:6])
    scene.ngeom += 1


if __name__ == "__main__":
    main(*sys.argv[1:])
