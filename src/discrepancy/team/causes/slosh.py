"""A mass that swings in the payload."""

from functools import lru_cache
from typing import ClassVar, cast

import numpy as np
from scipy.signal import cont2discrete, lfilter

from discrepancy import rules
from discrepancy.causes.base import Shape
from discrepancy.team.causes.base import Cause
from estimator.arrays import Array
from estimator.so3 import skew


class Slosh(Cause):
    """A pendulum that hangs from a point of the payload; what it does beyond riding along rigidly.

    Small swings x relative to the point obey x'' + 2 zeta w (x' - v) + w^2 x = -a with w^2 = g / length; v is how fast
    it would swing if it turned with the payload, to which its damper is fixed. The payload feels -mass x'' at the point
    and, as the damper pulls where the mass is, the moment of 2 zeta w mass (x' - v) a length below. Its weight and
    rigid part are in the payload's own parameters.

    What swings may have two modes, of one damping ratio. With ``across_length_m`` in its shape it is Blackburn's
    pendulum, as a liquid in a box that is longer than wide: it swings on ``length_m`` along ``heading_rad`` (from x of
    {1}, about z) and on that across; the mass is one, so across it hangs from a point that is lower by the difference.
    With ``second_length_m`` a share of the mass swings on that, from the same point.
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
        "heading_rad": rules.SLOSH_TURN_RAD,
        "second_length_m": 0.05,
        "second_share": 0.1,
    }
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
        motion = trial.motion
        com = trial.shared.pi[1:4] / trial.shared.pi[0]
        R_b1, gravity = trial.data.R_bi[:, 0], trial.data.gravity_mps2
        turning, up = trial.turning, R_b1[:, 2]
        across_m = shape.get("across_length_m", shape["length_m"])
        drop_m = shape["length_m"] - across_m
        force, moment = np.zeros((2, len(R_b1), 3, 4))

        def driven(way, point):
            """How the point is accelerated along a way, and by how much more the further it is along each axis."""
            further = (way[:, None] @ turning)[:, 0]
            at = further @ point + np.sum(way * motion.acceleration, axis=1)
            return np.concatenate([at[:, None], further], axis=1)

        def add(way, acceleration, point, sign=-1.0):
            """Force on the payload, in {1}, of 1 kg that is accelerated along a way, and its moment where it is."""
            acceleration = sign * acceleration[:, None]
            force[:] += way[:, :, None] * acceleration
            moment[:] += np.cross(point, way)[:, :, None] * acceleration

        for way, length_m, down_m in zip(
            _ways(R_b1, shape), (shape["length_m"], across_m), (0.0, drop_m), strict=True
        ):
            point = com - [0.0, 0.0, down_m]
            drive, about = driven(way, point), np.cross(way, up)
            turned = np.sum(about * motion.omega, axis=1)
            own = {**shape, "length_m": length_m}
            swing, damped = _swing(drive, turned, trial.signals.rate_hz, gravity, own)
            add(way, swing, point)
            moment += about[:, :, None] * damped[:, None]
            if down_m:  # its weight and rigid part, which is not where the payload's own parameters have it
                add(way, drive, point)
                add(way, driven(way, com), com, 1.0)
                aside = -down_m * way[:, 2:] * way
                moment[..., 0] -= gravity * np.cross(aside, up)
        moment[..., 1:] -= skew(force[..., 0])  # moving the point by r moves the force: r x f = -f x r
        return trial.of_wrench(force, moment)

    def finer(self, shape):
        longer = (0.85, 0.9, 0.95, 0.975, 0.9875, 1.0125, 1.025, 1.05, 1.1, 1.15)
        more = (0.5, 0.7, 0.85, 0.95, 1.05, 1.2, 1.4)  # swings less: the mass comes out larger
        length, damping = shape["length_m"], shape["damping_ratio"]
        near = [{"length_m": length * x} for x in longer]
        near += [
            {"length_m": length * x, "damping_ratio": damping * y} for x in (0.98, 1.0, 1.02) for y in more
        ]
        near += _nearer_mode(shape) if len(shape) > 2 else []
        return [other for other in ({**shape, **moved} for moved in near) if _tried(other)]

    def further(self, shape):
        return [
            x for x in ({**shape, **more} for more in _second_modes(shape)) if len(shape) == 2 and _tried(x)
        ]

    def alike(self, shape):
        return rules.SLOSH_SECONDS if len(shape) > 2 else self.among

    def slope_step(self, name, number):
        return self.determined[name] if name == "heading_rad" else super().slope_step(name, number)

    def possible(self, values, se, shape):
        """A mass that is there, swings, and hangs within the payload's reach."""
        within = np.abs(values[1:]) <= rules.SLOSH_REACH_M * max(values[0], 0.0) + 2.0 * se[1:]
        swings = shape["damping_ratio"] <= rules.SLOSH_SWINGS and 0.0 < shape.get("second_share", 0.5) < 1.0
        return bool(values[0] > 2.0 * se[0] and within.all() and swings)

    def physical(self, values, context):
        mass = values[0] if abs(values[0]) > 1e-6 else 1e-6
        point = context.p_1c + values[1:] / mass
        plain = {"across_length_m": 0.0, "heading_rad": 0.0, "second_length_m": 0.0, "second_share": 0.0}
        return {"mass_kg": float(mass), **plain, **context.shape} | {
            f"point_{axis}_m": float(x) for axis, x in zip("xyz", point, strict=True)
        }


