"""Bases that drive: from planned motion to wheel torques, each base on its own odometry.

Per base, at the control rate:

    V = (planned twist) + k (planned pose - pose by odometry)
    u = H V                                                       wheel speeds, ``mecanum``
    torque = k_u (u - wheel speed) + k_i (integral of the same)    within the drive's limit

Odometry integrates the twist that fits the wheels' angles best. It is all that a base knows: where wheels slip, it is
off, and the base with it.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.base.design import HAND, BaseDesign, base_design
from mocobot_sim.base.index import BaseIndex
from mocobot_sim.base.mecanum import MecanumKinematics
from mocobot_sim.base.motion import PlanarMotion
from mocobot_sim.trial.actors import Stage


class WheelContacts:
    """Contacts of rollers and floor, as MuJoCo solved them in its last step.

    Slip is taken along the roller's axle (as it lies on the floor while it carries the wheel with its middle): across
    it, a roller that takes over from the last one slides for some milliseconds until it turns, which costs nothing.
    While one hands over to the next, both touch: loads and friction forces add up, and the slip is their mean, weighed
    by load.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, index: BaseIndex, design: BaseDesign
    ) -> None:
        self._data, self._index = data, index
        sin, cos = np.sin(design.roller_angle_rad), np.cos(design.roller_angle_rad)
        self._axle = np.stack([np.full(4, sin), HAND * cos, np.zeros(4)], axis=1)  # in the chassis

    def measure(self) -> tuple[Array, Array, Array]:
        """Slip [m/s] of the contact on the floor, load [N] and friction [N] of every wheel, shapes (N, 4).

        0 where a wheel is in the air; friction is the size of the force in the floor.
        """
        data, robots = self._data, self._index.robots
        slip, load, grip = np.zeros(4 * robots), np.zeros(4 * robots), np.zeros((4 * robots, 3))
        axle = (self._axle @ data.xmat[self._index.chassis].reshape(-1, 3, 3).transpose(0, 2, 1)).reshape(
            -1, 3
        )
        contact = data.contact
        for geoms, row, frame in zip(contact.geom, contact.efc_address, contact.frame, strict=True):
            wheel = self._index.geom_wheel[geoms].max()
            if wheel < 0 or row < 0:
                continue
            # Elliptic cone: rows along the normal and two tangents, which are the frame's rows.
            tangents = frame.reshape(3, 3)[1:]
            force = data.efc_force[row]
            slip[wheel] += force * (axle[wheel] @ (data.efc_vel[row + 1 : row + 3] @ tangents))
            load[wheel] += force
            grip[wheel] += data.efc_force[row + 1 : row + 3] @ tangents
        slip = np.divide(slip, load, out=slip, where=load > 0)
        shape = (robots, 4)
        return slip.reshape(shape), load.reshape(shape), np.linalg.norm(grip, axis=1).reshape(shape)


POSITION_GAIN_PER_S = 2.0


