"""Effects on the payload: springs to the world, pushes, drag, sloshing liquid, mass that changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from estimator.arrays import Array, inertia_matrix, inertia_parameters
from estimator.errors import InputError
from mocobot_sim.effects.base import Effect
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.trial.actors import Stage

if TYPE_CHECKING:
    import mujoco

    from mocobot_sim.scene.scene import TeamScene
    from mocobot_sim.scene.team_index import TeamIndex

PAYLOAD = "omnid1/payload/payload"
SITE_M, WIDTH_M = 0.006, 0.002
"""Size of the drawn sites and width of the drawn tendons [m]. Chosen: for looks only."""
SPRING_RANGES = {
    "stiffness_N_per_m": (0.0, 1e4),
    "length_m": (0.0, 100.0),
    "stiffening_N_per_m2": (-1e4, 1e6),
}
"""Allowed ranges of the parameters of a spring."""
LEAST_RATIO = 1e-6
"""Smallest over largest principal moment of a payload whose mass changes. Chosen: MuJoCo needs positive moments."""


def add_site(body: Any, name: str, at: Array | list[float]) -> Any:
    """Add a site to a body at a point given in the body's frame [m], shape (3,)."""
    return body.add("site", name=name, pos=at, group=4, size=[SITE_M])


def tie(
    scene: TeamScene,
    name: str,
    site: Any,
    anchor_W: Array,
    stiffness_N_per_m: float,
    length_m: float = 0.0,
    stiffening_N_per_m2: float = 0.0,
) -> None:
    """Connect a site and a fixed point of the world [m], shape (3,), by an elastic spatial tendon.

    The tendon is slack below its length. Stretched by d beyond it, it pulls with k d + s d^2, where k is the
    stiffness and s the stiffening.
    """
    anchor = add_site(scene.root.worldbody, name, anchor_W)
    tendon = scene.root.tendon.add(
        "spatial", name=name, stiffness=stiffness_N_per_m, springlength=[0.0, length_m], width=WIDTH_M
    )
    if stiffening_N_per_m2:
        tendon.stiffness = [stiffness_N_per_m, stiffening_N_per_m2]
    tendon.add("site", site=site)
    tendon.add("site", site=anchor)


@dataclass(frozen=True)
class Tether(Effect):
    """A spring between one grasp of the payload and a fixed point; with a length above zero, an elastic cable.

    Implemented as a spatial tendon between the payload's site ``grasp{i}`` and a site of the world. The tendon is
    slack below ``length_m``. Stretched by d beyond it, it pulls with k d + ``stiffening_N_per_m2`` d^2. With a length
    of zero the spring is isotropic. The anchor is a point in the robot's {b}, without base tilt [m].
    """

    on_payload = True
    ranges: ClassVar = SPRING_RANGES
    robot: int
    stiffness_N_per_m: float
    anchor_x_m: float
    anchor_y_m: float
    anchor_z_m: float
    length_m: float = 0.0
    stiffening_N_per_m2: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.stiffness_N_per_m or self.stiffening_N_per_m2:
            at = scene.X_Wb[self.robot - 1].apply([self.anchor_x_m, self.anchor_y_m, self.anchor_z_m])
            grasp = scene.root.find("site", f"omnid1/payload/grasp{self.robot}")
            strength = self.stiffness_N_per_m, self.length_m, self.stiffening_N_per_m2
            tie(scene, f"tether{self.robot}", grasp, at, *strength)
        return scene


@dataclass(frozen=True)
class PayloadTether(Effect):
    """A spring between any point of the payload and a fixed point; with a length above zero, an elastic cable.

    Implemented as a spatial tendon like that of ``Tether``. The point on the payload is given in {1} [m]. The anchor
    is a point in robot 1's {b}, without base tilt [m].
    """

    on_payload = True
    ranges: ClassVar = SPRING_RANGES
    stiffness_N_per_m: float
    anchor_x_m: float
    anchor_y_m: float
    anchor_z_m: float
    point_x_m: float
    point_y_m: float
    point_z_m: float
    length_m: float = 0.0
    stiffening_N_per_m2: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        if self.stiffness_N_per_m or self.stiffening_N_per_m2:
            at = scene.X_Wb[0].apply([self.anchor_x_m, self.anchor_y_m, self.anchor_z_m])
            point = [self.point_x_m, self.point_y_m, self.point_z_m]
            site = add_site(scene.root.find("body", PAYLOAD), "payload_tether", point)
            strength = self.stiffness_N_per_m, self.length_m, self.stiffening_N_per_m2
            tie(scene, "payload_tether", site, at, *strength)
        return scene


