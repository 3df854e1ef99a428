"""Compose a team scene: one parked Omnid under every grasp of a payload (PyMJCF)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

from estimator.errors import InputError
from mocobot_sim.as_built import AsBuilt, units_of
from mocobot_sim.models import models_dir, omnid_design
from mocobot_sim.payload import grasp_frames, load_payload
from mocobot_sim.pymjcf import mjcf

Array = NDArray[np.float64]

TIMESTEP_S = 0.001
STIFF = {"solref": [0.004, 1.0], "solimp": [0.9999, 0.9999, 0.001, 0.5, 2.0]}
BASE_JOINTS = ("base_x", "base_y", "base_yaw")
WHEELS = ("wheel_front_left", "wheel_front_right", "wheel_rear_left", "wheel_rear_right")


@dataclass(frozen=True)
class TeamScene:
    """A composed team.

    Attributes:
        root: PyMJCF tree, open to further edits (compile again with ``mujoco.MjModel.from_xml_string``).
        robots: number of robots N.
        wrist_home_b: wrist position of every robot in its own {b} at home [m], shape (N, 3).
        theta_home: gimbal angles (z, y, x) at home [rad], shape (N, 3).
        X_1i: grasp frames in {1}, N transforms.
        units: how each robot deviates from the design, N entries.
    """

    root: mjcf.RootElement
    robots: int
    wrist_home_b: Array
    theta_home: Array
    X_1i: RigidTransform
    units: tuple[AsBuilt, ...]

    def to_xml(self) -> str:
        """The scene as one MJCF document that loads in plain MuJoCo."""
        return self.root.to_xml_string()

    def compile(self) -> mujoco.MjModel:
        """Compile a fresh MuJoCo model.

        Raises:
            InputError: MuJoCo accepts the payload alone, but not in the team.
        """
        try:
            return mujoco.MjModel.from_xml_string(self.to_xml(), self.root.get_assets())
        except ValueError as error:
            raise InputError(f"MuJoCo cannot compile the team ({' '.join(str(error).split())})") from error


def build_team(
    payload: str | Path, as_built: Sequence[AsBuilt] = (), timestep_s: float = TIMESTEP_S
) -> TeamScene:
    """Park one Omnid under each grasp of a payload and weld the payload to their gimbals.

    All bases stand on one floor, turned so that their gimbals are at theta_z = 0 in the home pose; where
    grasps differ in height, the wrists do, around the home height. The payload is a child of robot 1's
    flange; a weld ties each other flange to its grasp.

    Args:
        payload: name of a shipped payload, or path of an MJCF with a body ``payload`` at {1} and sites
            ``grasp1`` .. ``graspN``.
        as_built: deviations from the design, one per robot; empty for robots as designed.
        timestep_s: integration step [s].

    Raises:
        InputError: the payload cannot be read, has no grasps or one that is tilted beyond the gimbal's range, or
            ``as_built`` does not match their number.
    """
    payload_root = load_payload(payload)
    X_1i = grasp_frames(payload_root, str(payload))
    robots = len(X_1i)
    units = units_of(as_built, robots)

    design = omnid_design()
    root = mjcf.from_path(str(models_dir() / "team.xml"))
    root.option.timestep = timestep_s

    grasp_z = X_1i.translation[:, 2]
    theta_home = X_1i.rotation.as_euler("ZYX", suppress_warnings=True)
    _check_tilts(theta_home[:, 1:], design.gimbal_limit_rad, str(payload))
    wrist_home_b = np.zeros((robots, 3))
    wrist_home_b[:, 2] = design.home_height_m + grasp_z - grasp_z.mean()
    for i in range(robots):
        omnid = mjcf.from_path(str(models_dir() / "omnid" / "omnid.xml"))
        omnid.model = f"omnid{i + 1}"
        _deviate(omnid, units[i])
        _park(omnid)
        yaw = theta_home[i, 0]
        mount = root.worldbody.add(
            "site", name=f"mount{i + 1}", group=4, pos=[*X_1i.translation[i, :2], 0.0],
            quat=[np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)],
        )  # fmt: skip
        mount.attach(omnid)
        if i == 0:
            try:
                omnid.find("site", "grasp").attach(payload_root)
            except ValueError as error:
                raise InputError(
                    f"{payload}: the payload does not fit into the team's scene ({error})"
                ) from error
        else:
            root.equality.add(
                "weld", name=f"grasp{i + 1}", **STIFF,
                site1=omnid.find("site", "grasp"), site2=payload_root.find("site", f"grasp{i + 1}"),
            )  # fmt: skip
    theta_home = theta_home.copy()
    theta_home[:, 0] = 0.0
    return TeamScene(root, robots, wrist_home_b, theta_home, X_1i, units)


def _check_tilts(tilts: Array, limit_rad: float, where: str) -> None:
    over = np.flatnonzero(~(np.abs(tilts) <= limit_rad).all(axis=1))
    if len(over):
        degrees = ", ".join(f"{angle:.1f}" for angle in np.rad2deg(tilts[over[0]]))
        raise InputError(
            f"{where}: grasp{over[0] + 1} asks for gimbal angles (y, x) of ({degrees}) deg at home; "
            f"the gimbal ends at {np.rad2deg(limit_rad):.1f} deg"
        )


def _park(omnid: mjcf.RootElement) -> None:
    """Lock base and wheels to the floor, exactly and at no cost: a parked joint is one that is not there."""
    for name in (*BASE_JOINTS, *WHEELS):
        omnid.find("joint", name).remove()


def _deviate(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Move one unit's geometry and springs off their design values."""
    for k in range(3):
        azimuth = 2.0 * np.pi * k / 3.0
        u = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        proximal = omnid.find("body", f"proximal{k + 1}")
        proximal.pos = proximal.pos + unit.base_radius_m[k] * u
        rod = omnid.find("body", f"rod{k + 1}")
        rod.pos = rod.pos + np.array([unit.proximal_length_m[k], 0.0, 0.0])
        tip = omnid.find("site", f"rod{k + 1}_tip")
        tip.pos = tip.pos + np.array([unit.rod_length_m[k], 0.0, 0.0])
        platform = omnid.find("site", f"platform{k + 1}")
        platform.pos = platform.pos + unit.platform_radius_m[k] * u
        spring = omnid.find("joint", f"spring{k + 1}")
        spring.stiffness = omnid_design().sea_stiffness_Nm_per_rad * (1.0 + unit.stiffness_ratio[k])
