"""Commanded wrist positions: random vias, motion on a common sphere, static orientations, arms that hold nothing.

Commands are sampled at the recording's rate; between them the controller follows the cubic spline through them, so
a recording that carries its commands can be resimulated exactly.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.arrays import Array
from estimator.errors import InputError

RATE_HZ = 100.0
LONGEST_S = 3600.0  # a trial and its log are kept in memory
SETTLE_S = 2.5  # at rest before the motion (load take-up) and after it; the estimator trims 2 s of each end


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
    """Minimum-jerk profile: 0 to 1 over s in [0, 1], with zero velocity and acceleration at both ends."""
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
        rng: source of vias and times.
        vias: number of vias per robot; the wrists then return home.
        box_m: half sides of the box around home that holds the vias [m].
        transit_s, dwell_s: uniform ranges of the time between and at vias [s].

    Raises:
        InputError: fewer than one via, so many that the motion would last over an hour, or a transit that takes
            no time.
    """
    if vias < 1:
        raise InputError(f"vias is {vias}; it must be at least 1")
    if vias * (transit_s[1] + dwell_s[1]) > LONGEST_S:
        raise InputError(f"vias is {vias}; that many could last longer than {LONGEST_S:g} s")
    if not min(transit_s) > 0:
        raise InputError(f"transit is {transit_s} s; it must be greater than 0")
    paths = []
    for home in np.asarray(wrist_home_b):
        points = home + rng.uniform(-1.0, 1.0, (vias, 3)) * np.asarray(box_m)
        transit = rng.uniform(*transit_s, vias + 1)
        dwell = rng.uniform(*dwell_s, vias + 1)
        paths.append((np.vstack([home, points, home]), transit, dwell))
    duration = 2.0 * SETTLE_S + max(transit.sum() + dwell[:-1].sum() for _, transit, dwell in paths)
    time = np.arange(round(duration * RATE_HZ) + 1) / RATE_HZ
    return Trajectory("random", np.stack([_via_path(time, *path, SETTLE_S) for path in paths], axis=1))


