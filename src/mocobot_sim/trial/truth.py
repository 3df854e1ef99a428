"""Ground truth of payload and robots, read from the compiled MuJoCo model, and its sidecar file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from estimator.files import write_json
from mocobot_sim.control.control import Stability
from mocobot_sim.effects import Effect, effect_to_dict
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.models import posed
from mocobot_sim.scene.models import truth_path as truth_path
from mocobot_sim.scene.scene import TeamScene
from mocobot_sim.scene.team_index import TeamIndex


@dataclass(frozen=True)
class GroundTruth:
    """Payload and robots as simulated.

    Without payload N is 0, and all numbers of the payload are zero.

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

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON values; keys give the units, orientations are rotation vectors in degrees.

        Without payload there are only the keys ``as_built``, ``effects`` and ``control``.
        """
        payload = {
            "grasps": [
                {"p_1i_m": p.tolist(), "R_1i_rotvec_deg": _rotvec_deg(R)}
                for p, R in zip(self.p_1i, self.R_1i, strict=True)
            ],
            "mass_kg": self.mass_kg,
            "p_1c_m": self.p_1c.tolist(),
            "R_1c_rotvec_deg": _rotvec_deg(self.R_1c),
            "principal_inertia_kgm2": self.principal_kgm2.tolist(),
        }
        robots = {
            "as_built": [unit.to_dict() for unit in self.units],
            "effects": [effect_to_dict(effect) for effect in self.effects],
        } | ({} if self.control is None else {"control": self.control.to_dict()})
        return payload | robots if len(self.p_1i) else robots


def write_truth(truth: GroundTruth, recording: Path) -> None:
    """Write the ground truth to the sidecar file of a recording; the estimator never reads it.

    Raises:
        InputError: the file cannot be written.
    """
    write_json(truth_path(recording), truth.to_dict())


def _rotvec_deg(R: Array) -> list[float]:
    return Rotation.from_matrix(R).as_rotvec(degrees=True).tolist()
