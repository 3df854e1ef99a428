"""Compose a team scene: Omnids under the grasps of a payload, or in a row with nothing to hold (PyMJCF)."""

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
from mocobot_sim.scene.payload import grasp_frames, load_payload
from mocobot_sim.scene.pymjcf import mjcf
from mocobot_sim.scene.soft import STIFF, SoftRow, tune

TIMESTEP_S = 0.001


@dataclass(frozen=True)
class TeamScene:
    """A composed team.

    Attributes:
        root: PyMJCF tree, open to further edits (compile again with ``mujoco.MjModel.from_xml_string``); None for a
            scene that was read from an extended model.
        robots: number of robots N.
        wrist_home_b: wrist position of every robot in its own {b} at home [m], shape (N, 3).
        theta_home: gimbal angles (z, y, x) at home [rad], shape (N, 3).
        X_1i: grasp frames in {1}, N transforms; flanges without their gimbals' turn where nothing is held.
        units: how each robot deviates from the design, N entries.
        mounts: pose of every robot's place on the floor in the world, before any tilt; N transforms.
        initial: true (phi, theta) near which a trial starts [rad], two arrays (N, 3); None for home.
        sensors: timing faults of the sensors.
        grasp_slack_m: by how much each grasp may open in a sound trial, beyond a weld's softness [m], N entries;
            empty for none.
        grasp_slack_rad: by how much each grasp may turn in it, beyond a weld's softness [rad], N entries; empty for
            none.
        soft: springs and dampers that are soft constraints.
        effects: what was applied to the team (``mocobot_sim.effects.Effect``).
        xml: the scene's MJCF if ``root`` is None.
        assets: files that ``xml`` refers to, by name.
        carries: whether there is a payload; ``build_free_team`` makes teams without.
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
        """Every robot's {b} in the world as its floor mount has it, without any tilt; N transforms."""
        return self.mounts * RigidTransform.from_translation([0.0, 0.0, base_height_m()])

    def to_xml(self) -> str:
        """The scene as one MJCF document that loads in plain MuJoCo."""
        return self.root.to_xml_string() if self.xml is None else self.xml

    def compile(self) -> mujoco.MjModel:
        """Compile a fresh MuJoCo model.

        Raises:
            InputError: MuJoCo accepts the payload alone, but not in the team.
        """
        assets = self.root.get_assets() if self.xml is None else dict(self.assets)
        try:
            return mujoco.MjModel.from_xml_string(self.to_xml(), assets)
        except ValueError as error:
            raise InputError(f"MuJoCo cannot compile the team ({' '.join(str(error).split())})") from error

    def sprung(self, equality: str, compliance: float, relaxation_s: float) -> TeamScene:
        """The scene with an ``equality`` of its tree as a spring; arguments as of ``SoftRow``."""
        row = SoftRow(equality, compliance=compliance, relaxation_s=relaxation_s)
        return replace(self, soft=(*self.soft, row))

    def damped(self, equality: str, damping: float) -> TeamScene:
        """The scene with an ``equality`` of its tree as a damper; arguments as of ``SoftRow``."""
        return replace(self, soft=(*self.soft, SoftRow(equality, damping=damping)))

    def tuned(self) -> TeamScene:
        """The scene with every soft row set for the inertias that it has now, in place."""
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
    """Park one Omnid under each grasp of a payload and weld the payload to their gimbals.

    All bases stand on one floor, turned so that their gimbals are at theta_z = 0 in the home pose; where
    grasps differ in height, the wrists do, around the home height. The payload is a child of robot 1's
    flange; a weld ties each other flange to its grasp.

    Args:
        payload: name of a shipped payload, or path of an MJCF with a body ``payload`` at {1} and sites
            ``grasp1`` .. ``graspN``, or such an MJCF as a PyMJCF root (``payload_mjcf`` makes one; it becomes part of
            the team).
        as_built: deviations from the design, one per robot; empty for robots as designed.
        timestep_s: integration step [s].
        mounts: where the robots stand, floor mounts in the world, N transforms; None to place them under the grasps.
        initial: true (phi, theta) near which trials start, two arrays (N, 3) [rad]; None for home. With ``mounts`` of
            one's own, home may not close the loops; a measured posture does nearly.
        released: robots stand on their wheels and can drive (see docs/base.md), instead of being part of the floor.

    Raises:
        InputError: the payload cannot be read, has no grasps or one that is tilted beyond the gimbal's range, or
            ``as_built``, ``mounts`` or ``initial`` do not match their number.
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
    """Wrists [m] and gimbals [rad] at home, shapes (N, 3); where the robots stand, and its quaternions as MJCF."""
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
    # Robot 1 holds its grasp unturned, and the others are where the payload then wants them.
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
"""Distance of neighbours in the row: no two arms can touch."""
MOST_ROBOTS = 100


def build_free_team(
    robots: int,
    as_built: Sequence[AsBuilt] = (),
    theta: ArrayLike | None = None,
    timestep_s: float = TIMESTEP_S,
) -> TeamScene:
    """Park Omnids in a row along x, with nothing on their flanges.

    The gimbals are as in every team: passive, without friction or springs, each of their bodies balanced about the
    wrist. A platform only translates, so neither gravity nor the arm's motion turns them: they stay as they are left,
    and what they weigh is carried by the wrist.

    Args:
        robots: how many.
        as_built: deviations from the design, one per robot; empty for robots as designed.
        theta: gimbal angles (z, y, x) as they are left [rad], shape (N, 3); None for zero.
        timestep_s: integration step [s].

    Raises:
        InputError: a number of robots out of range, or ``as_built`` or ``theta`` does not match it.
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
    """Refuse a number of robots before anything of that size is made.

    Raises:
        InputError: it is out of range.
    """
    if not 1 <= robots <= MOST_ROBOTS:
        raise InputError(f"robots is {robots}; it must be at least 1 and at most {MOST_ROBOTS}")
