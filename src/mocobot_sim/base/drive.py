"""Driving bases: they follow a plan or their own wrists, in a team or alone, each with its own odometry.

Per base, at the control rate:

    V = (planned twist) + k (planned pose - pose by odometry)
    u = H V                                                       wheel speeds, ``MecanumKinematics``
    torque = k_u (u - wheel speed) + k_i (integral of the same)    within the drive's limit

Odometry integrates the twist that fits the measured wheel rotations best (least squares). A base has no other measure
of its pose, so wheel slip causes errors of odometry and pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import RigidTransform

from estimator.arm.delta import forward_kinematics
from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.base.design import HAND, WHEELS, BaseDesign, MecanumKinematics, base_design
from mocobot_sim.control.control import home_phi
from mocobot_sim.scene.as_built import AsBuilt, units_of
from mocobot_sim.scene.models import models_dir, omnid_design
from mocobot_sim.scene.omnid import load_omnid, release, rough_floor, stand
from mocobot_sim.scene.pymjcf import compiled, mjcf
from mocobot_sim.scene.scene import TIMESTEP_S, TeamScene
from mocobot_sim.scene.team_index import BaseIndex
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.trajectories import RATE_HZ, Leg, PlanarMotion, carried, moved, plan, wrapped, yaw_of


class WheelContacts:
    """Contacts between rollers and floor in the last step of MuJoCo.

    Slip is measured along the horizontal axle of a roller that touches with its middle. Slip across the axle is
    ignored: each roller slides that way for some milliseconds after touchdown, until it turns. During the transition
    between two rollers both touch. Their loads and friction forces are summed, and the slip is their load-weighted
    mean.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, index: BaseIndex, design: BaseDesign
    ) -> None:
        self._data, self._index = data, index
        sin, cos = np.sin(design.roller_angle_rad), np.cos(design.roller_angle_rad)
        self._axle = np.stack([np.full(4, sin), HAND * cos, np.zeros(4)], axis=1)  # in the chassis frame

    def measure(self) -> tuple[Array, Array, Array]:
        """Slip [m/s], normal force [N] and magnitude of the friction force [N] of every wheel, shapes (N, 4).

        All are 0 for a wheel without contact.
        """
        data, robots = self._data, self._index.robots
        slip, load, grip = np.zeros(4 * robots), np.zeros(4 * robots), np.zeros((4 * robots, 3))
        R = data.xmat[self._index.chassis].reshape(-1, 3, 3)
        axle = (self._axle @ R.transpose(0, 2, 1)).reshape(-1, 3)
        contact = data.contact
        for geoms, row, frame in zip(contact.geom, contact.efc_address, contact.frame, strict=True):
            wheel = self._index.geom_wheel[geoms].max()
            if wheel < 0 or row < 0:
                continue
            # With elliptic cones the rows are the normal and two tangents, which are the rows of ``frame``.
            tangents = frame.reshape(3, 3)[1:]
            force = data.efc_force[row]
            slip[wheel] += force * (axle[wheel] @ (data.efc_vel[row + 1 : row + 3] @ tangents))
            load[wheel] += force
            grip[wheel] += data.efc_force[row + 1 : row + 3] @ tangents
        slip = np.divide(slip, load, out=slip, where=load > 0)
        shape = (robots, 4)
        return slip.reshape(shape), load.reshape(shape), np.linalg.norm(grip, axis=1).reshape(shape)


# Default of the gain k on the pose error by odometry [1/s]. Chosen.
POSITION_GAIN_PER_S = 2.0


@dataclass(frozen=True)
class DriveLog:
    """Log of driving bases, one row per sample; N robots, wheels in the order of ``WHEELS``.

    Attributes:
        time: [s], shape (Q,).
        planned: planned poses x, y [m], yaw [rad] in the world, shape (Q, N, 3).
        odometry: poses by odometry, shape (Q, N, 3).
        true: true poses of the chassis, yaw not wrapped, shape (Q, N, 3).
        commanded_speed: commanded wheel speeds [rad/s], shape (Q, N, 4).
        speed: wheel speeds [rad/s], shape (Q, N, 4).
        torque: motor torques at the wheels [N m], shape (Q, N, 4).
        slip: sliding velocity of every wheel's contact along the roller's axle [m/s], shape (Q, N, 4).
        load: normal force of every wheel [N], shape (Q, N, 4).
        grip: friction force of every wheel [N], shape (Q, N, 4).
        angle: wheel angles [rad], shape (Q, N, 4).
    """

    time: Array
    planned: Array
    odometry: Array
    true: Array
    commanded_speed: Array
    speed: Array
    torque: Array
    slip: Array
    load: Array
    grip: Array
    angle: Array


