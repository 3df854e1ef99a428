"""Commanded motion of wrists and bases: random vias, motion on a sphere, static orientations, planar plans.

Wrist commands are sampled at the rate of the recording. Between samples the controller follows a cubic spline through
them, so a recording with commands can be resimulated exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.scene.payload import PayloadJoint

RATE_HZ = 100.0  # sampling rate of commands and recordings [Hz]
LONGEST_S = 3600.0  # longest trial [s]; chosen: a trial and its log stay in memory
# Rest before the motion (load take-up) and after it [s]. Chosen: the estimator trims 2 s at each end.
SETTLE_S = 2.5


@dataclass(frozen=True)
class Trajectory:
    """Commands of one trial.

    Attributes:
        trial: ``random``, ``periodic``, ``static`` or ``free``.
        ref_b: commanded wrist positions in every robot's {b} [m], shape (Q, N, 3), at ``RATE_HZ``.
    """

    trial: str
    ref_b: Array

    @property
    def duration_s(self) -> float:
        """Time from the first to the last command [s]."""
        return (len(self.ref_b) - 1) / RATE_HZ


def minimum_jerk(s: Array) -> Array:
    """Minimum-jerk profile from 0 to 1 over s in [0, 1], with zero velocity and acceleration at both ends."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def random_vias(
    wrist_home_b: Array,
    rng: np.random.Generator,
    vias: int = 80,
    box_m: Sequence[float] = (0.060, 0.060, 0.037),
    transit_s: tuple[float, float] = (0.5, 0.8),
    dwell_s: tuple[float, float] = (0.5, 0.8),
) -> Trajectory:
    """Independent straight-line paths of every wrist between random vias (paper, section IV.C.1).

    Args:
        wrist_home_b: home wrist positions [m], shape (N, 3).
        rng: random generator for vias and times.
        vias: number of vias per robot; the wrists then return home.
        box_m: half sides of the box around home that contains the vias [m].
        transit_s, dwell_s: ranges of the uniformly distributed times between and at vias [s].

    Raises:
        InputError: there is no via, the motion could last over an hour, or a transit could take no time.
    """
    _check_vias(vias, vias * (transit_s[1] + dwell_s[1]))
    if not min(transit_s) > 0:
        raise InputError(f"transit is {transit_s} s; it must be greater than 0")
    paths = []
    for home in np.asarray(wrist_home_b):
        points = home + rng.uniform(-1.0, 1.0, (vias, 3)) * np.asarray(box_m)
        transit = rng.uniform(*transit_s, vias + 1)
        dwell = rng.uniform(*dwell_s, vias + 1)
        paths.append((np.vstack([home, points, home]), transit, dwell))
    return Trajectory("random", _via_paths(paths))