@dataclass(frozen=True)
class DriveLog:
    """What the bases did, one row per sample; N robots, wheels in the order of ``WHEELS``.

    Attributes:
        time: [s], shape (Q,).
        planned: poses x, y [m], yaw [rad] in the world, shape (Q, N, 3).
        odometry: poses that the bases believe, shape (Q, N, 3).
        true: poses of the chassis, yaw not wrapped, shape (Q, N, 3).
        commanded_speed: of the wheels [rad/s], shape (Q, N, 4).
        speed: of the wheels [rad/s], shape (Q, N, 4).
        torque: of the drives [N m], shape (Q, N, 4).
        slip: velocity at which every wheel's contact slides along its roller's axle [m/s], shape (Q, N, 4).
        load: normal force of every wheel [N], shape (Q, N, 4).
        grip: friction force of every wheel [N], shape (Q, N, 4).
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


class BaseDrive:
    """Drives of all bases; an actor of a trial, or on its own by ``begin``, ``act`` and ``log``.

    Args:
        motion: plan of every base at the control rate; the last pose is held.
        kinematics: what the bases believe about their wheels; None for the one with rollers.
        design: of the bases; None for the shipped one.
        position_gain_per_s: k [1/s].
    """

    def __init__(
        self,
        motion: PlanarMotion,
        kinematics: MecanumKinematics | None = None,
        design: BaseDesign | None = None,
        position_gain_per_s: float = POSITION_GAIN_PER_S,
    ) -> None:
        self._design = design or base_design()
        self._kinematics = kinematics or MecanumKinematics.with_rollers(self._design)
        self._motion = motion
        self._gain = position_gain_per_s

    def start(self, stage: Stage) -> None:
        """Begin as an actor of a trial.

        Raises:
            InputError: as ``begin``.
        """
        self.begin(stage.model, stage.data, stage.rate_hz, stage.ticks)

    def begin(self, model: mujoco.MjModel, data: mujoco.MjData, rate_hz: float, ticks: int) -> None:
        """Take hold of the wheels.

        Args:
            model, data: with released bases, standing at the plan's first poses.
            rate_hz: control rate [Hz].
            ticks: control ticks per row of the log.

        Raises:
            InputError: a base is parked, or the plan is for another number of bases or another rate.
        """
        index = BaseIndex.of(model)
        motion, bases = self._motion, self._motion.pose.shape[1]
        if bases != index.robots:
            raise InputError(f"the plan is for {bases} bases; the scene has {index.robots} robots")
        if abs(motion.rate_hz - rate_hz) > 1e-9 * rate_hz:
            raise InputError(f"the plan has {motion.rate_hz:g} ticks per second; control has {rate_hz:g}")
        self._index, self._data, self._ticks, self._rate_hz = index, data, ticks, rate_hz
        self._constants = (
            self._gain,
            self._design.drive_gain_Nms_per_rad,
            self._design.drive_integral_Nm_per_rad,
            self._design.drive_torque_limit_Nm,
            1.0 / rate_hz,
        )
        self._pose, self._twist = np.ascontiguousarray(motion.pose), np.ascontiguousarray(motion.twist)
        self._odometry = self._pose[0].copy()
        self._angle = data.qpos[index.wheel_qpos].copy()
        self._lag, self._speed = np.zeros((index.robots, 4)), np.zeros((index.robots, 4))
        self._contacts = WheelContacts(model, data, index, self._design)
        self._rows: list[tuple[Array, ...]] = []
        from mocobot_sim.base.drive_kernel import update_drives  # numba takes half a second to load

        self._update = update_drives

    def act(self, tick: int) -> None:
        """One control tick: read wheel angles and speeds, write torques."""
        data, index = self._data, self._index
        pose, twist = self._planned(tick)
        self._update(
            data.qpos, data.qvel, data.ctrl, index.wheel_qpos, index.wheel_dof, index.drive,
            self._kinematics.matrix, self._kinematics.inverse, self._constants,
            pose, twist, self._odometry, self._angle, self._lag, self._speed,
        )  # fmt: skip
        if tick % self._ticks == 0:
            self._rows.append(
                (
                    pose.copy(),
                    self._odometry.copy(),
                    index.poses(data),
                    self._speed.copy(),
                    data.qvel[index.wheel_dof],
                    data.ctrl[index.drive],
                    *self._contacts.measure(),
                )
            )

    def _planned(self, tick: int) -> tuple[Array, Array]:
        """Poses and twists of the plan, shapes (N, 3)."""
        if tick < len(self._pose):
            return self._pose[tick], self._twist[tick]
        return self._pose[-1], np.zeros_like(self._twist[-1])

    def log(self) -> DriveLog:
        """What has happened since ``begin``."""
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        columns[2][..., 2] = np.unwrap(columns[2][..., 2], axis=0)
        time = np.arange(len(self._rows)) * self._ticks / self._rate_hz
        return DriveLog(time, *columns)
