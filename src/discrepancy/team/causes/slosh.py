"""A mass that swings in the payload: a pendulum that hangs from a moving point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, cast
from weakref import WeakKeyDictionary

import numpy as np
from scipy.signal import cont2discrete, lfilter

from discrepancy.team.causes.base import REACH_M, Cause, Shape, by_axis
from discrepancy.team.linear.trial_linear import TrialLinear
from estimator.arrays import Array
from estimator.so3 import skew

SWING_ROUNDS, SWING_FIRST_ROUNDS, SWING_SETTLED = 20, 1, 1e-4
"""Largest number of iterations for large swings; the same while shapes are scanned; relative change that stops them."""

SWING_MOST, SWING_START, SWING_EASED = 0.95, 0.9, 0.6
"""Largest swing over the length; the same during the iteration; largest relative reduction of the restoring force."""

SWING_CALM, SWING_WEIGHT, SWING_LEAST_WEIGHT = 0.5, 0.7, 0.3
"""Change over the last change from which the iteration counts as oscillating; its step factor then; the least step."""


@dataclass(frozen=True)
class Pendulum:
    """Swing of a pendulum along one level direction.

    Attributes:
        length_m: length of its rod [m].
        damping_ratio: of small swings.
        gravity: acceleration of gravity [m/s^2].
        rate_hz: sampling rate [Hz].
    """

    length_m: float
    damping_ratio: float
    gravity: float
    rate_hz: float

    @property
    def damping_per_s(self) -> float:
        """Damping force over mass and speed [1/s]."""
        return float(2.0 * self.damping_ratio * np.sqrt(self.gravity / self.length_m))

    def restored(self, steeper: float) -> Pendulum:
        """Return a pendulum with a restoring force steeper by ``steeper`` [1/s^2] and the same damping force."""
        stiff = self.gravity / self.length_m + steeper
        ratio = 0.5 * self.damping_per_s / np.sqrt(stiff)
        return Pendulum(self.gravity / stiff, float(ratio), self.gravity, self.rate_hz)

    def small(self, drive: Array, integrals: int) -> Array:
        """Small swings from rest: relative acceleration (0 integrals), speed (1) or displacement (2).

        Args:
            drive: acceleration of the point, linear between samples, shape (Q, ...).
            integrals: number of integrals of the acceleration.
        """
        numerators, denominator = _filters(self)
        return np.asarray(lfilter(numerators[integrals], denominator, drive, axis=0), dtype=np.float64)


def swung(
    drives: Sequence[Array],
    turned: Sequence[Array],
    lift: Array,
    pendulums: Sequence[Pendulum],
    rounds: int = SWING_ROUNDS,
) -> tuple[list[Array], list[Array], Array]:
    """Swing of 1 kg along two level directions from rest; the damper turns with the payload.

    A displacement x and y raises the mass by z, so Lagrange's equations are

        x'' + z_x (z'' + b + g) + damper = -a,

    and the same for y. Here a and b are the point's acceleration along the direction and upwards, and z_x is the slope
    of z, about x / length for small x. The solution is iterative (Krylov and Bogoliubov's equivalent linearisation):
    the best linear restoring force is solved exactly, and its error in the last iteration is added to the drive. The
    iteration converges up to about 0.3 rad rms (0.8 rad peak). Beyond that the result is finite, but its error is
    unknown.

    Args:
        drives: acceleration of the point along each level direction, then its derivatives by other quantities, (Q, k).
        turned: turn rate of the damper's mount about the axis of each direction [rad/s], shape (Q,) each.
        lift: upward acceleration of the point [m/s^2], shape (Q,).
        pendulums: for each direction; the hinge of the first is on the rod of the second.
        rounds: largest number of iterations.

    Returns:
        For each direction, relative accelerations [m/s^2] and moments of the damper [N m], shape (Q, k) each, and the
        upward acceleration [m/s^2], shape (Q,). Derivatives are those of small swings.
    """
    held = [
        drive[:, 0] - own.damping_per_s * own.length_m * rate
        for own, drive, rate in zip(pendulums, drives, turned, strict=True)
    ]
    swing, last, weight = _swing(pendulums, held), np.inf, 1.0
    # Small swings may grow without bound. Limit the start and every iteration to the length of the rods.
    swing *= _within(pendulums, swing)
    far = Far.of(pendulums, swing, turned, lift)
    for _ in range(rounds):
        lines = [
            _line(own, way[0], more) for own, way, more in zip(pendulums, swing, far.beyond, strict=True)
        ]
        eased = [own.restored(k) for own, k in zip(pendulums, lines, strict=True)]
        driven = [
            drive + more - k * way[0]
            for drive, more, k, way in zip(held, far.beyond, lines, swing, strict=True)
        ]
        new = weight * _swing(eased, driven) + (1.0 - weight) * swing
        moved = float(np.sqrt(np.mean((new - swing) ** 2) / max(float(np.mean(new**2)), 1e-300)))
        if moved > SWING_CALM * min(last, 1.0):  # the iteration oscillates
            weight = max(SWING_WEIGHT * weight, SWING_LEAST_WEIGHT)
        new *= _within(pendulums, new)
        swing, last, far = new, moved, Far.of(pendulums, new, turned, lift)
        if moved < SWING_SETTLED:
            break
    swings, damped = [], []
    for own, drive, way, rate in zip(pendulums, drives, swing, far.rates, strict=True):
        swings.append(np.column_stack([way[2], own.small(drive[:, 1:], 0)]))
        speeds = np.column_stack([own.length_m * rate, own.small(drive[:, 1:], 1)])
        damped.append(own.damping_per_s * own.length_m * speeds)
    return swings, damped, far.rising


def _swing(pendulums: Sequence[Pendulum], driven: Sequence[Array]) -> Array:
    """Displacement, speed and acceleration of small swings along each direction, shape (2, 3, Q)."""
    return np.array(
        [
            [own.small(x, integrals) for integrals in (2, 1, 0)]
            for own, x in zip(pendulums, driven, strict=True)
        ]
    )


def _within(pendulums: Sequence[Pendulum], swing: Array) -> Array:
    """Factor that keeps swings within their rods, for each direction, shape (2, 1, 1)."""
    most = np.abs(swing[:, 0]).max(axis=1) / [SWING_START * own.length_m for own in pendulums]
    return np.asarray(1.0 / np.maximum(most, 1.0))[:, None, None]


def _line(own: Pendulum, x: Array, beyond: Array) -> float:
    """Stiffness of the best linear restoring force minus that of small swings [1/s^2]."""
    steeper = float(beyond @ x / max(float(x @ x), 1e-300))
    return max(steeper, -SWING_EASED * own.gravity / own.length_m)


@dataclass(frozen=True, eq=False)
class Far:
    """Nonlinear terms of a pendulum with large swings.

    Attributes:
        beyond: drive in addition to that of small swings, along each direction [m/s^2], shape (Q,) each.
        rising: upward acceleration [m/s^2], shape (Q,).
        rates: of the hinges [rad/s], shape (Q,) each.
    """

    beyond: list[Array]
    rising: Array
    rates: list[Array]

    @classmethod
    def of(cls, pendulums: Sequence[Pendulum], swing: Array, turned: Sequence[Array], lift: Array) -> Far:
        """Compute the nonlinear terms at a given swing.

        The rod of the first direction, of length L, hangs from a hinge on the rod of the second, of length A. The mass
        is ((A - L + (L^2 - x^2)^0.5)^2 - y^2)^0.5 below the upper hinge; z is A minus that.

        Args:
            pendulums: for both directions.
            swing: displacements, speeds and accelerations, shape (2, 3, Q).
            turned, lift: as in ``swung``.
        """
        (one, two), ((x, dx, ddx), (y, dy, ddy)) = pendulums, swing
        L, A, most = one.length_m, two.length_m, SWING_MOST
        x, y = np.clip(x, -most * L, most * L), np.clip(y, -most * min(A, L), most * min(A, L))
        along = np.sqrt(L**2 - x**2)
        rod = np.maximum(A - L + along, (1.0 - most) * A)
        below = np.sqrt(np.maximum(rod**2 - y**2, ((1.0 - most) * A) ** 2))
        slopes = rod / below * x / along, y / below
        steeper = [np.gradient(slope) * one.rate_hz for slope in slopes]
        rising = steeper[0] * dx + steeper[1] * dy + slopes[0] * ddx + slopes[1] * ddy
        # Hinge angles are asin(x / L) and asin(y / rod).
        rates = [dx / along - turned[0], (dy + x * y * dx / (along * rod)) / below - turned[1]]
        first, second = one.damping_per_s * L**2 * rates[0], two.damping_per_s * A**2 * rates[1]
        damper = [first / along + second * x * y / (along * rod * below), second / below]
        beyond = [
            slope * (rising + lift + own.gravity)
            - own.gravity / own.length_m * way
            + felt
            - own.damping_per_s * (speed - own.length_m * rate)
            for own, slope, way, felt, speed, rate in zip(
                pendulums, slopes, (x, y), damper, (dx, dy), turned, strict=True
            )
        ]
        return cls(beyond, np.asarray(rising), rates)


@lru_cache(maxsize=256)
def _filters(pendulum: Pendulum) -> tuple[list[Array], Array]:
    """Numerators for acceleration, speed and displacement, and their common denominator."""
    w = np.sqrt(pendulum.gravity / pendulum.length_m)
    rates = np.array([[0.0, 1.0], [-(w**2), -2.0 * pendulum.damping_ratio * w]])  # of displacement and speed
    out = np.array([rates[1], [0.0, 1.0], [1.0, 0.0]])
    system = rates, np.array([[0.0], [-1.0]]), out, np.array([[-1.0], [0.0], [0.0]])
    discrete = cont2discrete(system, 1.0 / pendulum.rate_hz, method="foh")
    A, B, C, D, _ = cast("tuple[Array, Array, Array, Array, float]", discrete)
    trace, det = np.trace(A), A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
    # C (z - A)^-1 B + D, where (z - A)^-1 is (z + A - trace) over the denominator.
    ends = C @ (A - trace * np.eye(2)) @ B + D * det
    numerators = np.concatenate([D, C @ B - D * trace, ends], axis=1)
    return list(numerators), np.array([1.0, -trace, det])


SLOSH_SECONDS = 150
"""Number of distinguishable second modes. Their prior odds keep a second mode from fitting noise."""

SLOSH_HEADINGS_FINER_RAD, SLOSH_TURN_RAD = (-0.26, -0.13, 0.13, 0.26), 0.1
"""Changes of a heading tried next, and the step of its finite difference. Chosen."""

SLOSH_SECOND_FINER, SLOSH_SHARES_FINER = (0.6, 0.75, 0.87, 0.95, 1.05, 1.15, 1.35, 1.7), (0.5, 0.75, 1.3, 2.0)
"""Factors of the second length, and of its mass share, tried next. Chosen."""

SLOSH_SECOND, SLOSH_SHARE = (0.3, 0.55, 1.8, 3.3), 0.25
"""Length of a second pendulum over the first's, and its share of the mass, tried first. Chosen."""

SLOSH_HEADINGS_RAD = (0.0, 0.79, 1.57, 2.36)
"""Headings of the second mode tried first. Measured: a heading that is wrong by 25 deg still helps."""

SLOSH_ACROSS = (0.3, 0.37, 0.46, 0.58, 0.72, 1.38, 1.7, 2.15, 2.7, 3.4)
"""Length across over length along, tried first. Measured: a value that is wrong by 25 % still helps."""

SLOSH_MOST_DAMPED = 0.3
"""Largest damping ratio tried. Chosen."""

SLOSH_LENGTHS_M = (0.04, 1.0)
"""Range of lengths. Derived: pendulums of 2.5 to 0.5 Hz; slower and faster ones resemble drag or play."""

OFF = ("off_x_m", "off_y_m", "off_z_m")
"""Shape numbers: from the centre of mass to the approximate pivot at which the columns are computed, in {1}."""


class Slosh(Cause):
    """A pendulum that hangs from a point of the payload; the cause is its motion relative to the payload.

    Small swings x relative to the point obey x'' + 2 zeta w (x' - v) + w^2 x = -a with w^2 = g / length; large ones
    obey ``swung``. The damper is fixed to the payload; v is the speed of a mass that turns with the payload. The
    payload feels -mass x'' at the point, and the reaction of raising the mass. The damper acts at the mass, so it also
    exerts the moment of its force 2 zeta w mass (x' - v), one length below the point. The payload's own parameters
    include the pendulum's weight and rigid motion.

    The mass may have two modes with one damping ratio. With ``across_length_m`` in its shape it is Blackburn's
    pendulum, like a liquid in an oblong box: it swings on ``length_m`` along ``heading_rad`` (from x of {1}, about z)
    and on ``across_length_m`` across. The mass is one, so the pivot across is lower by the difference. With
    ``second_length_m`` a share of the mass swings on that length, from the same point.
    """

    title = "mass that swings in the payload"
    family = "slosh"
    parameters = ("mass_kg", "moment_x_kgm", "moment_y_kgm", "moment_z_kgm")
    scales = (0.01, 0.005, 0.005, 0.005)
    at = "payload"
    shapes = tuple(
        {"length_m": length, "damping_ratio": damping}
        for length in (0.2, 0.05, 0.065, 0.085, 0.11, 0.145, 0.27, 0.37, 0.5, 0.7)
        for damping in (0.05, 0.15)
    )
    determined: ClassVar = {
        "length_m": 0.02,
        "damping_ratio": 0.1,
        "across_length_m": 0.05,
        "heading_rad": SLOSH_TURN_RAD,
        "second_length_m": 0.05,
        "second_share": 0.1,
    }
    absolute = ("heading_rad",)
    separate = "Motion near the pendulum's own frequency."

    def sentence(self, n):
        along = second = ""
        if n.values.get("across_length_m"):
            along = f" along {n('heading_rad', 'deg', 180.0 / np.pi, signed=True)} from x of {{1}}"
            along += f" and on {n('across_length_m', 'm')} across,"
        elif n.values.get("second_length_m"):
            second = f", {n('second_share', '%', 100.0)} of it on {n('second_length_m', 'm')}"
        return (
            f"a mass of {n('mass_kg', 'kg', signed=True)} swings in the payload on {n('length_m', 'm')}{along} below "
            f"{n.vector('point', 'm')} in {{1}}{second} (damping ratio {n('damping_ratio', '')})"
        )

    def columns(self, trial, robot, joint, shape):
        off = _off(shape)
        point = trial.shared.pi[1:4] / trial.shared.pi[0] + off
        R_b1, gravity = trial.data.R_bi[:, 0], trial.data.gravity_mps2
        (*ways, up), wrench = _level_ways(trial, point), np.zeros((len(R_b1), 6, 4))
        rounds = SWING_ROUNDS if set(OFF) & set(shape) else SWING_FIRST_ROUNDS
        if "across_length_m" in shape:
            drop_m = shape["length_m"] - shape["across_length_m"]
            along, across = _ways(R_b1, shape["heading_rad"])
            ways = [Way.of(trial, along, point), Way.of(trial, across, point - [0.0, 0.0, drop_m])]
            # The mass hangs lower than the payload's own parameters assume: correct its weight and rigid motion.
            for way, sign in (ways[1], -1.0), (Way.of(trial, across, point), 1.0):
                wrench += sign * way.pull[:, :, None] * way.drive[:, None]
            wrench[:, 3:, 0] += drop_m * gravity * np.cross(across[:, 2:] * across, R_b1[:, 2])
        for share, lengths_m in _modes(shape):
            own = [Pendulum(x, shape["damping_ratio"], gravity, trial.signals.rate_hz) for x in lengths_m]
            drives, turned = [way.drive for way in ways], [way.turned for way in ways]
            swings, damped, rising = swung(drives, turned, up.drive[:, 0], own, rounds)
            for way, swing, moment in zip(ways, swings, damped, strict=True):
                wrench -= share * way.pull[:, :, None] * swing[:, None]
                wrench[:, 3:] += share * way.about[:, :, None] * moment[:, None]
            wrench[..., 0] -= share * up.pull * rising[:, None]
        wrench[:, 3:, 1:] -= skew(wrench[:, :3, 0])  # moving the point by r moves the force: r x f = -f x r
        # Express moments about the centre of mass, whatever pivot was used.
        wrench[..., 0] -= wrench[..., 1:] @ off
        return trial.of_wrench(wrench[:, :3], wrench[:, 3:])

    def around(self, values, shape):
        """Compute the columns at the pivot that the values indicate."""
        at = np.clip(values[1:] / max(values[0], 1e-6), -REACH_M, REACH_M)
        return {**shape, **dict(zip(OFF, at.tolist(), strict=True))}

    def finer(self, shape):
        longer = (0.85, 0.9, 0.95, 0.975, 0.9875, 1.0125, 1.025, 1.05, 1.1, 1.15)
        more = (0.5, 0.7, 0.85, 0.95, 1.05, 1.2, 1.4)  # damping reduces the swing: the mass comes out larger
        length, damping = shape["length_m"], shape["damping_ratio"]
        near = [{"length_m": length * x} for x in longer]
        near += [
            {"length_m": length * x, "damping_ratio": damping * y} for x in (0.98, 1.0, 1.02) for y in more
        ]
        near += _nearer_mode(shape) if _has_two(shape) else []
        return [other for other in ({**shape, **moved} for moved in near) if _tried(other)]

    def further(self, shape):
        more = [] if _has_two(shape) else _second_modes(shape)
        return [x for x in ({**shape, **two} for two in more) if _tried(x)]

    def alike(self, shape):
        return SLOSH_SECONDS if _has_two(shape) else self.among

    def physical(self, values, context):
        mass = values[0] if abs(values[0]) > 1e-6 else 1e-6
        point = context.p_1c + values[1:] / mass
        plain = {"across_length_m": 0.0, "heading_rad": 0.0, "second_length_m": 0.0, "second_share": 0.0}
        told = {name: x for name, x in context.shape.items() if name not in OFF}
        return {"mass_kg": float(mass), **plain, **told, **by_axis("point", "m", point)}


@dataclass(frozen=True, eq=False)
class Way:
    """A level direction along which a mass swings that hangs from a point of the payload.

    Attributes:
        pull: wrench on the payload in {1} per 1 N along the direction at the point, shape (Q, 6).
        about: axis in {1} about which the mass swings, shape (Q, 3).
        drive: acceleration of the point along the direction, and its derivative by the point's position, shape (Q, 4).
        turned: turn rate of the payload about that axis [rad/s], shape (Q,).
    """

    pull: Array
    about: Array
    drive: Array
    turned: Array

    @classmethod
    def of(cls, trial: TrialLinear, way: Array, point: Array) -> Way:
        """Make the direction from unit vectors in {1}, shape (Q, 3), and a point in {1}."""
        about, motion = np.cross(way, trial.data.R_bi[:, 0, 2]), trial.motion
        further = (way[:, None] @ trial.turning)[:, 0]
        at = further @ point + np.sum(way * motion.acceleration, axis=1)
        pull = np.concatenate([way, np.cross(point, way)], axis=1)
        turned = np.sum(about * motion.omega, axis=1)
        return cls(pull, about, np.concatenate([at[:, None], further], axis=1), turned)


_LEVEL: WeakKeyDictionary[TrialLinear, tuple[Array, tuple[Way, Way, Way]]] = WeakKeyDictionary()


def _level_ways(trial: TrialLinear, point: Array) -> tuple[Way, Way, Way]:
    """Level x and y of {b1} and up, from a point in {1}; the last result of each trial is cached."""
    if trial not in _LEVEL or not np.array_equal(_LEVEL[trial][0], point):
        R_b1 = trial.data.R_bi[:, 0]
        x, y, up = (Way.of(trial, R_b1[:, k], point) for k in range(3))
        _LEVEL[trial] = point, (x, y, up)
    return _LEVEL[trial][1]


def _off(shape: Shape) -> Array:
    return np.array([shape.get(name, 0.0) for name in OFF])


def _has_two(shape: Shape) -> bool:
    """Whether a shape has a second mode."""
    return "across_length_m" in shape or "second_length_m" in shape


def _second_modes(shape: Shape) -> list[Shape]:
    """Additional numbers that turn a shape with one mode into one with two."""
    length_m = shape["length_m"]
    two: list[Shape] = [
        {"across_length_m": length_m * x, "heading_rad": turn}
        for x in SLOSH_ACROSS
        for turn in SLOSH_HEADINGS_RAD
    ]
    return two + [{"second_length_m": length_m * x, "second_share": SLOSH_SHARE} for x in SLOSH_SECOND]


def _nearer_mode(shape: Shape) -> list[Shape]:
    """Changed numbers of the second mode."""
    name = "across_length_m" if "across_length_m" in shape else "second_length_m"
    near: list[Shape] = [{name: shape[name] * x} for x in SLOSH_SECOND_FINER]
    if name == "across_length_m":
        return near + [{"heading_rad": shape["heading_rad"] + x} for x in SLOSH_HEADINGS_FINER_RAD]
    return near + [{"second_share": shape["second_share"] * x} for x in SLOSH_SHARES_FINER]


def _tried(shape: Shape) -> bool:
    """Whether lengths, damping ratio and mass share are in the range that is searched."""
    least, most = SLOSH_LENGTHS_M
    lengths = [x for name, x in shape.items() if name.endswith("length_m")]
    share = shape.get("second_share", 0.5)
    return all(least <= x <= most for x in lengths) and (
        shape["damping_ratio"] <= SLOSH_MOST_DAMPED and share < 1.0
    )


def _ways(R_b1: Array, heading_rad: float) -> tuple[Array, Array]:
    """Level directions in {1}, shape (Q, 3) each: on a heading from x of {1}, and across."""
    c, s = (R_b1 @ [np.cos(heading_rad), np.sin(heading_rad), 0.0])[:, :2].T
    c, s = (x[:, None] / np.hypot(c, s)[:, None] for x in (c, s))
    x, y = R_b1[:, 0], R_b1[:, 1]
    return c * x + s * y, c * y - s * x


def _modes(shape: Shape) -> list[tuple[float, tuple[float, float]]]:
    """Share of the mass, and lengths along and across, of each mode."""
    length_m, second = shape["length_m"], shape.get("second_share", 0.0)
    modes = [(1.0 - second, (length_m, shape.get("across_length_m", length_m)))]
    if second:
        modes.append((second, (shape["second_length_m"], shape["second_length_m"])))
    return modes
