"""Ground truth of payload and robots, read from the compiled MuJoCo model, and its sidecar file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from estimator.files import write_json
from mocobot_sim.control.control import Stability
from mocobot_sim.effects import Effect, effect_to_dict
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.models import posed
from mocobot_sim.scene.models import truth_path as truth_path
from mocobot_sim.scene.payload import PayloadJoint, payload_joint
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import PAYLOAD_PREFIX, TeamIndex


@dataclass(frozen=True)
class BodyTruth:
    """One body of a payload of two, in the grasp frame {k} of its first robot k.

    Attributes:
        robots: numbers of the robots that hold the body, from 1; the first is k.
        R_ki, p_ki: orientations, shape (n, 3, 3), and positions [m], shape (n, 3), of their grasps in {k}.
        mass_kg: mass [kg].
        p_kc: centre of mass in {k} [m], shape (3,).
        inertia_k: inertia about the centre of mass in the axes of {k} [kg m^2], shape (3, 3).
    """

    robots: tuple[int, ...]
    R_ki: Array
    p_ki: Array
    mass_kg: float
    p_kc: Array
    inertia_k: Array

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON values."""
        return {
            "robots": list(self.robots),
            "grasps": _grasps(self.R_ki, self.p_ki, "k"),
            "mass_kg": self.mass_kg,
            "p_kc_m": self.p_kc.tolist(),
            "inertia_k_kgm2": self.inertia_k.tolist(),
        }


