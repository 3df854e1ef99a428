"""A mass that swings in the payload."""

import numpy as np
from scipy.signal import cont2discrete, lfilter

from discrepancy.team.causes.base import Cause, stack
from estimator.fusion import fuse


class Slosh(Cause):
    """A pendulum that hangs from a point of the payload; what it does beyond riding along rigidly.

    Small swings x relative to the point obey x'' + 2 zeta w x' + w^2 x = -a with w^2 = g / length; the payload feels
    -mass x'' at the point. Its weight and rigid part are in the payload's own parameters.
    """

    name = "slosh"
    family = "slosh"
    parameters = ("mass_kg", "moment_x_kgm", "moment_y_kgm", "moment_z_kgm")
    scales = (0.01, 0.005, 0.005, 0.005)
    per = "payload"
    shapes = tuple(
        {"length_m": length, "damping_ratio": damping}
        for length in (0.2, 0.05, 0.065, 0.085, 0.11, 0.145, 0.27, 0.37, 0.5, 0.7)
        for damping in (0.05, 0.15)
    )
    separate = "Motion near the pendulum's own frequency."

    def columns(self, trial, robot, joint, shape):  # noqa: D102
        motion = fuse(trial.data, trial.shared.grasps)
        com = trial.shared.pi[1:4] / trial.shared.pi[0]
        R_b1 = trial.data.R_bi[:, 0]
        a = motion.acceleration + np.cross(motion.alpha, com)
        a += np.cross(motion.omega, np.cross(motion.omega, com))
        a = np.einsum("qij,qj->qi", R_b1, a) * np.array([1.0, 1.0, 0.0])
        swing = _swing(a, trial.signals.rate_hz, trial.data.gravity_mps2, shape)
        force = np.einsum("qji,qj->qi", R_b1, -swing)
        none = np.zeros_like(force)
        columns = [trial.of_wrench(force, np.cross(com, force))]
        columns += [trial.of_wrench(none, np.cross(axis, force)) for axis in np.eye(3)]
        return stack(columns)

    def physical(self, values, context):  # noqa: D102
        mass = values[0] if abs(values[0]) > 1e-6 else 1e-6
        point = context.p_1c + values[1:] / mass
        return {"mass_kg": float(mass), **context.shape} | {
            f"point_{axis}_m": float(x) for axis, x in zip("xyz", point, strict=True)
        }


def _swing(a, rate_hz, gravity, shape):
    """Relative acceleration of the swinging mass [m/s^2], shape (Q, 3)."""
    w = np.sqrt(gravity / shape["length_m"])
    system = ([-1.0, 0.0, 0.0], [1.0, 2.0 * shape["damping_ratio"] * w, w**2])
    b, poles, _ = cont2discrete(system, 1.0 / rate_hz, method="foh")
    return lfilter(b.ravel(), poles, a, axis=0)
