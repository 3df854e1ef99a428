"""A mass that swings in the payload."""

from typing import ClassVar, cast

import numpy as np
from scipy.signal import cont2discrete, lfilter

from discrepancy import rules
from discrepancy.team.causes.base import Cause
from estimator.arrays import Array
from estimator.estimate.fusion import fuse
from estimator.so3 import skew


class Slosh(Cause):
    """A pendulum that hangs from a point of the payload; what it does beyond riding along rigidly.

    Small swings x relative to the point obey x'' + 2 zeta w x' + w^2 x = -a with w^2 = g / length; the payload feels
    -mass x'' at the point. Its weight and rigid part are in the payload's own parameters.
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
    determined: ClassVar = {"length_m": 0.02, "damping_ratio": 0.1}
    separate = "Motion near the pendulum's own frequency."

    def sentence(self, n):
        return (
            f"a mass of {n('mass_kg', 'kg', signed=True)} swings in the payload on {n('length_m', 'm')} below "
            f"{n.vector('point', 'm')} in {{1}} (damping ratio {n('damping_ratio', '')})"
        )

    def columns(self, trial, robot, joint, shape):
        motion = fuse(trial.data, trial.shared.grasps)
        com = trial.shared.pi[1:4] / trial.shared.pi[0]
        omega, alpha = motion.omega, motion.alpha
        R_b1 = trial.data.R_bi[:, 0]
        # Accelerations of the point, and by how much more it is accelerated the further it is along each axis of {1}.
        points = np.concatenate([com[:, None], np.eye(3)], axis=1)
        driven = (skew(alpha) + skew(omega) @ skew(omega)) @ points
        driven[..., 0] += motion.acceleration
        across = R_b1[:, :2] @ driven
        # Force on the payload, in {1}, of 1 kg that hangs there.
        swing = _swing(across, trial.signals.rate_hz, trial.data.gravity_mps2, shape)
        force = -np.swapaxes(R_b1[:, :2], 1, 2) @ swing
        # Moving the point by r moves the force, and changes what drives the pendulum.
        moment = skew(com) @ force
        moment[..., 1:] -= skew(force[..., 0])  # r x f = -f x r
        return trial.of_wrench(force, moment)

    def finer(self, shape):
        longer = (0.85, 0.9, 0.95, 0.975, 0.9875, 1.0125, 1.025, 1.05, 1.1, 1.15)
        more = (0.5, 0.7, 0.85, 0.95, 1.05, 1.2, 1.4)  # swings less: the mass comes out larger
        length, damping = shape["length_m"], shape["damping_ratio"]
        shapes = [(length * x, damping) for x in longer]
        shapes += [(length * x, damping * y) for x in (0.98, 1.0, 1.02) for y in more]
        return [
            {"length_m": x, "damping_ratio": y}
            for x, y in shapes
            if rules.SLOSH_LENGTHS_M[0] <= x <= rules.SLOSH_LENGTHS_M[1] and y <= rules.SLOSH_MOST_DAMPED
        ]

    def possible(self, values, se, shape):
        """A mass that is there, swings, and hangs within the payload's reach."""
        within = np.abs(values[1:]) <= rules.SLOSH_REACH_M * max(values[0], 0.0) + 2.0 * se[1:]
        return bool(values[0] > 2.0 * se[0] and within.all() and shape["damping_ratio"] <= rules.SLOSH_SWINGS)

    def physical(self, values, context):
        mass = values[0] if abs(values[0]) > 1e-6 else 1e-6
        point = context.p_1c + values[1:] / mass
        return {"mass_kg": float(mass), **context.shape} | {
            f"point_{axis}_m": float(x) for axis, x in zip("xyz", point, strict=True)
        }


def _swing(a, rate_hz, gravity, shape):
    """Relative acceleration of the swinging mass [m/s^2] from rest, a linear between samples, shapes (Q, ...)."""
    w = np.sqrt(gravity / shape["length_m"])
    pendulum = [-1.0, 0.0, 0.0], [1.0, 2.0 * shape["damping_ratio"] * w, w**2]
    discrete = cast("tuple[Array, Array, float]", cont2discrete(pendulum, 1.0 / rate_hz, method="foh"))
    return np.asarray(lfilter(np.ravel(discrete[0]), discrete[1], a, axis=0), dtype=np.float64)