@dataclass(frozen=True)
class GroundTruth:
    """Payload and robots as simulated.

    Without payload N is 0, and all numbers of the payload are zero. Grasps, centre of mass and inertia of a payload of
    two bodies are those of the whole with the joint at zero.

    Attributes:
        R_1i: grasp orientations in {1}, shape (N, 3, 3).
        p_1i: grasp positions in {1} [m], shape (N, 3).
        mass_kg: mass [kg].
        p_1c: centre of mass in {1} [m], shape (3,).
        R_1c: principal axes in {1} as columns, in the order of the moments, shape (3, 3).
        principal_kgm2: principal moments of inertia in ascending order [kg m^2], shape (3,).
        units: how each robot deviates from the design, one entry per robot.
        effects: effects that were added to the team.
        control: least damped mode of the trial's control loop; None if unknown.
        bodies: the two bodies of a payload with a joint; empty for a rigid payload.
        joint: joint between them; None for a rigid payload.
        position: position of the joint in a trial, one per row of its recording [rad or m], shape (Q,); None if
            unknown.
    """

    R_1i: Array
    p_1i: Array
    mass_kg: float
    p_1c: Array
    R_1c: Array
    principal_kgm2: Array
    units: tuple[AsBuilt, ...]
    effects: tuple[Effect, ...] = ()
    control: Stability | None = None
    bodies: tuple[BodyTruth, ...] = ()
    joint: PayloadJoint | None = None
    position: Array | None = None

    @classmethod
    def of(cls, scene: TeamScene) -> GroundTruth:
        """Read the truth from the compiled scene."""
        if not scene.carries:
            none, zero = np.zeros((0, 3)), np.zeros(3)
            return cls(np.zeros((0, 3, 3)), none, 0.0, zero, np.eye(3), zero, scene.units, scene.effects)
        model = scene.compile()
        data = posed(model)
        index = TeamIndex.of(model)
        body = index.payload_body
        R_W = data.site_xmat[index.payload_site].reshape(-1, 3, 3)
        p_W = data.site_xpos[index.payload_site]
        R_1W = R_W[0].T
        joint = payload_joint(model, PAYLOAD_PREFIX)
        if joint is not None:
            return cls._of_two(scene, model, data, index, joint)
        R_1c = R_1W @ data.ximat[body].reshape(3, 3)
        order = np.argsort(model.body_inertia[body])
        R_1c = R_1c[:, order]
        R_1c[:, 2] = np.cross(R_1c[:, 0], R_1c[:, 1])
        return cls(
            R_1i=R_1W @ R_W,
            p_1i=(p_W - p_W[0]) @ R_1W.T,
            mass_kg=float(model.body_mass[body]),
            p_1c=R_1W @ (data.xipos[body] - p_W[0]),
            R_1c=R_1c,
            principal_kgm2=model.body_inertia[body][order].copy(),
            units=scene.units,
            effects=scene.effects,
        )

    @classmethod
    def _of_two(
        cls,
        scene: TeamScene,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        index: TeamIndex,
        joint: PayloadJoint,
    ) -> GroundTruth:
        ids = (index.payload_body, int(model.jnt_bodyid[joint.joint]))
        R_W, p_W = data.site_xmat[index.payload_site].reshape(-1, 3, 3), data.site_xpos[index.payload_site]
        bodies, second = [], np.array(joint.second)
        for body, held in zip(ids, (~second, second), strict=True):
            robots = np.flatnonzero(held)
            R_kW, p_k = R_W[robots[0]].T, p_W[robots[0]]
            R_kc = R_kW @ data.ximat[body].reshape(3, 3)
            bodies.append(
                BodyTruth(
                    tuple(int(robot) + 1 for robot in robots),
                    R_kW @ R_W[robots],
                    (p_W[robots] - p_k) @ R_kW.T,
                    float(model.body_mass[body]),
                    R_kW @ (data.xipos[body] - p_k),
                    (R_kc * model.body_inertia[body]) @ R_kc.T,
                )
            )
        R_1W, mass = R_W[0].T, np.array([body.mass_kg for body in bodies])
        centres = (data.xipos[list(ids)] - p_W[0]) @ R_1W.T
        p_1c, inertia = mass @ centres / mass.sum(), np.zeros((3, 3))
        for body, p, m in zip(ids, centres - p_1c, mass, strict=True):
            R = R_1W @ data.ximat[body].reshape(3, 3)
            inertia += (R * model.body_inertia[body]) @ R.T + m * (p @ p * np.eye(3) - np.outer(p, p))
        moments, R_1c = np.linalg.eigh(inertia)
        R_1c[:, 2] = np.cross(R_1c[:, 0], R_1c[:, 1])
        return cls(
            R_1W @ R_W, (p_W - p_W[0]) @ R_1W.T, float(mass.sum()), p_1c, R_1c, moments, scene.units, scene.effects,
            bodies=tuple(bodies), joint=joint,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON values; keys give the units, orientations are rotation vectors in degrees.

        Without payload there are only the keys ``as_built``, ``effects`` and ``control``.
        """
        payload = {
            "grasps": _grasps(self.R_1i, self.p_1i, "1"),
            "mass_kg": self.mass_kg,
            "p_1c_m": self.p_1c.tolist(),
            "R_1c_rotvec_deg": _rotvec_deg(self.R_1c),
            "principal_inertia_kgm2": self.principal_kgm2.tolist(),
        }
        robots = {
            "as_built": [unit.to_dict() for unit in self.units],
            "effects": [effect_to_dict(effect) for effect in self.effects],
        } | ({} if self.control is None else {"control": self.control.to_dict()})
        if self.joint is not None:
            payload |= {"bodies": [body.to_dict() for body in self.bodies], "joint": self._joint(self.joint)}
        return payload | robots if len(self.p_1i) else robots

    def _joint(self, joint: PayloadJoint) -> dict[str, Any]:
        k = self.bodies[1].robots[0] - 1
        R_k1, unit = self.R_1i[k].T, ("N", "m") if joint.slides else ("Nm", "rad")
        position = {} if self.position is None else {f"position_{unit[1]}": self.position.tolist()}
        return {
            "type": "slide" if joint.slides else "hinge",
            "axis_1": joint.axis_1.tolist(),
            "pivot_1_m": joint.pivot_1.tolist(),
            "axis_k": (R_k1 @ joint.axis_1).tolist(),
            "pivot_k_m": (R_k1 @ (joint.pivot_1 - self.p_1i[k])).tolist(),
            f"stiffness_{unit[0]}_per_{unit[1]}": joint.stiffness,
            f"damping_{unit[0]}s_per_{unit[1]}": joint.damping,
            f"rest_{unit[1]}": joint.rest,
        } | position


def write_truth(truth: GroundTruth, recording: Path) -> None:
    """Write the ground truth to the sidecar file of a recording; the estimator never reads it.

    Raises:
        InputError: the file cannot be written.
    """
    write_json(truth_path(recording), truth.to_dict())


def _grasps(R: Array, p: Array, frame: str) -> list[dict[str, list[float]]]:
    """Grasps as JSON values, in the frame of that name."""
    return [
        {f"p_{frame}i_m": one.tolist(), f"R_{frame}i_rotvec_deg": _rotvec_deg(turn)}
        for one, turn in zip(p, R, strict=True)
    ]


def _rotvec_deg(R: Array) -> list[float]:
    return Rotation.from_matrix(R).as_rotvec(degrees=True).tolist()