class BaseDrive:
    """Controller of all bases: an actor of a trial, or used alone through ``begin``, ``act`` and ``log``.

    Args:
        motion: plan of every base at the control rate; the last pose is held.
        kinematics: wheel kinematics that the controllers use, one for all bases or one for each; None for
            ``MecanumKinematics.with_rollers``.
        design: design of the bases; None for the shipped one.
        position_gain_per_s: gain k [1/s].
    """

    def __init__(
        self,
        motion: PlanarMotion,
        kinematics: MecanumKinematics | Sequence[MecanumKinematics] | None = None,
        design: BaseDesign | None = None,
        position_gain_per_s: float = POSITION_GAIN_PER_S,
    ) -> None:
        self._design = design or base_design()
        of_all = kinematics or MecanumKinematics.with_rollers(self._design)
        bases = motion.pose.shape[1]
        self._kinematics = (of_all,) * bases if isinstance(of_all, MecanumKinematics) else tuple(of_all)
        self._matrix = np.stack([of.matrix for of in self._kinematics])
        self._inverse = np.stack([of.inverse for of in self._kinematics])
        self._motion = motion
        self._gain = position_gain_per_s

    def start(self, stage: Stage) -> None:
        """Start as an actor of a trial; see ``begin``."""
        self.begin(stage.model, stage.data, stage.rate_hz, stage.ticks)

    def begin(self, model: mujoco.MjModel, data: mujoco.MjData, rate_hz: float, ticks: int) -> None:
        """Start to control released bases that stand at the first poses of the plan.

        Args:
            model, data: MuJoCo model and data.
            rate_hz: control rate [Hz].
            ticks: control ticks per row of the log.

        Raises:
            InputError: a base is parked, or the plan has another number of bases or another rate.
        """
        index = BaseIndex.of(model)
        motion, bases = self._motion, self._motion.pose.shape[1]
        if bases != index.robots:
            raise InputError(f"the plan is for {bases} bases; the scene has {index.robots} robots")
        if abs(motion.rate_hz - rate_hz) > 1e-9 * rate_hz:
            raise InputError(f"the plan has {motion.rate_hz:g} ticks per second; control has {rate_hz:g}")
        self._index, self._data, self._ticks, self._rate_hz = index, data, ticks, rate_hz
        of = self._design
        gains = of.drive_gain_Nms_per_rad, of.drive_integral_Nm_per_rad, of.drive_torque_limit_Nm
        self._constants = (self._gain, *gains, 1.0 / rate_hz)
        self._pose, self._twist = np.ascontiguousarray(motion.pose), np.ascontiguousarray(motion.twist)
        self._odometry = self._pose[0].copy()
        self._angle = data.qpos[index.wheel_qpos].copy()
        self._lag, self._speed = np.zeros((index.robots, 4)), np.zeros((index.robots, 4))
        self._contacts = WheelContacts(model, data, index, self._design)
        self._rows: list[tuple[Array, ...]] = []
        from mocobot_sim.kernels import update_drives  # numba takes half a second to load

        self._update = update_drives

    def act(self, tick: int) -> None:
        """Run one control tick: read wheel angles and speeds, write torques."""
        data, index = self._data, self._index
        pose, twist = self._planned(tick)
        self._update(
            data.qpos, data.qvel, data.ctrl, index.wheel_qpos, index.wheel_dof, index.drive,
            self._matrix, self._inverse, self._constants,
            pose, twist, self._odometry, self._angle, self._lag, self._speed,
        )  # fmt: skip
        if tick % self._ticks == 0:
            moved = pose.copy(), self._odometry.copy(), index.poses(data), self._speed.copy()
            wheels = data.qvel[index.wheel_dof], data.ctrl[index.drive], *self._contacts.measure()
            self._rows.append((*moved, *wheels, data.qpos[index.wheel_qpos]))

    def _planned(self, tick: int) -> tuple[Array, Array]:
        """Planned poses and twists at a tick, shapes (N, 3)."""
        if tick < len(self._pose):
            return self._pose[tick], self._twist[tick]
        return self._pose[-1], np.zeros_like(self._twist[-1])

    def log(self) -> DriveLog:
        """Log since ``begin``."""
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        columns[2][..., 2] = np.unwrap(columns[2][..., 2], axis=0)
        time = np.arange(len(self._rows)) * self._ticks / self._rate_hz
        return DriveLog(time, *columns)

    def measured(self, encoder_bits: int | None, rng: np.random.Generator) -> Array:
        """Odometry of a recording: integrate wheel encoders, as the controllers do, at the rate of the log.

        Args:
            encoder_bits: resolution of the wheels' encoders in bits per turn; None for no rounding.
            rng: generator of the offset of each encoder's grid.

        Returns:
            Poses (x, y [m], yaw [rad]) of every base in its frame at the start, shape (Q, N, 3).
        """
        angle = np.array([row[-1] for row in self._rows])
        if encoder_bits:
            step = 2.0 * np.pi / 2**encoder_bits
            grid = rng.uniform(-0.5, 0.5, angle.shape[1:])
            angle = step * np.round(angle / step + grid)
        steps = np.einsum("nak,qnk->qna", self._inverse, np.diff(angle, axis=0))
        pose = np.zeros((len(angle), angle.shape[1], 3))
        for k, step in enumerate(steps):
            pose[k + 1] = moved(pose[k], step)
        return pose