def _second_modes(shape: Shape) -> list[Shape]:
    """What a shape with one mode lacks of one with two."""
    length_m = shape["length_m"]
    two: list[Shape] = [
        {"across_length_m": length_m * x, "heading_rad": turn}
        for x in rules.SLOSH_ACROSS
        for turn in rules.SLOSH_HEADINGS_RAD
    ]
    return two + [
        {"second_length_m": length_m * x, "second_share": rules.SLOSH_SHARE} for x in rules.SLOSH_SECOND
    ]


def _nearer_mode(shape: Shape) -> list[Shape]:
    """Numbers of the second mode, changed."""
    name = "across_length_m" if "across_length_m" in shape else "second_length_m"
    near: list[Shape] = [{name: shape[name] * x} for x in rules.SLOSH_SECOND_FINER]
    if name == "across_length_m":
        return near + [{"heading_rad": shape["heading_rad"] + x} for x in rules.SLOSH_HEADINGS_FINER_RAD]
    return near + [{"second_share": shape["second_share"] * x} for x in rules.SLOSH_SHARES_FINER]


def _tried(shape: Shape) -> bool:
    """Whether pendulums are so long and so little damped that it is worth a try."""
    least, most = rules.SLOSH_LENGTHS_M
    lengths = [x for name, x in shape.items() if name.endswith("length_m")]
    share = shape.get("second_share", 0.5)
    return all(least <= x <= most for x in lengths) and (
        shape["damping_ratio"] <= rules.SLOSH_MOST_DAMPED and share < 1.0
    )


def _ways(R_b1: Array, shape: Shape) -> tuple[Array, Array]:
    """Level directions of its swings in {1}, shapes (Q, 3): along and across; if they are alike, x and y of {b1}."""
    if "across_length_m" not in shape:
        return R_b1[:, 0], R_b1[:, 1]
    turn = shape["heading_rad"]
    c, s = (R_b1 @ [np.cos(turn), np.sin(turn), 0.0])[:, :2].T
    c, s = (x[:, None] / np.hypot(c, s)[:, None] for x in (c, s))
    x, y = R_b1[:, 0], R_b1[:, 1]
    return c * x + s * y, c * y - s * x


def _swing(drive: Array, turned: Array, rate_hz: float, gravity: float, shape: Shape) -> tuple[Array, Array]:
    """Relative acceleration of 1 kg that swings [m/s^2] and the moment of its damper [N m], from rest, (Q, 4) each.

    Args:
        drive: acceleration of the point along its way, linear between samples, and by moments of the mass, (Q, 4).
        turned: rate at which the payload turns about its axis [rad/s], shape (Q,).
        rate_hz, gravity: of samples; of the place [m/s^2].
        shape: its lengths, their shares, and its damping ratio.
    """
    second = shape.get("second_share", 0.0)
    modes = [(1.0 - second, shape["length_m"])]
    modes += [(second, shape["second_length_m"])] if second else []
    swing, damped = np.zeros_like(drive), np.zeros_like(drive)
    for share, length_m in modes:
        damping_per_s = 2.0 * shape["damping_ratio"] * np.sqrt(gravity / length_m)
        own, behind = drive.copy(), length_m * turned  # how fast it would swing if it turned with the payload
        own[:, 0] -= damping_per_s * behind
        pendulum = rate_hz, gravity, length_m, shape["damping_ratio"]
        speed = _through(_filter(1, *pendulum), own)
        speed[:, 0] -= behind
        swing += share * _through(_filter(0, *pendulum), own)
        damped += share * damping_per_s * length_m * speed
    return swing, damped


def _through(a_filter: tuple[Array, Array], x: Array) -> Array:
    return np.asarray(lfilter(*a_filter, x, axis=0), dtype=np.float64)


@lru_cache(maxsize=256)
def _filter(
    integrals: int, rate_hz: float, gravity: float, length_m: float, damping_ratio: float
) -> tuple[Array, Array]:
    """Numerator and denominator, the same in every trial, of acceleration (0 integrals) or speed (1)."""
    w = np.sqrt(gravity / length_m)
    pendulum = [-1.0, *[0.0] * (2 - integrals)], [1.0, 2.0 * damping_ratio * w, w**2]
    discrete = cast("tuple[Array, Array, float]", cont2discrete(pendulum, 1.0 / rate_hz, method="foh"))
    return np.ravel(discrete[0]), discrete[1]
