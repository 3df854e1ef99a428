"""Hand guidance: the arms carry the weight of the payload with zero stiffness while a person moves it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.arm import dynamics as gimbal
from estimator.arm.delta import forward_kinematics
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.estimate.result import PayloadEstimate
from estimator.two_bodies.result import TwoBodies
from mocobot_sim.control.control import ControlGains, home_phi
from mocobot_sim.scene.as_built import AsBuilt, units_of
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.trajectories import minimum_jerk
from mocobot_sim.trial.truth import GroundTruth


@dataclass(frozen=True)
class Payload:
    """Parameters of a payload that weight compensation needs.

    Attributes:
        mass_kg: mass [kg]; 0 to carry no weight.
        p_1c: centre of mass in {1} [m], shape (3,).
        p_1i: grasps in {1} [m], shape (N, 3).
        R_1i: grasp orientations in {1}, shape (N, 3, 3).
    """

    mass_kg: float
    p_1c: Array
    p_1i: Array
    R_1i: Array

    @classmethod
    def of_estimate(cls, estimate: PayloadEstimate) -> Payload:
        """Take the parameters from an estimate.

        Raises:
            InputError: the estimate does not determine grasps, mass and centre of mass.
        """
        if estimate.grasps is None or estimate.mass is None or estimate.p_1c is None:
            known = {"grasps": estimate.grasps, "mass": estimate.mass, "centre of mass": estimate.p_1c}
            missing = ", ".join(name for name, value in known.items() if value is None)
            raise InputError(f"the estimate has no {missing}; carrying a payload's weight needs it")
        return cls(estimate.mass.mass, estimate.p_1c, estimate.grasps.p_1i, estimate.grasps.R_1i)

    @classmethod
    def of_truth(cls, truth: GroundTruth) -> Payload:
        """Take the parameters from the ground truth."""
        return cls(truth.mass_kg, truth.p_1c, truth.p_1i, truth.R_1i)


def weight_shares(payload: Payload, up_1: ArrayLike, gravity_mps2: float) -> Array:
    """Vertical forces at the grasps that balance the payload's weight without a moment [N], shape (N,).

    They add up to the weight, and their moment about the centre of mass is zero. With three grasps they are unique;
    with more, the solution of least norm is used. With one or two grasps, a moment can remain unbalanced.

    Args:
        payload: parameters of the payload.
        up_1: upward unit vector in {1}, shape (3,).
        gravity_mps2: gravitational acceleration [m/s^2].
    """
    up = np.asarray(up_1, dtype=float)
    arms = payload.p_1i - payload.p_1c
    # Vertical forces have moments about horizontal axes only: two rows.
    across = np.linalg.svd(up[None])[2][1:]
    scale = max(np.linalg.norm(arms, axis=1).max(), 1e-9)
    rows = np.vstack([np.ones(len(arms)), across @ np.cross(arms, up).T / scale])
    shares = np.linalg.lstsq(rows, np.array([payload.mass_kg * gravity_mps2, 0.0, 0.0]))[0]
    return np.asarray(shares, dtype=np.float64)


def up_in_payload(theta: Array, R_1i: Array) -> Array:
    """Upward direction in {1} by the gimbal of a robot on a level base, shape (..., 3).

    Args:
        theta: gimbal angles (z, y, x) of the robot [rad], shape (..., 3).
        R_1i: orientation of its grasp in {1}, shape (..., 3, 3).
    """
    up_i = gimbal.rotation(theta)[..., 2, :]  # the third row of R_bi is z of {b} in {i}
    return (R_1i @ up_i[..., None])[..., 0]


# Zero stiffness. The lag of the SEA torque loop acts as a damping of about -1.4 N s/m per arm (measured with payload
# (a)). The damping is chosen a little larger, so that a payload that nobody holds comes to rest.
FLOAT_GAINS = ControlGains(stiffness_N_per_m=0.0, damping_Ns_per_m=2.0)


class FloatArms:
    """Actor that sets the feed-forward force of every arm to its share of the weight at the current tilt.

    A trial starts at rest. From ``start_s`` on, the forces measured at the start fade within ``fade_s`` to those
    computed from ``payload``. The control gains do not change; use soft ones such as ``FLOAT_GAINS``.

    Args:
        payload: assumed parameters of the payload; None to keep the initial forces.
        as_built: sensor zeros of every robot; empty for robots as designed.
        start_s, fade_s: start and duration of the transition [s].
    """

    def __init__(
        self,
        payload: Payload | None,
        as_built: Sequence[AsBuilt] = (),
        start_s: float = 0.2,
        fade_s: float = 1.5,
    ) -> None:
        if not start_s > 0 or not fade_s > 0:
            raise InputError(f"start_s is {start_s} and fade_s {fade_s}; both must be greater than 0")
        self._payload, self._as_built = payload, as_built
        self._start_s, self._fade_s = start_s, fade_s

    def start(self, stage: Stage) -> None:
        """Prepare for a trial.

        Raises:
            InputError: the number of grasps differs from the number of robots.
        """
        robots = stage.index.robots
        if self._payload is not None and len(self._payload.p_1i) != robots:
            raise InputError(
                f"the payload has {len(self._payload.p_1i)} grasps; the team has {robots} robots"
            )
        self._stage = stage
        self._theta_zero = np.array([unit.theta_zero_rad for unit in units_of(self._as_built, robots)])
        self._gravity = omnid_design().gravity_mps2
        self._held = np.zeros((robots, 3))

    def act(self, tick: int) -> None:
        """Update the forces once per sample."""
        stage = self._stage
        if tick == 1:
            self._held = stage.controller.feed_forward  # measured by the controller in the first tick
            stage.controller.feed_forward = self._held
        if tick and tick % stage.ticks == 0 and self._payload is not None:
            share = minimum_jerk(np.array((tick / stage.rate_hz - self._start_s) / self._fade_s))
            stage.controller.feed_forward = (1.0 - share) * self._held + share * self.forces()

    def forces(self) -> Array:
        """Compute the forces that balance the weight now: one per wrist, in its {b} [N], shape (N, 3)."""
        payload, force = self._payload, np.zeros_like(self._held)
        if payload is not None and payload.mass_kg > 0:
            theta = self._stage.data.qpos[self._stage.index.gimbal_qpos] + self._theta_zero
            for i, up in enumerate(up_in_payload(theta, payload.R_1i)):
                # Each robot measures the tilt with its own gimbal and applies its own share.
                force[i, 2] = weight_shares(payload, up, self._gravity)[i]
        return force


def holding_forces(payload: TwoBodies, q: float, up_1: ArrayLike, gravity_mps2: float) -> Array:
    """Forces at the grasps that balance the weights of two bodies and the spring of their joint [N], shape (N, 3).

    They are the forces of least norm, in the axes of {1}, in equilibrium with both weights and without a moment about
    the joint.

    Args:
        payload: estimate with both bodies.
        q: position of the joint [rad or m].
        up_1: upward unit vector in {1}, shape (3,).
        gravity_mps2: gravitational acceleration [m/s^2].

    Raises:
        InputError: the estimate cannot divide the masses.
    """
    if payload.bodies is None:
        raise InputError("the estimate does not tell both bodies' masses; carrying their weight needs them")
    joint, up = payload.joint, np.asarray(up_1, dtype=float)
    axis, slides = joint.axes[:, 0], payload.motion == "sliding"
    turn = Rotation.from_rotvec(np.zeros(3) if slides else q * axis).as_matrix()
    shift = joint.pivot - turn @ joint.pivot + (q * axis if slides else 0.0)
    grasps, on = payload.p_ki.copy(), np.isin(np.arange(payload.robots) + 1, payload.halves[1])
    grasps[on] = (joint.p_0 + payload.p_ki[on] @ joint.R_0.T) @ turn.T + shift
    first, second = payload.bodies[:2]
    weights = gravity_mps2 * np.array([first.mass, second.mass])
    centres = np.array([first.com, turn @ second.com + shift])
    rows, load = np.zeros((7, payload.robots, 3)), np.zeros(7)
    rows[:3], load[:3] = np.eye(3)[:, None], weights.sum() * up
    rows[3:6] = np.swapaxes(np.array([np.cross(p, np.eye(3)).T for p in grasps]), 0, 1)
    load[3:6] = np.cross(weights @ centres, up)
    rows[6] = on[:, None] * (axis if slides else np.cross(axis, grasps - joint.pivot))
    load[6] = weights[1] * up @ (axis if slides else np.cross(axis, centres[1] - joint.pivot))
    terms = {name: payload.value(name)[0] for name in payload.law}
    load[6] += terms.get("stiffness", 0.0) * q - terms.get("offset", 0.0)
    forces = np.linalg.lstsq(rows.reshape(7, -1), load, rcond=1e-9)[0].reshape(-1, 3)
    return np.asarray(forces, dtype=np.float64)


@dataclass(frozen=True)
class Grip:
    """Impedance of two hands that hold a payload; isotropic.

    Attributes:
        stiffness_N_per_m, damping_Ns_per_m: translational stiffness and damping.
        stiffness_Nm_per_rad, damping_Nms_per_rad: rotational stiffness and damping.
    """

    stiffness_N_per_m: float = 1000.0
    damping_Ns_per_m: float = 100.0
    stiffness_Nm_per_rad: float = 100.0
    damping_Nms_per_rad: float = 10.0


@dataclass(frozen=True)
class Move:
    """One segment of a hand's path, with minimum jerk from rest to rest.

    Attributes:
        by_m: displacement at the end, relative to the start of the path, in the world [m].
        turn_rad: rotation vector at the end, relative to the start of the path, in the world [rad].
        duration_s: duration of the motion, greater than 0 [s].
        rest_s: rest at the end [s].
    """

    by_m: tuple[float, float, float]
    turn_rad: tuple[float, float, float]
    duration_s: float
    rest_s: float = 0.0


class FloatTwoBodies(FloatArms):
    """Actor that lets the arms carry two bodies on a joint, by ``holding_forces`` at the current tilt and fold.

    Args:
        payload: estimate with both bodies.
        X_Wb: base frames of the robots, N transforms; the joint's position follows from them and the joint sensors.
        as_built, start_s, fade_s: as for ``FloatArms``.
    """

    def __init__(
        self,
        payload: TwoBodies,
        X_Wb: RigidTransform,
        as_built: Sequence[AsBuilt] = (),
        start_s: float = 0.2,
        fade_s: float = 1.5,
    ) -> None:
        none = np.zeros((payload.robots, 3))
        super().__init__(Payload(0.0, np.zeros(3), none, none), as_built, start_s, fade_s)
        self._two, self._X_Wb = payload, X_Wb

    def forces(self) -> Array:
        """Compute the forces that balance both weights now: one per wrist, in its {b} [N], shape (N, 3)."""
        two, data, index = self._two, self._stage.data, self._stage.index
        R_bi = gimbal.rotation(data.qpos[index.gimbal_qpos] + self._theta_zero)
        phi = home_phi(omnid_design()) + data.qpos[index.motor_qpos] + data.qpos[index.spring_qpos]
        wrist = forward_kinematics(phi, omnid_design())
        X_Wi = self._X_Wb * RigidTransform.from_components(wrist, Rotation.from_matrix(R_bi))
        k = two.halves[1][0] - 1
        X_1k = X_Wi[0].inv() * X_Wi[k]
        q = float(two.joint.coordinates(X_1k.rotation.as_matrix()[None], X_1k.translation[None]).q[0])
        force_1 = holding_forces(two, q, R_bi[0, 2], self._gravity)
        # {1} and {b} of every robot by the gimbals, and the bases' headings.
        R_W1 = X_Wi[0].rotation.as_matrix()
        return np.einsum("nji,nj->ni", self._X_Wb.rotation.as_matrix(), force_1 @ R_W1.T)


@dataclass(frozen=True)
class HandLog:
    """Log of a hand, one row per sample, in world axes.

    Attributes:
        time: [s], shape (Q,).
        force: force on the payload [N], shape (Q, 3).
        moment: moment on the payload about the grip [N m], shape (Q, 3).
        intended: desired position of the grip [m], shape (Q, 3).
        position: actual position of the grip [m], shape (Q, 3).
        tilt: rotation vector from the desired to the actual orientation [rad], shape (Q, 3).
        power: power that the hand supplies to the payload [W], shape (Q,).
    """

    time: Array
    force: Array
    moment: Array
    intended: Array
    position: Array
    tilt: Array
    power: Array


class _OnPayload:
    """Base class of actors that apply a wrench at a point of the payload."""

    def __init__(self, point_1: ArrayLike, second: bool = False) -> None:
        self._second = second
        self._point_1 = np.asarray(point_1, dtype=float)
        if self._point_1.shape != (3,) or not np.isfinite(self._point_1).all():
            raise InputError(
                f"the point on the payload is {self._point_1.tolist()}; it must be three finite numbers"
            )

    def start(self, stage: Stage) -> None:
        """Prepare for a trial.

        Raises:
            InputError: there is no payload, or it has no second body to hold.
        """
        if stage.index.payload_body < 0:
            raise InputError("the robots hold nothing; a hand needs a payload")
        self._stage, self._body = stage, stage.index.payload_body
        if self._second:
            if not stage.index.payload_dof.size:
                raise InputError("the payload has no second body; a hand cannot hold it")
            self._body = int(stage.model.dof_bodyid[stage.index.payload_dof[0]])
        self._rows: list[tuple[Array, ...]] = []
        self._velocity = np.zeros(6)

    def _at(self) -> tuple[Array, Array, Array, Array]:
        """Position, orientation, velocity and angular velocity of the point in the world, one time step ago."""
        model, data = self._stage.model, self._stage.data
        R = data.xmat[self._body].reshape(3, 3).copy()
        arm = R @ self._point_1
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, self._body, self._velocity, 0)
        turning = self._velocity[:3].copy()
        moving = self._velocity[3:] + _cross(turning, arm)
        return data.xpos[self._body] + arm, R, moving, turning

    def _press(self, force: Array, moment: Array, at: Array) -> None:
        applied = self._stage.data.xfrc_applied[self._body]
        applied[:3] += force
        applied[3:] += moment + _cross(at - self._stage.data.xipos[self._body], force)

    def log(self) -> HandLog:
        """Log since the start of the trial."""
        columns = [np.array(column) for column in zip(*self._rows, strict=True)]
        return HandLog(np.arange(len(self._rows)) * self._stage.ticks / self._stage.rate_hz, *columns)


class GuidingHand(_OnPayload):
    """Actor that pulls the payload along a desired path by a spring-damper.

    Args:
        point_1: point that the hand holds, in {1} [m] (of the second body: with the joint at zero), shape (3,).
        moves: desired path of the grip, relative to its initial pose.
        start_s: time at which the motion starts [s].
        grip: impedance of the hand; None for the default.
        second: whether the hand holds the second body of a payload of two.
    """

    def __init__(
        self,
        point_1: ArrayLike,
        moves: Sequence[Move],
        start_s: float,
        grip: Grip | None = None,
        second: bool = False,
    ) -> None:
        super().__init__(point_1, second)
        if not moves or not all(move.duration_s > 0 and move.rest_s >= 0 for move in moves):
            raise InputError("a hand needs moves that last longer than 0 s, with rests of 0 s or more")
        self._moves, self._start_s, self._grip = tuple(moves), start_s, grip or Grip()

    @property
    def duration_s(self) -> float:
        """Time from the start of the trial to the end of the last rest [s]."""
        return self._start_s + sum(move.duration_s + move.rest_s for move in self._moves)

    def start(self, stage: Stage) -> None:
        """Prepare for a trial: compute the desired path."""
        super().start(stage)
        position, R, _, _ = self._at()
        by, turn = hand_path(self._moves, self._start_s, stage.duration, stage.rate_hz)
        turns = Rotation.from_rotvec(turn)
        self._position, self._velocity_of = position + by, np.gradient(by, 1.0 / stage.rate_hz, axis=0)
        self._R = (turns * Rotation.from_matrix(R)).as_matrix()
        step = (turns[1:] * turns[:-1].inv()).as_rotvec() * stage.rate_hz
        self._turning = np.vstack([step, step[-1:]])

    def act(self, tick: int) -> None:
        """Apply the spring-damper wrench and record it once per sample."""
        # The pose of the payload is one step old, so use the desired pose of that step.
        was = max(tick - 1, 0)
        position, R, moving, turning = self._at()
        tilt = _rotvec(R @ self._R[was].T)
        grip = self._grip
        force = grip.stiffness_N_per_m * (self._position[was] - position) + grip.damping_Ns_per_m * (
            self._velocity_of[was] - moving
        )
        moment = -grip.stiffness_Nm_per_rad * tilt + grip.damping_Nms_per_rad * (self._turning[was] - turning)
        self._press(force, moment, position)
        if tick % self._stage.ticks == 0:
            power = np.array(force @ moving + moment @ turning)
            self._rows.append((force, moment, self._position[was], position, tilt, power))


class PushingHand(_OnPayload):
    """Actor that applies a force pulse at a point of the payload.

    The pulse has the shape (1 - cos) / 2, so its impulse is half of peak times duration.

    Args:
        point_1: point of the payload at which the force acts, in {1} [m], shape (3,).
        peak_N: peak force in the world [N], shape (3,).
        start_s, duration_s: start and duration [s].
    """

    def __init__(self, point_1: ArrayLike, peak_N: ArrayLike, start_s: float, duration_s: float) -> None:
        super().__init__(point_1)
        self._peak = np.asarray(peak_N, dtype=float)
        self._start_s, self._duration_s = start_s, duration_s
        if self._peak.shape != (3,) or not np.isfinite(self._peak).all() or not duration_s > 0:
            raise InputError("a push needs three finite forces and a duration greater than 0 s")

    def act(self, tick: int) -> None:
        """Apply the force and record it once per sample."""
        s = (tick / self._stage.rate_hz - self._start_s) / self._duration_s
        force = self._peak * (0.5 - 0.5 * np.cos(2.0 * np.pi * s) if 0.0 < s < 1.0 else 0.0)
        position, _, moving, _ = self._at()
        self._press(force, np.zeros(3), position)
        if tick % self._stage.ticks == 0:
            nothing = np.zeros(3)
            self._rows.append((force, nothing, position, position, nothing, np.array(force @ moving)))


def hand_path(moves: Sequence[Move], start_s: float, ticks: int, rate_hz: float) -> tuple[Array, Array]:
    """Desired displacement [m] and rotation vector [rad] of a hand at every tick, shapes (T, 3)."""
    time = np.arange(ticks) / rate_hz
    path, before = np.zeros((ticks, 6)), np.zeros(6)
    begin = start_s
    for move in moves:
        after = np.array([*move.by_m, *move.turn_rad])
        on = time > begin
        path[on] = before + minimum_jerk((time[on] - begin) / move.duration_s)[:, None] * (after - before)
        before, begin = after, begin + move.duration_s + move.rest_s
    return path[:, :3], path[:, 3:]


# MuJoCo's functions for small vectors are faster than those of numpy and scipy.


def _cross(a: Array, b: Array) -> Array:
    product = np.empty(3)
    mujoco.mju_cross(product, a, b)
    return product


def _rotvec(R: Array) -> Array:
    quaternion, rotvec = np.empty(4), np.empty(3)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(R).ravel())
    mujoco.mju_quat2Vel(rotvec, quaternion, 1.0)
    return rotvec