REACH_M, TURN_RAD, LEG_S, REST_S = 0.3, 0.3, 4.0, 0.5
"""Range of a wandering team about its start, in x and y and in yaw, and duration of a leg and of the rest after it.
Chosen: legs of the speed of ``scenarios/carry_sideways.py``."""


def wandering(scene: TeamScene, duration_s: float, ratio: float, rng: np.random.Generator) -> BaseDrive:
    """Drive released bases along random legs under the payload, each by odometry with errors of scale.

    Args:
        scene: team with released bases.
        duration_s: duration of the trial [s]; bases rest in its first and last second.
        ratio: standard deviation of the relative errors of each base's odometry, in yaw, x and y.
        rng: generator of legs and errors.
    """
    place = np.column_stack([scene.mounts.translation[:, :2], yaw_of(scene.mounts.rotation.as_matrix())])
    middle = np.append(scene.X_1i.translation[:, :2].mean(axis=0), 0.0)
    count = max(1, int((duration_s - 2.0) / (LEG_S + REST_S)))
    away = rng.uniform(-1.0, 1.0, (count, 3)) * [REACH_M, REACH_M, TURN_RAD]
    legs = [Leg((x, y, yaw), LEG_S, REST_S) for x, y, yaw in (middle + away).tolist()]
    true = MecanumKinematics.with_rollers(base_design())
    kinematics = [true.off_by(off) for off in ratio * rng.standard_normal((scene.robots, 3))]
    return BaseDrive(carried(plan(middle, legs, rest_s=1.0), place), kinematics)


class FollowingDrive(BaseDrive):
    """Controller of bases that follow their own wrists; an actor of a trial.

    Each base measures, with its own joint sensors, how far the wrist and the gimbal's z axis have moved from their
    initial values. It drives with a velocity proportional to this offset, within limits.

    Args:
        mounts: initial floor mounts of the robots, N transforms.
        as_built: sensor zeros of every robot; empty for robots as designed.
        gain_per_s: velocity per offset [1/s].
        fastest: limits of the angular velocity [rad/s] and of each velocity component [m/s].
        rate_hz: control rate [Hz].
    """

    def __init__(
        self,
        mounts: RigidTransform,
        as_built: Sequence[AsBuilt] = (),
        gain_per_s: float = 3.0,
        fastest: tuple[float, float] = (0.6, 0.4),
        rate_hz: float = 1000.0,
    ) -> None:
        place = np.column_stack([mounts.translation[:, :2], yaw_of(mounts.rotation.as_matrix())])
        super().__init__(PlanarMotion(rate_hz, place[None], np.zeros((1, len(mounts), 3))))
        self._follow, self._limit = gain_per_s, np.array([fastest[0], fastest[1], fastest[1]])
        units = units_of(as_built, len(mounts))
        self._phi_zero = np.array([unit.phi_zero_rad for unit in units])
        self._theta_zero = np.array([unit.theta_zero_rad[0] for unit in units])

    def start(self, stage: Stage) -> None:
        """Start; the current wrist positions become the reference."""
        super().start(stage)
        self._stage = stage
        self._goal = self._pose[0].copy()
        self._wanted = np.zeros_like(self._goal)
        self._home = self._offsets()

    def _offsets(self) -> Array:
        """Measured gimbal angle about z [rad] and wrist position x, y [m] in each {b}, shape (N, 3)."""
        design, index, qpos = omnid_design(), self._stage.index, self._stage.data.qpos
        phi = home_phi(design) + qpos[index.motor_qpos] + qpos[index.spring_qpos] + self._phi_zero
        turn = qpos[index.gimbal_qpos[:, 0]] + self._theta_zero
        return np.column_stack([turn, forward_kinematics(phi, design)[:, :2]])

    def _planned(self, tick: int) -> tuple[Array, Array]:
        if tick % self._ticks == 0:
            offset = self._offsets() - self._home
            offset[:, 0] = wrapped(offset[:, 0])
            self._wanted = np.clip(self._follow * offset, -self._limit, self._limit)
        self._goal = moved(self._goal, self._wanted / self._rate_hz)
        return self._goal, self._wanted


