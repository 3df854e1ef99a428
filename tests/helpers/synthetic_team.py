"""Robots as they are that carry a rigid payload along an analytic path: exact joint motion and torques, no simulator.

Poses are sums of sines; joint angles follow by inverse kinematics of each arm as built, their derivatives by
eighth-order differences on a grid of their own, forces by Newton and Euler about the centre of mass in a level world
frame, internal forces on top, and torques from the forces by virtual work.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.delta import inverse_kinematics, jacobian
from estimator.arm.dynamics import arm_torque
from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.calibrate.prior import Prior
from estimator.estimate.grasps import GraspEstimate
from estimator.recording.model import Recording
from estimator.rigid_team import Bases, Shared
from omnid_design import DESIGN
from recorded_team import STEP_S, Sines, as_matrix, derivatives, gimbal_moment
from recordings import metadata

GRAVITY = np.array([0.0, 0.0, DESIGN.gravity_mps2])
HOME = np.array([0.0, 0.0, DESIGN.home_height_m])


@dataclass(frozen=True)
class Load:
    """A payload and how it is held: mass, centre of mass in {1}, inertia about it, grasps in {1}."""

    mass: float
    com: np.ndarray
    inertia: np.ndarray
    R_1i: np.ndarray
    p_1i: np.ndarray

    @property
    def shared(self) -> Shared:
        """As the calibration states it, parallel-axis theorem in components."""
        x, y, z = self.com
        offset = np.array([[y * y + z * z, -x * y, -x * z], [-x * y, x * x + z * z, -y * z],
                           [-x * z, -y * z, x * x + y * y]])  # fmt: skip
        J, N = self.inertia + self.mass * offset, len(self.p_1i)
        nothing, six = np.zeros((N, N)), 6 * (N - 1)
        grasps = GraspEstimate(
            self.R_1i, self.p_1i, np.zeros((six, six)), nothing, nothing, np.zeros(N), np.zeros(N)
        )
        pi = [self.mass, *(self.mass * self.com), J[0, 0], J[0, 1], J[0, 2], J[1, 1], J[1, 2], J[2, 2]]
        return Shared(grasps, np.array(pi))


def load(robots: int, rng: np.random.Generator) -> Load:
    """Three or more grasps on a circle, turned about the vertical and a little tilted.

    Two would let the payload swing about the line between them, on a path that is not to be chosen.
    """
    angle = 2.0 * np.pi * np.arange(robots) / robots
    radius = 0.7
    p = radius * np.column_stack([np.cos(angle) - 1.0, np.sin(angle), 0.05 * np.sin(3 * angle + 1)])
    p -= p[0]
    tilt = rng.uniform(-0.06, 0.06, (robots, 2))
    R = Rotation.from_euler("ZYX", np.column_stack([angle, tilt])).as_matrix()
    R = R[0].T @ R
    turn = Rotation.from_rotvec([0.1, -0.2, 0.4]).as_matrix()
    inertia = turn @ np.diag([0.5, 0.7, 1.1]) @ turn.T * robots
    com = np.array([-0.85 * radius, 0.1, -0.05])
    return Load(3.6 * robots, com, inertia, R, p)


def draw_units(robots: int, prior: Prior, rng: np.random.Generator) -> ArmUnit:
    """Robots drawn from a prior, the mean of their spring ratios 0."""
    factor = prior.factor(robots, hold_scale=True)
    return ArmUnit(DESIGN, (factor @ rng.standard_normal(factor.shape[1])).reshape(robots, COUNT))


def draw_path(held: Load, rng: np.random.Generator) -> Sines:
    """Roll, pitch, yaw [rad] and displacement [m] of {1}, so small that every arm follows."""
    turn = 0.03 / max(0.5, np.linalg.norm(held.p_1i, axis=1).max())
    return Sines.draw(rng, [turn, turn, 1.3 * turn, 0.02, 0.02, 0.015], 3, 0.1, 0.9)


@dataclass(frozen=True)
class Exact:
    """A trial without noise.

    Attributes:
        recording: readings of the robots.
        bases: where they stood.
        truth: true signals in the order of ``slots``, shape (Q, N, 21).
    """

    recording: Recording
    bases: Bases
    truth: np.ndarray


def carry(
    units: ArmUnit,
    held: Load,
    path: Sines,
    rng: np.random.Generator,
    duration_s=20.0,
    rate_hz=100.0,
    **labels,
) -> Exact:
    """A trial; ``labels`` go into its metadata."""
    time = np.arange(round(duration_s * rate_hz)) / rate_hz
    x = path(time[:, None] + STEP_S * np.arange(-4, 5))
    R_W1 = as_matrix("xyz", x[..., :3])
    p_W1 = x[..., 3:]
    N = len(held.p_1i)
    # Every base stands under its grasp at rest, turned roughly as that is, but not exactly; {W} is {b1} at its height.
    yaw = Rotation.from_matrix(held.R_1i).as_euler("ZYX")[:, 0] + rng.uniform(-0.1, 0.1, N)
    R_Wb = Rotation.from_rotvec(yaw[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    p_Wb = held.p_1i - HOME + 0.02 * rng.uniform(-1.0, 1.0, (N, 3))
    R_Wb[0] = np.eye(3)
    p_Wb[0] = -HOME

    motion = []
    for i in range(N):
        tilt = Rotation.from_rotvec([*units.x[i, AT["tilt"]], 0.0]).as_matrix()
        R_Wa = R_Wb[i] @ tilt
        R_ai = R_Wa.T @ R_W1 @ held.R_1i[i]
        h_a = (p_W1 + R_W1 @ held.p_1i[i] - p_Wb[i]) @ R_Wa
        theta = Rotation.from_matrix(R_ai.reshape(-1, 3, 3)).as_euler("ZYX").reshape(h_a.shape)
        phi = inverse_kinematics(h_a, ArmUnit(units.design, units.x[i]))
        motion.append(derivatives(np.concatenate([phi, theta], axis=-1)))

    force_W, moment_W = _needed(held, R_W1, p_W1)
    R = R_W1[:, 4]
    force_1, moment_1 = (np.einsum("qji,qj->qi", R, v) for v in (force_W, moment_W))
    m_i = []
    for i in range(N):
        theta = tuple(part[:, 3:] for part in motion[i])
        m_i.append(gimbal_moment(*theta))
        moment_1 = moment_1 - m_i[i] @ held.R_1i[i].T
    f_1 = _shared(held, force_1, moment_1, rng, time)

    s = np.zeros((len(time), N, 21))
    for i in range(N):
        unit = ArmUnit(units.design, units.x[i])
        phi = tuple(part[:, :3] for part in motion[i])
        theta = tuple(part[:, 3:] for part in motion[i])
        f_a = Rotation.from_euler("ZYX", theta[0]).apply(f_1[:, i] @ held.R_1i[i])
        tau = np.einsum("qij,qi->qj", jacobian(phi[0], unit), f_a) + arm_torque(*phi, unit)
        s[:, i] = np.concatenate([*phi, *theta, tau], axis=1)
    readings = [s[..., :3] + units.of("phi_zero"), s[..., 9:12] + units.of("theta_zero")]
    readings.append(s[..., 18:] / (1.0 + units.of("stiffness_ratio")) + units.of("tau_zero"))
    about = metadata(robots=N, rate_hz=rate_hz, design=units.design, **labels)
    R_b = R_Wb[0].T @ R_Wb
    return Exact(
        Recording(time, *readings, ref=None, metadata=about, name="synthetic"), Bases(R_b, p_Wb - p_Wb[0]), s
    )


def with_noise(
    recording: Recording, angle_rad: float, torque_Nm: float, rng: np.random.Generator
) -> Recording:
    """White Gaussian noise in every reading."""
    shape = recording.phi.shape
    return replace(
        recording,
        phi=recording.phi + angle_rad * rng.standard_normal(shape),
        theta=recording.theta + angle_rad * rng.standard_normal(shape),
        tau=recording.tau + torque_Nm * rng.standard_normal(shape),
    )


def _needed(held: Load, R_W1, p_W1):
    """Force, and moment about the centre of mass, that move the payload, both in the world, from poses (Q, 9)."""
    com = p_W1 + R_W1 @ held.com
    force = held.mass * (derivatives(com)[2] + GRAVITY)
    R, R_dot, R_ddot = derivatives(R_W1)
    spin = R_dot @ np.swapaxes(R, -1, -2)
    spin_dot = R_ddot @ np.swapaxes(R, -1, -2) + R_dot @ np.swapaxes(R_dot, -1, -2)
    omega, alpha = (np.stack([A[:, 2, 1], A[:, 0, 2], A[:, 1, 0]], axis=-1) for A in (spin, spin_dot))
    I_W = R @ held.inertia @ np.swapaxes(R, -1, -2)
    turned = np.einsum("qij,qj->qi", I_W, omega)
    return force, np.einsum("qij,qj->qi", I_W, alpha) + np.cross(omega, turned)


def _shared(held: Load, force, moment, rng, time):
    """Forces at the grasps in {1}, shape (Q, N, 3): least norm, and a slow squeeze that cancels out."""
    arms = held.p_1i - held.com
    N = len(arms)
    skew = [np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) for x, y, z in arms]
    G = np.block([[np.eye(3)] * N, skew])
    internal = np.linalg.svd(G)[2][6:]
    squeeze = Sines.draw(rng, [2.0] * len(internal), 3, 0.1, 0.6)(time)
    f = np.concatenate([force, moment], axis=1) @ np.linalg.pinv(G).T + squeeze @ internal
    return f.reshape(len(f), N, 3)