@dataclass(frozen=True)
class Push(Effect):
    """A constant force on the payload during one interval of one trial, with linear ramps of ``ramp_s`` at both ends.

    MJCF cannot express it: the trial writes ``xfrc_applied``. The force is given in the axes of robot 1's {b}, without
    base tilt [N]. It acts at a point fixed to the payload and given in {1} [m].
    """

    on_payload = True
    repeats = True
    ranges: ClassVar = {"start_s": (0.0, 1e9), "duration_s": (0.0, 1e9), "ramp_s": (0.0, 1e9)}
    trial: int
    start_s: float
    duration_s: float
    force_x_N: float = 0.0
    force_y_N: float = 0.0
    force_z_N: float = 0.0
    point_x_m: float = 0.0
    point_y_m: float = 0.0
    point_z_m: float = 0.0
    ramp_s: float = 0.0

    def acts(self, time: float) -> bool:
        """Whether the force acts at a time [s]."""
        return self.start_s <= time + 1e-9 < self.start_s + self.duration_s

    def act(self, data: mujoco.MjData, body: int, R_Wb1: Array) -> None:
        """Add the force to the row of ``data.xfrc_applied`` that belongs to the payload.

        Args:
            data: MuJoCo data with the kinematics of this instant.
            body: id of the payload's body.
            R_Wb1: orientation of robot 1's {b} in the world, shape (3, 3).
        """
        since, left = data.time - self.start_s, self.start_s + self.duration_s - data.time
        grown = max(0.0, min(1.0, since / self.ramp_s, left / self.ramp_s)) if self.ramp_s else 1.0
        force = grown * (R_Wb1 @ [self.force_x_N, self.force_y_N, self.force_z_N])
        arm = data.xmat[body].reshape(3, 3) @ [self.point_x_m, self.point_y_m, self.point_z_m]
        data.xfrc_applied[body, :3] += force
        data.xfrc_applied[body, 3:] += np.cross(data.xpos[body] + arm - data.xipos[body], force)


# Fluid density and radius of the drag sphere. Chosen: the fluid is so thin that its force on all other bodies stays
# below one nanonewton; the sphere compensates with large fluid coefficients.
DENSITY_KG_PER_M3, RADIUS_M = 1e-6, 0.01


