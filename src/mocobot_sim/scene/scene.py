"""Compose a team scene with PyMJCF: Omnids under the grasps of a payload, or in a row without payload."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.base.design import base_design
from mocobot_sim.scene.as_built import AsBuilt, SensorEffects, deviate, units_of
from mocobot_sim.scene.models import base_height_m, models_dir, omnid_design
from mocobot_sim.scene.omnid import load_omnid, park, release, rough_floor, stand
from mocobot_sim.scene.payload import PayloadJoint, grasp_frames, load_payload, payload_joint
from mocobot_sim.scene.pymjcf import mjcf
from mocobot_sim.scene.soft import STIFF, SoftRow, tune
from mocobot_sim.scene.team_index import PAYLOAD_PREFIX

TIMESTEP_S = 0.001
"""Default integration step [s]. Chosen."""


@dataclass(frozen=True)
class TeamScene:
    """A composed team.

    Attributes:
        root: PyMJCF tree, which may be edited before ``compile``; None for a scene read from an extended model.
        robots: number of robots N.
        wrist_home_b: wrist position of every robot in its own {b} at home [m], shape (N, 3).
        theta_home: gimbal angles (z, y, x) at home [rad], shape (N, 3).
        X_1i: grasp frames in {1}, N transforms; without payload, the flanges at zero gimbal angles.
        units: deviations of each robot from the design, N entries.
        mounts: floor mount of every robot in the world, without base tilt; N transforms.
        initial: true (phi, theta) near which a trial starts [rad], two arrays (N, 3); None for home.
        sensors: timing faults of the sensors.
        grasp_slack_m: allowed gap of each grasp in a trial, beyond the tolerance of a weld [m], N entries; empty for
            none.
        grasp_slack_rad: allowed angle of each grasp in a trial, beyond the tolerance of a weld [rad], N entries; empty
            for none.
        soft: springs and dampers implemented as soft constraints.
        effects: effects of the team (``mocobot_sim.effects.Effect``).
        xml: MJCF of the scene if ``root`` is None.
        assets: contents of the files that ``xml`` refers to, by name.
        carries: whether there is a payload; ``build_free_team`` makes teams without one.
    """

    root: mjcf.RootElement | None
    robots: int
    wrist_home_b: Array
    theta_home: Array
    X_1i: RigidTransform
    units: tuple[AsBuilt, ...]
    mounts: RigidTransform
    initial: tuple[Array, Array] | None = None
    sensors: SensorEffects = field(default_factory=SensorEffects)
    grasp_slack_m: tuple[float, ...] = ()
    grasp_slack_rad: tuple[float, ...] = ()
    soft: tuple[SoftRow, ...] = ()
    effects: tuple[Any, ...] = ()
    xml: str | None = None
    assets: Mapping[str, bytes] = field(default_factory=dict)
    carries: bool = True

    @property
    def X_Wb(self) -> RigidTransform:
        """Frame {b} of every robot in the world without base tilt, N transforms."""
        return self.mounts * RigidTransform.from_translation([0.0, 0.0, base_height_m()])

    def to_xml(self) -> str:
        """Write the scene as one MJCF document that plain MuJoCo can load."""
        return self.root.to_xml_string() if self.xml is None else self.xml

    def compile(self) -> mujoco.MjModel:
        """Compile a fresh MuJoCo model.

        Raises:
            InputError: MuJoCo cannot compile the scene.
        """
        assets = self.root.get_assets() if self.xml is None else dict(self.assets)
        try:
            return mujoco.MjModel.from_xml_string(self.to_xml(), assets)
        except ValueError as error:
            raise InputError(f"MuJoCo cannot compile the team ({' '.join(str(error).split())})") from error

    def payload_joint(self) -> PayloadJoint | None:
        """Read the joint of a payload of two bodies; None for a rigid payload or none."""
        return payload_joint(self.compile(), PAYLOAD_PREFIX) if self.carries else None

    def sprung(self, equality: str, compliance: float, relaxation_s: float) -> TeamScene:
        """Return the scene with a spring at an ``equality`` of its tree; arguments as in ``SoftRow``."""
        row = SoftRow(equality, compliance=compliance, relaxation_s=relaxation_s)
        return replace(self, soft=(*self.soft, row))

    def damped(self, equality: str, damping: float) -> TeamScene:
        """Return the scene with a damper at an ``equality`` of its tree; arguments as in ``SoftRow``."""
        return replace(self, soft=(*self.soft, SoftRow(equality, damping=damping)))

    def tuned(self) -> TeamScene:
        """Set the parameters of all soft rows for the current inertias, in place, and return the scene."""
        if self.root is not None and self.soft:
            tune(self.root, self.compile(), self.soft)
        return self


def build_team(
    payload: str | Path | mjcf.RootElement,
    as_built: Sequence[AsBuilt] = (),
    timestep_s: float = TIMESTEP_S,
    mounts: RigidTransform | None = None,
    initial: tuple[Array, Array] | None = None,
    released: bool = False,
) -> TeamScene:
    """Build a scene with one Omnid under each grasp of a payload.

    All bases stand on one floor. Their headings give theta_z = 0 for all gimbals in the home pose. If grasps differ in
    height, the wrists differ around the home height. The payload is a child of robot 1's flange; welds connect the
    other flanges to their grasps.

    Args:
        payload: name of a shipped payload, or path of an MJCF with a body ``payload`` at {1} and sites
            ``grasp1`` .. ``graspN``, or such an MJCF as a PyMJCF root (see ``payload_mjcf``), which becomes part of
            the scene.
        as_built: deviations from the design, one per robot; empty for robots as designed.
        timestep_s: integration step [s].
        mounts: floor mounts of the robots in the world, N transforms; None to place them under the grasps.
        initial: true (phi, theta) near which trials start [rad], two arrays (N, 3); None for home. With given
            ``mounts`` the home pose may not close the loops, so give a measured posture.
        released: whether the robots stand on their wheels and can drive (see docs/base.md) instead of being fixed to
            the floor.

    Raises:
        InputError: the payload cannot be read, has no grasps, or has a grasp tilted beyond the gimbal's range; or
            ``as_built``, ``mounts`` or ``initial`` do not match the number of grasps.
    """
    if isinstance(payload, mjcf.RootElement):
        payload_root, label = payload, "payload"
        payload_root.model = "payload"
    else:
        payload_root, label = load_payload(payload), str(payload)
    X_1i = grasp_frames(payload_root, label)
    robots = len(X_1i)
    units = units_of(as_built, robots)
    _check_numbers(robots, mounts, initial)

    design = omnid_design()
    root = mjcf.from_path(str(models_dir() / "team.xml"))
    root.option.timestep = timestep_s

    wrist_home_b, theta_home, mounts, mount_quats = _home(X_1i, mounts)
    _check_tilts(theta_home[:, 1:], design.gimbal_limit_rad, label)
    for i in range(robots):
        omnid = load_omnid(i + 1)
        deviate(omnid, units[i])
        if released:
            release(omnid, base_design())
        else:
            park(omnid)
        frame = stand(root, omnid, mounts[i].translation, mount_quats[i])
        if released:
            frame.add("freejoint")
        if i == 0:
            try:
                omnid.find("site", "grasp").attach(payload_root)
            except ValueError as error:
                raise InputError(
                    f"{label}: the payload does not fit into the team's scene ({error})"
                ) from error
        else:
            root.equality.add(
                "weld", name=f"grasp{i + 1}", **STIFF,
                site1=omnid.find("site", "grasp"), site2=payload_root.find("site", f"grasp{i + 1}"),
            )  # fmt: skip
    if released:
        rough_floor(root, base_design())
    return TeamScene(root, robots, wrist_home_b, theta_home, X_1i, units, mounts, initial)


def _home(X_1i: RigidTransform, mounts: RigidTransform | None) -> tuple[Array, Array, RigidTransform, Array]:
    """Wrist positions [m] and gimbal angles [rad] at home, shapes (N, 3), mounts, and their quaternions (w first)."""
    height = omnid_design().home_height_m
    grasp_z = X_1i.translation[:, 2]
    if mounts is None:
        theta = X_1i.rotation.as_euler("ZYX", suppress_warnings=True)
        wrist = np.zeros((len(X_1i), 3))
        wrist[:, 2] = height + grasp_z - grasp_z.mean()
        places = X_1i.translation * [1.0, 1.0, 0.0]
        half = 0.5 * theta[:, 0]
        quats = np.stack([np.cos(half), 0.0 * half, 0.0 * half, np.sin(half)], axis=1)
        mounts = RigidTransform.from_components(places, Rotation.from_quat(quats, scalar_first=True))
        theta = theta.copy()
        theta[:, 0] = 0.0
        return wrist, theta, mounts, quats
    # The grasp of robot 1 is parallel to its {b}; this pose of the payload determines the other wrists.
    X_Wb = mounts * RigidTransform.from_translation([0.0, 0.0, base_height_m()])
    X_W1 = X_Wb[0] * RigidTransform.from_translation([0.0, 0.0, height - grasp_z.mean()])
    X_bi = X_Wb.inv() * X_W1 * X_1i
    theta = X_bi.rotation.as_euler("ZYX", suppress_warnings=True)
    return X_bi.translation, theta, mounts, mounts.rotation.as_quat(scalar_first=True)


def _check_numbers(robots: int, mounts: RigidTransform | None, initial: tuple[Array, Array] | None) -> None:
    if mounts is not None and (mounts.single or len(mounts) != robots):
        raise InputError(f"mounts are not {robots} transforms; the payload has {robots} grasps")
    for name, angles in zip(("phi", "theta"), initial or (), strict=False):
        if np.shape(angles) != (robots, 3) or not np.isfinite(angles).all():
            raise InputError(
                f"initial {name} is not {robots} x 3 finite angles; the payload has {robots} grasps"
            )


def _check_tilts(tilts: Array, limit_rad: float, where: str) -> None:
    over = np.flatnonzero(~(np.abs(tilts) <= limit_rad).all(axis=1))
    if len(over):
        degrees = ", ".join(f"{angle:.1f}" for angle in np.rad2deg(tilts[over[0]]))
        raise InputError(
            f"{where}: grasp{over[0] + 1} asks for gimbal angles (y, x) of ({degrees}) deg at home; "
            f"the gimbal ends at {np.rad2deg(limit_rad):.1f} deg"
        )


SPACING_M = 1.2
"""Distance between neighbouring robots in the row [m]. Chosen: arms cannot touch."""
MOST_ROBOTS = 100
"""Largest number of robots without payload. Chosen."""


def build_free_team(
    robots: int,
    as_built: Sequence[AsBuilt] = (),
    theta: ArrayLike | None = None,
    timestep_s: float = TIMESTEP_S,
) -> TeamScene:
    """Build a scene with parked Omnids in a row along x, without payload.

    The gimbals are passive, without friction or springs, and each gimbal body is balanced about the wrist. Platforms
    only translate, so neither gravity nor the motion of the arm turns a gimbal. Gimbals keep their initial angles, and
    the wrists carry their weight.

    Args:
        robots: number of robots.
        as_built: deviations from the design, one per robot; empty for robots as designed.
        theta: initial gimbal angles (z, y, x) [rad], shape (N, 3); None for zero.
        timestep_s: integration step [s].

    Raises:
        InputError: the number of robots is out of range, or ``as_built`` or ``theta`` does not match it.
    """
    check_robots(robots)
    units = units_of(as_built, robots)
    design = omnid_design()
    angles = np.zeros((robots, 3)) if theta is None else np.array(theta, dtype=float)
    if angles.shape != (robots, 3) or not (np.abs(angles) <= design.gimbal_limit_rad).all():
        raise InputError(
            f"theta is not {robots} x 3 angles of at most {design.gimbal_limit_rad:g} rad; it must be"
        )
    root = mjcf.from_path(str(models_dir() / "team.xml"))
    root.option.timestep = timestep_s
    places = np.zeros((robots, 3))
    places[:, 0] = SPACING_M * np.arange(robots)
    for i, unit in enumerate(units):
        omnid = load_omnid(i + 1)
        deviate(omnid, unit)
        park(omnid)
        stand(root, omnid, places[i], [1.0, 0.0, 0.0, 0.0])
    mounts = RigidTransform.from_translation(places)
    home = np.tile([0.0, 0.0, design.home_height_m], (robots, 1))
    return TeamScene(root, robots, home, angles, mounts, units, mounts, carries=False)


def check_robots(robots: int) -> None:
    """Check the number of robots, to be called before large arrays are allocated.

    Raises:
        InputError: the number is out of range.
    """
    if not 1 <= robots <= MOST_ROBOTS:
        raise InputError(f"robots is {robots}; it must be at least 1 and at most {MOST_ROBOTS}")
