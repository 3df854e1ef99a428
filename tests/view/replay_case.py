"""Trials whose every body MuJoCo has placed, and what is read back from a replay's file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.estimate.grasps import GraspEstimate
from estimator.estimate.result import PayloadEstimate
from estimator.recording.model import Recording
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import PAYLOAD_PREFIX
from mocobot_sim.trial import trial as trial_module
from mocobot_sim.trial.sensors import measure, sensor_preset
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import Rows, TrialLog
from mocobot_view.camera import Camera
from mocobot_view.render import Picture, render

BODIES = {
    **{f"proximal{k}": f"base/leg{k}/proximal" for k in (1, 2, 3)},
    **{f"rod{k}": f"base/leg{k}/proximal/knee/rod" for k in (1, 2, 3)},
    "base": "base",
    "platform": "base/platform",
    "yoke": "base/platform/yoke",
    "ring": "base/platform/yoke/ring",
    "flange": "base/platform/yoke/ring/flange",
}
"""Bodies of the MJCF, and their entities below a robot."""


@dataclass(frozen=True)
class Placed:
    """A trial with MuJoCo's own pose of every body in the world, by the body's name, Q transforms each."""

    scene: TeamScene
    log: TrialLog
    bodies: dict[str, RigidTransform]

    def recording(self, preset: str = "ideal", **changes) -> Recording:
        return measure(self.log, sensor_preset(preset), np.random.default_rng(1), name="rec", **changes)

    def entity(self, robot: int, body: str) -> str:
        return f"trial/omnid{robot}/{BODIES[body]}"


def placed_trial(scene: TeamScene, vias: int = 2) -> Placed:
    """Run a short trial and keep where MuJoCo's forward solution has every body."""
    xpos, xquat = [], []

    class Keeping(Rows):
        def after_step(self, sample: int) -> None:
            super().after_step(sample)
            xpos.append(self.data.xpos.copy())
            xquat.append(self.data.xquat.copy())
            names.update({self.model.body(b).name: b for b in range(self.model.nbody)})

    names: dict[str, int] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trial_module, "Rows", Keeping)
        log = run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(3), vias=vias))
    p, q = np.array(xpos), np.array(xquat)
    bodies = {
        name: RigidTransform.from_components(p[:, b], Rotation.from_quat(q[:, b], scalar_first=True))
        for name, b in names.items()
    }
    return Placed(scene, log, bodies)


def true_estimate(scene: TeamScene) -> PayloadEstimate:
    """An "estimate" that has nothing but the true grasps."""
    N, zeros = scene.robots, np.zeros((scene.robots, scene.robots))
    grasps = GraspEstimate(
        scene.X_1i.rotation.as_matrix(),
        scene.X_1i.translation,
        np.zeros((6 * (N - 1), 6 * (N - 1))),
        zeros,
        zeros,
        np.zeros(N),
        np.zeros(N),
    )
    return PayloadEstimate(None, N, "staged", grasps, None, None, None, None, (), (), ())


class Replayed:
    """A replay's file, queried through Rerun's dataframes."""

    def __init__(self, path: Path) -> None:
        self.store = RrdReader(path).stream().collect()

    def column(self, entity: str, component: str) -> tuple[np.ndarray, np.ndarray]:
        """Times [s], shape (Q,), and values, one row per time; lists of unequal length are not for this."""
        index = None if self.is_static(entity, component) else "time"
        table = self.store.reader(index=index, contents=f"/{entity}").to_arrow_table()
        name = f"/{entity}:{component}"
        table = table.filter(table[name].is_valid())
        time = table["time"].cast("int64").to_numpy() * 1e-9 if index else np.zeros(table.num_rows)
        return time, np.array(table[name].to_pylist(), dtype=float).reshape(table.num_rows, -1)

    def is_static(self, entity: str, component: str) -> bool:
        table = self.store.reader(index=None, contents=f"/{entity}").to_arrow_table()
        return f"/{entity}:{component}" in table.column_names

    def texts(self, entity: str, component: str) -> list[str]:
        table = self.store.reader(index=None, contents=f"/{entity}").to_arrow_table()
        return table[f"/{entity}:{component}"].to_pylist()[0]

    def entities(self) -> set[str]:
        return {column.entity_path.lstrip("/") for column in self.store.schema().component_columns()}

    def pose(self, entity: str, samples: int) -> RigidTransform:
        """World poses of an entity as the viewer composes them, Q transforms."""
        parts = entity.split("/")
        pose = RigidTransform.identity()
        for k in range(1, len(parts) + 1):
            pose = pose * self._local("/".join(parts[:k]), samples)
        return pose

    def _local(self, entity: str, samples: int) -> RigidTransform:
        if entity not in self.entities():
            return RigidTransform.identity()
        present = {
            column.component.split(":")[1]
            for column in self.store.schema().component_columns()
            if column.entity_path == f"/{entity}" and column.component.startswith("Transform3D:")
        }
        position, turn = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]])
        if "translation" in present:
            position = self.column(entity, "Transform3D:translation")[1]
        if "quaternion" in present:
            turn = self.column(entity, "Transform3D:quaternion")[1]
        assert {len(position), len(turn)} <= {1, samples}
        return RigidTransform.from_components(
            np.broadcast_to(position, (samples, 3)), Rotation.from_quat(np.broadcast_to(turn, (samples, 4)))
        )


def payload_body(placed: Placed) -> RigidTransform:
    return placed.bodies[f"{PAYLOAD_PREFIX}payload"]


def robot_body(placed: Placed, robot: int, body: str) -> RigidTransform:
    return placed.bodies[f"omnid{robot}/{body}"]


def made(pictures: list[Picture] | str) -> list[np.ndarray]:
    """Pictures as whole numbers; skips where not even an empty room can be rendered, and fails where it can."""
    if not isinstance(pictures, str):
        return [picture.astype(int) for picture in pictures]
    room = mujoco.MjModel.from_xml_string("<mujoco/>")
    words = render(room, [np.zeros(0)], Camera((0.0, 0.0, 0.0), 1.0, 0.0, 0.0), width=32, height=32)
    if isinstance(words, str):
        pytest.skip(words)
    raise AssertionError(pictures)
