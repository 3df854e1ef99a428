"""The truth of a simulated team as a calibration states it: in the frames that the encoders define."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.unit import AT, COUNT
from estimator.arrays import Array, inertia_matrix, inertia_parameters


@dataclass(frozen=True)
class Truth:
    """Of one team and payload; {i} here is {i} as built, turned about its x axis by the zero of theta_x.

    Attributes:
        R_1i, p_1i: grasps, shapes (N, 3, 3), (N, 3).
        mass: [kg].
        p_1c: centre of mass [m], shape (3,).
        inertia: about it, axes of {1} [kg m^2], shape (3, 3).
        units: deviations of the robots, shape (N, ``COUNT``), the mean of all spring ratios included.
    """

    R_1i: Array
    p_1i: Array
    mass: float
    p_1c: Array
    inertia: Array
    units: Array

    @property
    def scale(self) -> float:
        """Mean of all spring ratios, which a calibration without a known weight takes to be 0."""
        return float(self.units[:, AT["stiffness_ratio"]].mean())

    @classmethod
    def of(cls, told: dict[str, Any], *, encoder_frames: bool = True) -> Truth:
        """From a recording's truth file; ``encoder_frames`` off leaves the frames as built."""
        rotvecs = [grasp["R_1i_rotvec_deg"] for grasp in told["grasps"]]
        R = Rotation.from_rotvec(rotvecs, degrees=True).as_matrix()
        p = np.array([grasp["p_1i_m"] for grasp in told["grasps"]])
        units = np.array([_unit(one) for one in told["as_built"]])
        for effect in (one for one in told["effects"] if one["cause"] == "base_tilt"):
            units[effect["robot"] - 1, AT["tilt"]] = [
                effect["parameters"][k] for k in ("roll_rad", "pitch_rad")
            ]
        R_1c = Rotation.from_rotvec(told["R_1c_rotvec_deg"], degrees=True).as_matrix()
        inertia = R_1c @ np.diag(told["principal_inertia_kgm2"]) @ R_1c.T
        zeros = [one["theta_zero_rad"][2] if encoder_frames else 0.0 for one in told["as_built"]]
        turn = Rotation.from_rotvec(np.outer(zeros, [1.0, 0.0, 0.0])).as_matrix()
        back = turn[0].T
        return cls(
            back @ R @ turn,
            p @ back.T,
            told["mass_kg"],
            back @ told["p_1c_m"],
            back @ inertia @ back.T,
            units,
        )

    @property
    def parameters(self) -> Array:
        """(m, m p_1c, J about {1}), shape (10,)."""
        c = self.p_1c
        J = self.inertia + self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        return np.concatenate([[self.mass], self.mass * c, inertia_parameters(J)])


def _unit(built: dict[str, Any]) -> Array:
    x = np.zeros(COUNT)
    x[AT["phi_zero"]], x[AT["theta_zero"]] = built["phi_zero_rad"], built["theta_zero_rad"]
    x[AT["theta_zero"].stop - 1] = 0.0
    x[AT["radius"]] = np.subtract(built["base_radius_m"], built["platform_radius_m"])
    x[AT["proximal_length"]], x[AT["rod_length"]] = built["proximal_length_m"], built["rod_length_m"]
    x[AT["stiffness_ratio"]], x[AT["tau_zero"]] = built["stiffness_ratio"], built["tau_zero_Nm"]
    for name in ("proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio"):
        x[AT[name]] = built[name]
    return x


def centred(parameters: Array) -> Array:
    """(m, p_1c, inertia about the centre of mass: xx, xy, xz, yy, yz, zz) from (m, m p_1c, J about {1})."""
    m, c = parameters[0], parameters[1:4] / parameters[0]
    inertia = inertia_matrix(parameters[4:]) - m * (c @ c * np.eye(3) - np.outer(c, c))
    return np.concatenate([[m], c, inertia_parameters(inertia)])


def principal(inertia: Array) -> Array:
    """Principal moments, ascending, from xx, xy, xz, yy, yz, zz."""
    return np.asarray(np.linalg.eigvalsh(inertia_matrix(inertia)), dtype=float)