class Snapshots:
    """Actor that records ``qpos`` at given times.

    Args:
        times_s: times [s]; each snapshot is taken at the first control tick not before its time.
    """

    def __init__(self, times_s: Sequence[float]) -> None:
        self.times_s = tuple(sorted(times_s))
        self.qpos: list[Array] = []

    def start(self, stage: Stage) -> None:
        """Start as an actor of a trial."""
        self.begin(stage.data, stage.rate_hz)

    def begin(self, data: mujoco.MjData, rate_hz: float) -> None:
        """Start without a trial."""
        self._data, self._rate_hz, self.qpos = data, rate_hz, []

    def act(self, tick: int) -> None:
        """Record ``qpos`` for every time that is due."""
        for time_s in self.times_s[len(self.qpos) :]:
            if tick >= time_s * self._rate_hz - 1e-6:
                self.qpos.append(self._data.qpos.copy())


def build_solo(design: BaseDesign | None = None, timestep_s: float = TIMESTEP_S) -> mjcf.RootElement:
    """Build a scene with one released Omnid at the world's origin, heading along x, with a rigid arm.

    Args:
        design: design of the base; None for the shipped one.
        timestep_s: integration step [s].

    Raises:
        InputError: the base cannot be built.
    """
    design = design or base_design()
    root = mjcf.from_path(str(models_dir() / "team.xml"))
    root.model = "solo"
    root.option.timestep = timestep_s
    omnid = load_omnid(1)
    release(omnid, design)
    wheels = {f"wheel_{wheel}" for wheel in WHEELS}
    for element in [*omnid.equality.all_children(), *omnid.actuator.all_children()]:
        if element.name.startswith(("rod", "motor")):
            element.remove()
    for joint in omnid.find_all("joint"):
        if not any(joint.name.startswith(wheel) for wheel in wheels):
            joint.remove()
    stand(root, omnid, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]).add("freejoint")
    rough_floor(root, design)
    return root


def compile_solo(root: mjcf.RootElement) -> mujoco.MjModel:
    """Compile the scene of ``build_solo``."""
    return compiled(root)


def drive_solo(
    model: mujoco.MjModel,
    drive: BaseDrive,
    duration_s: float,
    rate_hz: float = 1000.0,
    snapshots: Snapshots | None = None,
) -> DriveLog:
    """Simulate the robot of ``compile_solo`` while its base follows a plan.

    Args:
        model: model of ``compile_solo``.
        drive: controller of the base.
        duration_s: duration [s].
        rate_hz: control rate [Hz].
        snapshots: records ``qpos`` during the run; None for no snapshots.

    Raises:
        InputError: the plan does not fit the model.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ticks, substeps = round(rate_hz / RATE_HZ), round(1.0 / (rate_hz * model.opt.timestep))
    drive.begin(model, data, rate_hz, ticks)
    snapshots = snapshots or Snapshots(())
    snapshots.begin(data, rate_hz)
    for tick in range(round(duration_s * rate_hz) + 1):
        drive.act(tick)
        snapshots.act(tick)
        mujoco.mj_step(model, data, nstep=substeps)
    return drive.log()