@dataclass(frozen=True)
class Drag(Effect):
    """Drag on the payload: a force -c v at its centre of mass (c in N s/m), a moment -c_r omega (c_r in N m s/rad).

    The linear part is implemented as ``general`` actuators with a site transmission relative to a site of the world
    and the affine bias (0, 0, -c). Their control input is unused.

    The quadratic part, -q |v| v and -q_r |omega| omega, is the drag of MuJoCo's fluid on a sphere
    (``fluidshape="ellipsoid"``). Its coefficients are density times area, or 8/15 pi r^5, times ``fluidcoef``.
    """

    on_payload = True
    ranges: ClassVar = {
        "coefficient_Ns_per_m": (0.0, 1e3), "turning_Nms_per_rad": (0.0, 1e3),
        "quadratic_Ns2_per_m2": (0.0, 1e4), "turning_quadratic_Nms2_per_rad2": (0.0, 1e4),
    }  # fmt: skip
    coefficient_Ns_per_m: float
    turning_Nms_per_rad: float = 0.0
    quadratic_Ns2_per_m2: float = 0.0
    turning_quadratic_Nms2_per_rad2: float = 0.0

    def _edit(self, scene: TeamScene) -> TeamScene:
        linear = self.coefficient_Ns_per_m, self.turning_Nms_per_rad
        squares = self.quadratic_Ns2_per_m2, self.turning_quadratic_Nms2_per_rad2
        if not any((*linear, *squares)):
            return scene
        root, com = scene.root, scene.compile().body(PAYLOAD).ipos
        payload = root.find("body", PAYLOAD)
        site = add_site(payload, "drag", com.tolist())
        still = root.worldbody.add("site", name="drag", group=4, size=[SITE_M])
        for k, name in enumerate(("x", "y", "z", "turn_x", "turn_y", "turn_z")):
            c = linear[k // 3]
            if not c:
                continue
            gear = [0.0] * 6
            gear[k] = 1.0
            root.actuator.add(
                "general", name=f"drag_{name}", site=site, refsite=still, gear=gear,
                gaintype="fixed", gainprm=[0.0], biastype="affine", biasprm=[0.0, 0.0, -c],
            )  # fmt: skip
        if any(squares):
            root.option.density = DENSITY_KG_PER_M3
            own = DENSITY_KG_PER_M3 * np.pi * np.array([RADIUS_M**2, 8.0 / 15.0 * RADIUS_M**5])
            along, turning = np.array(squares) / own
            payload.add(
                "geom", name="drag", type="sphere", pos=com.tolist(), size=[RADIUS_M], group=4, contype=0,
                conaffinity=0, mass=0.0, fluidshape="ellipsoid", fluidcoef=[along, 0.0, turning, 0.0, 0.0],
            )  # fmt: skip
        return scene


@dataclass(frozen=True)
class Slosh(Effect):
    """A pendulum under a point of the payload, given in {1} [m]; its mass adds to the payload's.

    Implemented as a child body of the payload with two hinges and a point mass ``length_m`` below them.
    ``damping_ratio`` is the damping ratio of small swings.

    With ``across_length_m`` above zero, the pendulum has two lengths. Along the direction ``heading_rad`` (about z,
    from the x axis of {1}) it swings with ``length_m``, and across it with ``across_length_m``. A second pendulum at
    the same point carries the share ``second_share`` of the mass and has the length ``second_length_m``.
    """

    on_payload = True
    ranges: ClassVar = {
        "mass_kg": (0.0, 100.0), "length_m": (0.005, 10.0), "damping_ratio": (0.0, 10.0),
        "across_length_m": (0.0, 10.0), "second_length_m": (0.0, 10.0), "second_share": (0.0, 1.0),
    }  # fmt: skip
    mass_kg: float
    length_m: float
    damping_ratio: float
    point_x_m: float = 0.0
    point_y_m: float = 0.0
    point_z_m: float = 0.0
    across_length_m: float = 0.0
    heading_rad: float = 0.0
    second_length_m: float = 0.0
    second_share: float = 0.0

    def carried(self) -> Array:
        """Inertial parameters of the mass at its pivot, where an estimate sees it during small swings, shape (10,).

        With two lengths, the point is halfway between the two pivots.
        """
        at = np.array([self.point_x_m, self.point_y_m, self.point_z_m])
        at[2] -= 0.5 * (self.length_m - self._across_m)
        about_1 = inertia_parameters(at @ at * np.eye(3) - np.outer(at, at))
        return self.mass_kg * np.concatenate([[1.0], at, about_1])

    @property
    def _across_m(self) -> float:
        return self.across_length_m or self.length_m

    def _edit(self, scene: TeamScene) -> TeamScene:
        second = self.second_share if self.second_length_m else 0.0
        self._hang(scene, "slosh", (1.0 - second) * self.mass_kg, self.length_m, self._across_m)
        self._hang(scene, "slosh_second", second * self.mass_kg, self.second_length_m, self.second_length_m)
        return scene

    def _hang(self, scene: TeamScene, name: str, mass_kg: float, length_m: float, across_m: float) -> None:
        """Add a pendulum body with its mass ``length_m`` below the point; ``across_m`` is its length across."""
        if not mass_kg:
            return
        payload = scene.root.find("body", PAYLOAD)
        half = 0.5 * self.heading_rad
        body = payload.add(
            "body", name=name, pos=[self.point_x_m, self.point_y_m, self.point_z_m],
            quat=[np.cos(half), 0.0, 0.0, np.sin(half)],
        )  # fmt: skip
        # Rotation about x moves the mass along y, so this hinge has the length across.
        for axis, along, own_m in (("x", [1.0, 0.0, 0.0], across_m), ("y", [0.0, 1.0, 0.0], length_m)):
            damping = (
                2.0 * self.damping_ratio * np.sqrt(omnid_design().gravity_mps2 / own_m) * mass_kg * own_m**2
            )
            body.add(
                "joint", name=f"{name}_{axis}", type="hinge", axis=along, pos=[0.0, 0.0, own_m - length_m],
                damping=damping, group=3,
            )  # fmt: skip
        small = [1e-6 * mass_kg * length_m**2] * 3
        body.add("inertial", pos=[0.0, 0.0, -length_m], mass=mass_kg, diaginertia=small)
        body.add(
            "geom", name=name, type="sphere", pos=[0.0, 0.0, -length_m], size=[0.02], group=2,
            contype=0, conaffinity=0, mass=0.0, rgba=[0.2, 0.5, 0.9, 1.0],
        )  # fmt: skip


LEAST_RATIO = 1e-6
"""Smallest over largest principal moment of the changed payload. Chosen: MuJoCo needs positive moments."""


@dataclass(frozen=True)
class PayloadMass(Effect):
    """A change of the payload's mass: constant during some trials (negative for removal), or at a constant rate.

    ``mass_kg`` is present from ``trial`` to ``last_trial``, both included; 0 means until the last trial. Within each of
    these trials the mass also changes by ``rate_kgps``. The centre of the added mass is a point of the payload in {1}
    [m]. ``inertia_*_m2`` is its inertia per kilogram about that centre, in the axes of {1}; 0 is a point mass.

    MJCF cannot express it: the trial writes the payload's mass, centre of mass and inertia. Leaving mass exerts no
    recoil.
    """

    on_payload = True
    ranges: ClassVar = {"mass_kg": (-100.0, 100.0), "rate_kgps": (-1.0, 1.0)}
    mass_kg: float = 0.0
    rate_kgps: float = 0.0
    trial: int = 1
    last_trial: int = 0
    point_x_m: float = 0.0
    point_y_m: float = 0.0
    point_z_m: float = 0.0
    inertia_xx_m2: float = 0.0
    inertia_xy_m2: float = 0.0
    inertia_xz_m2: float = 0.0
    inertia_yy_m2: float = 0.0
    inertia_yz_m2: float = 0.0
    inertia_zz_m2: float = 0.0

    def load(self, model: mujoco.MjModel, index: TeamIndex, trial_number: int | None) -> None:
        """Add the mass to the model before a trial, so that the trial starts at rest with it.

        Raises:
            InputError: the payload would have no mass left.
        """
        if self.mass_kg and self._there(trial_number):
            _Carried(self, model, index.payload_body).change(self.mass_kg)

    def actors(self, trial_number: int | None) -> Sequence[_Leak]:
        """Actors of a trial: one that changes the mass, if the mass has a rate."""
        return (_Leak(self),) if self.rate_kgps and self._there(trial_number) else ()

    def _there(self, trial_number: int | None) -> bool:
        number = self.trial if trial_number is None else trial_number
        return self.trial <= number and (not self.last_trial or number <= self.last_trial)


class _Leak:
    """Actor that changes the payload's mass at a constant rate."""

    def __init__(self, effect: PayloadMass) -> None:
        self._effect = effect

    def start(self, stage: Stage) -> None:
        self._payload = _Carried(self._effect, stage.model, stage.index.payload_body)
        self._per_tick = self._effect.rate_kgps / stage.rate_hz
        self._payload.check(self._per_tick * stage.duration)

    def act(self, tick: int) -> None:
        self._payload.change(self._per_tick * tick)


class _Carried:
    """Inertial parameters of the payload's body as a function of the added mass."""

    def __init__(self, effect: PayloadMass, model: mujoco.MjModel, body: int) -> None:
        self._model, self._body = model, body
        self._mass, self._centre = float(model.body_mass[body]), model.body_ipos[body].copy()
        R = _matrix(model.body_iquat[body])
        self._inertia = (R * model.body_inertia[body]) @ R.T
        self._point = np.array([effect.point_x_m, effect.point_y_m, effect.point_z_m])
        self._per_kg = inertia_matrix(np.array([getattr(effect, f"inertia_{ij}_m2") for ij in _ENTRIES]))
        # MuJoCo skips ``body_ipos`` and ``body_iquat`` for bodies flagged as having the inertial frame as their own.
        model.body_sameframe[body] = 0

    def check(self, more_kg: float) -> None:
        """Refuse a change that leaves a mass of zero or less."""
        if not self._mass + more_kg > 0.0:
            raise InputError(
                f"payload_mass: the payload of {self._mass:.3g} kg would weigh {self._mass + more_kg:.3g} kg; "
                "it must weigh something"
            )

    def change(self, more_kg: float) -> None:
        """Write mass, centre of mass and inertia for ``more_kg`` above the initial mass."""
        from mocobot_sim.scene.payload import nearest_inertia

        self.check(more_kg)
        model, body = self._model, self._body
        mass = self._mass + more_kg
        centre = (self._mass * self._centre + more_kg * self._point) / mass
        inertia = self._inertia + self._mass * _about(self._centre - centre)
        inertia = inertia + more_kg * (self._per_kg + _about(self._point - centre))
        moments, axes = np.linalg.eigh(nearest_inertia(inertia, LEAST_RATIO))
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        model.body_mass[body], model.body_ipos[body] = mass, centre
        model.body_inertia[body], model.body_iquat[body] = moments, _quaternion(axes)


_ENTRIES = ("xx", "xy", "xz", "yy", "yz", "zz")
"""Order of the entries of an inertia that ``inertia_matrix`` expects."""


def _about(r: Array) -> Array:
    """Inertia of a point mass of 1 kg about a point at distance ``r`` [m], shape (3, 3)."""
    return np.asarray(r @ r * np.eye(3) - np.outer(r, r))


def _matrix(quaternion: Array) -> Array:
    import mujoco

    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    return R.reshape(3, 3)


def _quaternion(R: Array) -> Array:
    import mujoco

    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, R.ravel())
    return quaternion