def free_motion(
    wrist_home_b: Array,
    rng: np.random.Generator,
    vias: int = 80,
    radius_m: float = 0.12,
    hold_s: float = 1.5,
    slow_s: tuple[float, float] = (0.8, 1.2),
    fast_s: tuple[float, float] = (0.5, 0.8),
) -> Trajectory:
    """Motion of arms without payload: static holds that excite gravity, then fast motion that excites inertia.

    Every wrist moves independently between random points of a ball around home. It stops at vias / 4 holds, rounded up,
    then passes the vias without stopping, then returns home.

    Args:
        wrist_home_b: home wrist positions [m], shape (N, 3).
        rng: random generator for points and times.
        vias: number of vias per robot in the fast part.
        radius_m: radius of the ball [m].
        hold_s: rest at each hold [s].
        slow_s, fast_s: ranges of the uniformly distributed times to each hold and to each via [s].

    Raises:
        InputError: there is no via, or the motion could last over an hour.
    """
    holds = -(-vias // 4)
    _check_vias(vias, holds * (slow_s[1] + hold_s) + vias * fast_s[1])
    paths = []
    for home in np.asarray(wrist_home_b):
        direction = rng.standard_normal((holds + vias, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        points = home + radius_m * np.cbrt(rng.uniform(size=(holds + vias, 1))) * direction
        transit = np.concatenate([rng.uniform(*slow_s, holds), rng.uniform(*fast_s, vias), [slow_s[1]]])
        dwell = np.where(np.arange(holds + vias + 1) < holds, hold_s, 0.0)
        paths.append((np.vstack([home, points, home]), transit, dwell))
    return Trajectory("free", _via_paths(paths))


def _check_vias(vias: int, longest_s: float) -> None:
    if vias < 1:
        raise InputError(f"vias is {vias}; it must be at least 1")
    if longest_s > LONGEST_S:
        raise InputError(f"vias is {vias}; that many could last longer than {LONGEST_S:g} s")


def _via_paths(paths: Sequence[tuple[Array, Array, Array]]) -> Array:
    """Sample the paths of all robots, shape (Q, N, 3), from (points, transit times, dwell times) of each."""
    duration = 2.0 * SETTLE_S + max(transit.sum() + dwell[:-1].sum() for _, transit, dwell in paths)
    time = np.arange(round(duration * RATE_HZ) + 1) / RATE_HZ
    return np.stack([_via_path(time, *path, SETTLE_S) for path in paths], axis=1)


def _via_path(time: Array, points: Array, transit: Array, dwell: Array, start: float) -> Array:
    """Sample a minimum-jerk path through points that starts at the time ``start`` [s], shape (Q, 3)."""
    ref = np.tile(points[0], (len(time), 1))
    for k in range(len(transit)):
        on = time >= start
        share = minimum_jerk((time[on] - start) / transit[k])[:, None]
        ref[on] = points[k] + share * (points[k + 1] - points[k])
        start += transit[k] + dwell[k]
    return ref


def sphere_motion(
    wrist_home_b: Array,
    X_1i: RigidTransform,
    duration_s: float = 60.0,
    rng: np.random.Generator | None = None,
    amplitude_rad: float = np.deg2rad(3.4),
    frequency_hz: Sequence[float] = (0.7, 0.85, 0.6),
    joint: PayloadJoint | None = None,
) -> Trajectory:
    """Periodic motion of all wrists on the sphere whose great circle passes through the grasps (paper, section IV.C.3).

    The payload turns about the centre of the circle through its three grasps, so every wrist stays on the sphere. The
    frequency differs for each axis. With other than three grasps the payload turns about their centroid.

    Args:
        wrist_home_b: home wrist positions [m], shape (N, 3).
        X_1i: estimated grasp frames in {1}, N transforms.
        duration_s: length of the motion, ramps included [s].
        rng: random generator for the phases; None for zero phases.
        amplitude_rad: amplitude of each component of the rotation vector [rad].
        frequency_hz: frequency of each component [Hz].
        joint: joint of a payload of two bodies, which moves too; None for a rigid payload.

    Raises:
        InputError: the motion is shorter than its ramps or longer than an hour, or there is only one robot.
    """
    ramp = 2.0
    if not 2.0 * ramp <= duration_s <= LONGEST_S:
        raise InputError(
            f"duration is {duration_s} s; it must be at least {2.0 * ramp:g} s and at most {LONGEST_S:g} s"
        )
    time = np.arange(round((duration_s + 2.0 * SETTLE_S) * RATE_HZ) + 1) / RATE_HZ - SETTLE_S
    envelope = minimum_jerk(time / ramp) * minimum_jerk((duration_s - time) / ramp)
    phase = np.zeros(3) if rng is None else rng.uniform(0.0, 2.0 * np.pi, 3)
    cycles = np.outer(time, np.asarray(frequency_hz))
    rotation = amplitude_rad * envelope[:, None] * np.sin(2.0 * np.pi * cycles + phase)
    q = envelope * np.sin(2.0 * np.pi * JOINT_HZ * time)
    centre = _circumcentre(X_1i.translation)
    return Trajectory("periodic", _turn_about(wrist_home_b, X_1i, centre, rotation, joint, q))


def static_orientations(
    wrist_home_b: Array,
    X_1i: RigidTransform,
    orientations: int = 6,
    tilt_rad: float = np.deg2rad(7.0),
    transit_s: float = 2.0,
    hold_s: float = 10.0,
    joint: PayloadJoint | None = None,
) -> Trajectory:
    """Hold the payload still in orientations tilted about evenly spaced horizontal axes (paper, section IV.C.2).

    Args:
        wrist_home_b: home wrist positions [m], shape (N, 3).
        X_1i: estimated grasp frames in {1}, N transforms.
        orientations: number of holds.
        tilt_rad: tilt at each hold [rad].
        transit_s: time between holds [s].
        hold_s: time at each hold, settling included [s].
        joint: joint of a payload of two bodies, which is held at several positions; None for a rigid payload.

    Raises:
        InputError: there is no orientation, or only one robot.
    """
    if orientations < 1:
        raise InputError(f"orientations is {orientations}; it must be at least 1")
    azimuth = 2.0 * np.pi * np.arange(orientations) / orientations
    tilts = tilt_rad * np.stack([np.cos(azimuth), np.sin(azimuth), 0.0 * azimuth], axis=1)
    stations = np.vstack([np.zeros(3), tilts, np.zeros(3)])
    period = transit_s + hold_s
    duration = 2.0 * SETTLE_S + orientations * period + transit_s
    time = np.arange(round(duration * RATE_HZ) + 1) / RATE_HZ - SETTLE_S
    steps = np.ones(orientations + 1)
    rotation = _via_path(time, stations, transit_s * steps, hold_s * steps, 0.0)
    positions = np.concatenate([[0.0], np.cos(2.0 * azimuth + 0.25 * np.pi), [0.0]])[:, None]
    q = _via_path(time, positions, transit_s * steps, hold_s * steps, 0.0)[:, 0]
    centre = X_1i.translation.mean(axis=0)
    return Trajectory("static", _turn_about(wrist_home_b, X_1i, centre, rotation, joint, q))


JOINT_HZ = 0.45
"""Frequency of the joint of a payload of two bodies in a periodic trial [Hz]. Chosen."""
JOINT_RAD, JOINT_M = 0.12, 0.05
"""Amplitude of a hinge and of a slide of such a payload [rad, m]. Chosen."""


def _turn_about(
    wrist_home_b: Array,
    X_1i: RigidTransform,
    centre: Array,
    rotation: Array,
    joint: PayloadJoint | None = None,
    q: Array | None = None,
) -> Array:
    """Wrist positions in each {b} while the payload turns about a centre, shape (Q, N, 3).

    ``rotation`` holds rotation vectors in the home axes of {1} [rad], shape (Q, 3); ``centre`` is in {1} [m]. The joint
    of a payload of two bodies moves as ``q``, shape (Q,), times its amplitude.
    """
    if len(X_1i) < 2:
        raise InputError(
            "one robot cannot turn a payload about a point: periodic and static trials need two or more"
        )
    turn = Rotation.from_rotvec(rotation)
    arms = None
    if joint is not None and q is not None:
        arms = joint.moved(X_1i.translation, q * (JOINT_M if joint.slides else JOINT_RAD)) - centre
    refs = []
    for i, (home, X) in enumerate(zip(np.asarray(wrist_home_b), X_1i, strict=True)):
        arm = X.translation - centre
        # At home, grasp frame i equals {b} of robot i up to tilt, so its yaw gives the heading of {b} in {1}.
        yaw = Rotation.from_euler("z", X.rotation.as_euler("ZYX")[0])
        refs.append(home + yaw.inv().apply(turn.apply(arm if arms is None else arms[:, i]) - arm))
    return np.stack(refs, axis=1)


def _circumcentre(p: Array) -> Array:
    """Centre of the circle through three points; the centroid if they are collinear or not three."""
    if len(p) == 3:
        a, b = p[1] - p[0], p[2] - p[0]
        n = np.cross(a, b)
        if np.linalg.norm(n) > 1e-3 * np.linalg.norm(a) * np.linalg.norm(b):
            return p[0] + (a @ a * np.cross(b, n) + b @ b * np.cross(n, a)) / (2.0 * n @ n)
    return p.mean(axis=0)


def compose(pose: ArrayLike, of: ArrayLike) -> Array:
    """Compose planar poses (x, y [m], yaw [rad]): ``of`` is given in the frame ``pose``; shapes (..., 3) broadcast."""
    pose, of = np.broadcast_arrays(np.asarray(pose, dtype=float), np.asarray(of, dtype=float))
    cos, sin = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    x, y = of[..., 0], of[..., 1]
    return pose + np.stack([cos * x - sin * y, sin * x + cos * y, of[..., 2]], axis=-1)


def relative(frame: ArrayLike, pose: ArrayLike) -> Array:
    """Planar pose of ``pose`` in ``frame``, both given in the world; yaw within +-pi, shapes (..., 3) broadcast."""
    frame, pose = np.asarray(frame, dtype=float), np.asarray(pose, dtype=float)
    away = pose - frame
    return np.concatenate([seen_from(frame[..., 2], away[..., :2]), wrapped(away[..., 2:])], axis=-1)


def seen_from(yaw: ArrayLike, vector: ArrayLike) -> Array:
    """Express planar vectors in axes turned by ``yaw`` [rad]; shapes (...), (..., 2) -> (..., 2)."""
    x, y = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


def wrapped(angle: ArrayLike) -> Array:
    """Wrap an angle to +-pi [rad]."""
    return (np.asarray(angle, dtype=float) + np.pi) % (2.0 * np.pi) - np.pi


def moved(pose: ArrayLike, step: ArrayLike) -> Array:
    """Integrate a constant body twist from a planar pose: odometry (Lynch and Park, "Modern Robotics", section 13.4).

    Args:
        pose: x, y [m], yaw [rad], shape (..., 3).
        step: twist times duration: rotation [rad], displacement along x and y [m], shape (..., 3).

    Returns:
        The pose afterwards, shape (..., 3).
    """
    pose, step = np.broadcast_arrays(np.asarray(pose, dtype=float), np.asarray(step, dtype=float))
    turn, x, y = step[..., 0], step[..., 1], step[..., 2]
    # The chord of an arc is rotated by half the arc's angle and shorter by the sinc of that half angle.
    shorter = np.sinc(turn / (2.0 * np.pi))
    heading = pose[..., 2] + 0.5 * turn
    cos, sin = np.cos(heading), np.sin(heading)
    return pose + np.stack([shorter * (cos * x - sin * y), shorter * (sin * x + cos * y), turn], axis=-1)


def yaw_of(R: ArrayLike) -> Array:
    """Yaw of rotation matrices [rad]: the heading of their x axis, shape (..., 3, 3) -> (...)."""
    R = np.asarray(R, dtype=float)
    return np.arctan2(R[..., 1, 0], R[..., 0, 0])


@dataclass(frozen=True)
class Leg:
    """One straight segment of a plan, traversed with minimum jerk from rest to rest.

    Attributes:
        to: pose at the end in the world: x, y [m], yaw [rad].
        duration_s: duration of the motion, greater than 0 [s].
        rest_s: rest at the end [s].
    """

    to: tuple[float, float, float]
    duration_s: float
    rest_s: float = 0.0


@dataclass(frozen=True)
class PlanarMotion:
    """Planned planar motion of N frames, one row per control tick.

    Attributes:
        rate_hz: ticks per second [Hz].
        pose: x, y [m], yaw [rad] in the world, shape (T, N, 3).
        twist: w_z [rad/s], v_x, v_y [m/s] in each frame, shape (T, N, 3).
    """

    rate_hz: float
    pose: Array
    twist: Array

    @property
    def duration_s(self) -> float:
        """Time from the first tick to the last [s]."""
        return (len(self.pose) - 1) / self.rate_hz


def plan(start: ArrayLike, legs: Sequence[Leg], rest_s: float, rate_hz: float = 1000.0) -> PlanarMotion:
    """Plan the motion of one frame along straight legs.

    Args:
        start: initial pose in the world: x, y [m], yaw [rad].
        legs: segments in order; yaw is not wrapped, so a change of 2 pi is a full turn.
        rest_s: rest before the first leg [s].
        rate_hz: ticks per second [Hz].

    Raises:
        InputError: there is no leg, a number is not finite, a duration is not positive, or the plan lasts over an hour.
    """
    if not legs:
        raise InputError("a plan has no legs; it needs at least one")
    poses = [np.asarray(pose, dtype=float) for pose in (start, *(leg.to for leg in legs))]
    if not all(pose.shape == (3,) and np.isfinite(pose).all() for pose in poses):
        raise InputError("a plan's poses are not x, y and yaw, all finite; they must be")
    stations = np.array(poses)
    times = np.array([[leg.duration_s, leg.rest_s] for leg in legs], dtype=float)
    if not (times[:, 0] > 0).all() or not (times[:, 1] >= 0).all() or not rest_s >= 0:
        raise InputError("a leg must last longer than 0 s and a rest 0 s or more")
    duration = rest_s + times.sum()
    if not duration <= LONGEST_S:
        raise InputError(f"the plan lasts {duration:g} s; it may last {LONGEST_S:g} s at most")
    time = np.arange(round(duration * rate_hz) + 1) / rate_hz
    pose, rate = np.tile(stations[0], (len(time), 1)), np.zeros((len(time), 3))
    begin = rest_s
    for k, leg in enumerate(legs):
        s = (time - begin) / leg.duration_s
        on = s > 0
        step = stations[k + 1] - stations[k]
        pose[on] = stations[k] + minimum_jerk(s[on])[:, None] * step
        within = np.clip(s[on], 0.0, 1.0)
        rate[on] = (30.0 * within**2 * (1.0 - within) ** 2 / leg.duration_s)[:, None] * step
        begin += leg.duration_s + leg.rest_s
    twist = np.column_stack([rate[:, 2], seen_from(pose[:, 2], rate[:, :2])])
    return PlanarMotion(rate_hz, pose[:, None], twist[:, None])


def carried(motion: PlanarMotion, places: ArrayLike) -> PlanarMotion:
    """Motion of N frames rigidly attached to a moving one, such as bases that keep their place under a moving payload.

    Args:
        motion: motion of the moving frame; its first frame is used.
        places: initial poses of the attached frames in the world: x, y [m], yaw [rad], shape (N, 3).
    """
    lead, twist = motion.pose[:, 0], motion.twist[:, 0]
    held = relative(lead[0], np.asarray(places, dtype=float))  # poses in the moving frame, (N, 3)
    pose = compose(lead[:, None], held[None])
    # Velocity of each attached origin, rotated from the moving frame into the attached frame.
    x, y, yaw = held.T
    turn, v_x, v_y = (part[:, None] for part in twist.T)
    velocity = seen_from(yaw, np.stack([v_x - turn * y, v_y + turn * x], axis=-1))
    turns = np.broadcast_to(turn[..., None], (*velocity.shape[:2], 1))
    return PlanarMotion(motion.rate_hz, pose, np.concatenate([turns, velocity], axis=-1))