def free_motion(
    wrist_home_b: Array,
    rng: np.random.Generator,
    vias: int = 80,
    radius_m: float = 0.12,
    hold_s: float = 1.5,
    slow_s: tuple[float, float] = (0.8, 1.2),
    fast_s: tuple[float, float] = (0.5, 0.8),
) -> Trajectory:
    """Motion of arms that hold nothing: holds all over the workspace for their weight, then haste for their inertia.

    Every wrist goes its own way between random points of a ball around home: first to a quarter as many holds as there
    are vias, then through the vias without a rest, then home.

    Args:
        wrist_home_b: home wrist positions [m], shape (N, 3).
        rng: source of points and times.
        vias: number of vias per robot in the fast part.
        radius_m: radius of the ball [m].
        hold_s: rest at each hold [s].
        slow_s, fast_s: uniform ranges of the time to a hold, and of the time to a via [s].

    Raises:
        InputError: fewer than one via, or so many that the motion would last over an hour.
    """
    if vias < 1:
        raise InputError(f"vias is {vias}; it must be at least 1")
    holds = -(-vias // 4)
    if holds * (slow_s[1] + hold_s) + vias * fast_s[1] > LONGEST_S:
        raise InputError(f"vias is {vias}; that many could last longer than {LONGEST_S:g} s")
    paths = []
    for home in np.asarray(wrist_home_b):
        direction = rng.standard_normal((holds + vias, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        points = home + radius_m * np.cbrt(rng.uniform(size=(holds + vias, 1))) * direction
        transit = np.concatenate([rng.uniform(*slow_s, holds), rng.uniform(*fast_s, vias), [slow_s[1]]])
        dwell = np.where(np.arange(holds + vias + 1) < holds, hold_s, 0.0)
        paths.append((np.vstack([home, points, home]), transit, dwell))
    duration = 2.0 * SETTLE_S + max(transit.sum() + dwell.sum() for _, transit, dwell in paths)
    time = np.arange(round(duration * RATE_HZ) + 1) / RATE_HZ
    return Trajectory("free", np.stack([_via_path(time, *path, SETTLE_S) for path in paths], axis=1))


def _via_path(time: Array, points: Array, transit: Array, dwell: Array, start: float) -> Array:
    """From point to point with minimum jerk, beginning at ``start`` [s]; shape (Q, 3)."""
    ref = np.tile(points[0], (len(time), 1))
    for k in range(len(transit)):
        on = time >= start
        ref[on] = points[k] + minimum_jerk((time[on] - start) / transit[k])[:, None] * (
            points[k + 1] - points[k]
        )
        start += transit[k] + dwell[k]
    return ref


def sphere_motion(
    wrist_home_b: Array,
    X_1i: RigidTransform,
    duration_s: float = 60.0,
    rng: np.random.Generator | None = None,
    amplitude_rad: float = np.deg2rad(3.4),
    frequency_hz: Sequence[float] = (0.7, 0.85, 0.6),
) -> Trajectory:
    """Periodic motion of all wrists on the sphere whose great circle runs through the grasps (section IV.C.3).

    The payload turns about the centre of the circle through three grasps, each axis at its own frequency, so every
    wrist stays on that sphere. Other than three grasps need not lie on one circle: they turn about their centroid.

    Args:
        wrist_home_b: home wrist positions [m], shape (N, 3).
        X_1i: grasp frames in {1}, as the robots have estimated them; N transforms.
        duration_s: length of the motion, ramps included [s].
        rng: source of the phases; None for zero phases.
        amplitude_rad: amplitude of each component of the rotation vector [rad].
        frequency_hz: frequency of each component [Hz].

    Raises:
        InputError: the motion is shorter than its ramps or longer than an hour, or there is one robot only.
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
    return Trajectory("periodic", _turn_about(wrist_home_b, X_1i, _circumcentre(X_1i.translation), rotation))


def static_orientations(
    wrist_home_b: Array,
    X_1i: RigidTransform,
    orientations: int = 6,
    tilt_rad: float = np.deg2rad(7.0),
    transit_s: float = 2.0,
    hold_s: float = 10.0,
) -> Trajectory:
    """Hold the payload still at distinct orientations, tilted about evenly spaced horizontal axes (section IV.C.2).

    Args:
        wrist_home_b: home wrist positions [m], shape (N, 3).
        X_1i: grasp frames in {1}, as the robots have estimated them; N transforms.
        orientations: how many holds.
        tilt_rad: tilt of each hold [rad].
        transit_s: time between holds [s].
        hold_s: time at each hold, settling included [s].

    Raises:
        InputError: fewer than one orientation, or one robot only.
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
    return Trajectory("static", _turn_about(wrist_home_b, X_1i, X_1i.translation.mean(axis=0), rotation))


def _turn_about(wrist_home_b: Array, X_1i: RigidTransform, centre: Array, rotation: Array) -> Array:
    """Wrist positions in {b} when the payload turns by rotation vectors (Q, 3), given in {1} at home, about centre."""
    if len(X_1i) < 2:
        raise InputError(
            "one robot cannot turn a payload about a point: periodic and static trials need two or more"
        )
    turn = Rotation.from_rotvec(rotation)
    refs = []
    for home, X in zip(np.asarray(wrist_home_b), X_1i, strict=True):
        arm = X.translation - centre
        # {b} of robot i is {1} turned by its yaw: grasp frames are parallel to {b} at home up to the home tilt.
        yaw = Rotation.from_euler("z", X.rotation.as_euler("ZYX")[0])
        refs.append(home + yaw.inv().apply(turn.apply(arm) - arm))
    return np.stack(refs, axis=1)


def _circumcentre(p: Array) -> Array:
    """Centre of the circle through three points; the centroid of other than three, or of collinear ones."""
    if len(p) == 3:
        a, b = p[1] - p[0], p[2] - p[0]
        n = np.cross(a, b)
        if np.linalg.norm(n) > 1e-3 * np.linalg.norm(a) * np.linalg.norm(b):
            return p[0] + (a @ a * np.cross(b, n) + b @ b * np.cross(n, a)) / (2.0 * n @ n)
    return p.mean(axis=0)
