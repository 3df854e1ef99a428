"""Recordings of a payload that three Omnids carry along an analytic path: exact sensors, known truth.

The path is a sum of sines; its derivatives and those of the joint angles are eighth-order differences of
exact values on a 4 ms grid, whatever the sampling rate. Forces obey Newton-Euler, internal forces on top.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.delta import inverse_kinematics, jacobian
from estimator.arm.dynamics import arm_torque, gimbal_torque
from estimator.arm.unit import AT, ArmUnit
from estimator.recording.model import Recording
from omnid_design import DESIGN
from recordings import metadata

MASS = 11.672
COM = np.array([0.537, 0.156, 0.072])  # in {1}, [m]
INERTIA = np.array(
    [[3.208, 0.08, 0.01], [0.08, 2.325, -0.02], [0.01, -0.02, 5.524]]
)  # about the CoM, axes of {1}
GRASPS = [
    (np.eye(3), np.zeros(3)),
    (np.eye(3), np.array([0.647, 0.533, 0.0])),
    (Rotation.from_euler("z", -90, degrees=True).as_matrix(), np.array([1.104, -0.305, 0.0])),
]  # R_1i, p_1i
HOME = np.array([0.0, 0.0, DESIGN.home_height_m])
GRAVITY = np.array([0.0, 0.0, DESIGN.gravity_mps2])

FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])


STEP_S = 4e-3


def derivatives(values):
    """Value, first and second derivative of values (Q, 9, ...) at Q times and four steps to either side."""
    first, second = (np.tensordot(values, w, axes=(1, 0)) / STEP_S**k for k, w in ((1, FIRST), (2, SECOND)))
    return values[:, 4], first, second


@dataclass(frozen=True)
class Sines:
    """Sums of sines with given effective amplitudes [unit of the signal], one column per signal."""

    amplitude: np.ndarray
    frequency_hz: np.ndarray
    phase: np.ndarray

    @classmethod
    def draw(cls, rng, effective, count, low_hz, high_hz):
        shape = count, len(effective)
        amplitude = rng.uniform(0.3, 1.0, shape)
        amplitude *= np.asarray(effective) / np.sqrt(np.sum(amplitude**2, axis=0) / 2)
        return cls(amplitude, rng.uniform(low_hz, high_hz, shape), rng.uniform(0, 2 * np.pi, shape))

    def __call__(self, time):
        angle = 2 * np.pi * self.frequency_hz * np.asarray(time)[..., None, None] + self.phase
        return np.sum(self.amplitude * np.sin(angle), axis=-2)


@dataclass(frozen=True)
class Carried:
    """A recording and the exact data behind it.

    twist, twist_dot, wrench: as in GraspData, shape (Q, N, 6), of the unfiltered motion.
    """

    recording: Recording
    twist: np.ndarray
    twist_dot: np.ndarray
    wrench: np.ndarray


def carry(
    path: Sines, squeeze: Sines, duration_s: float, rate_hz: float = 100.0, units: ArmUnit | None = None
) -> Carried:
    """path: roll, pitch, yaw [rad] and CoM displacement [m]; squeeze: three internal forces [N].

    units: what the robots are really like; the recording does not say so.
    """
    arms = [DESIGN] * 3 if units is None else [ArmUnit(DESIGN, x) for x in units.x]
    time = np.arange(round(duration_s * rate_hz)) / rate_hz
    x = path(time[:, None] + STEP_S * np.arange(-4, 5))
    R = as_matrix("xyz", x[..., :3])  # {1} in the world
    twists, motion = [], []
    for (R_1i, p_1i), arm in zip(GRASPS, arms, strict=True):
        # Each base frame {b} is turned like the grasp frame of its robot at rest.
        R_bi = R_1i.T @ R @ R_1i
        p_bi = (x[..., 3:] + np.einsum("...ij,j->...i", R, p_1i - COM) - (p_1i - COM)) @ R_1i + HOME
        twists.append(twist_of(R_bi, p_bi))
        if units is not None:  # in the arm's own frame, which may not stand level
            R_bi, p_bi = arm.R_ba.T @ R_bi, p_bi @ arm.R_ba
        theta = Rotation.from_matrix(R_bi.reshape(-1, 3, 3)).as_euler("ZYX").reshape(p_bi.shape)
        motion.append(derivatives(np.concatenate([inverse_kinematics(p_bi, arm), theta], axis=-1)))
    twist, twist_dot = (np.stack(parts, axis=1) for parts in zip(*twists, strict=True))
    omega, omega_dot = twist[:, 0, :3], twist_dot[:, 0, :3]  # {1} is also the payload's frame
    force = MASS * np.einsum("qji,qj->qi", R[:, 4], derivatives(x)[2][:, 3:] + GRAVITY)
    moment = omega_dot @ INERTIA + np.cross(omega, omega @ INERTIA)

    phi, theta = ([[x[:, part] for x in m] for m in motion] for part in (slice(0, 3), slice(3, 6)))
    m_i = [gimbal_moment(*theta[i]) for i in range(3)]
    moment = moment - sum(m @ R_1i.T for m, (R_1i, _) in zip(m_i, GRASPS, strict=True))
    f_1 = shared(force, moment, squeeze(time))
    f_i = [f_1[:, i] @ GRASPS[i][0] for i in range(3)]
    tau = [
        np.einsum("qij,qi->qj", jacobian(phi[i][0], arms[i]), turned(theta[i][0], f_i[i]))
        + arm_torque(*phi[i], arms[i])
        for i in range(3)
    ]
    read = np.stack([p[0] for p in phi], 1), np.stack([t[0] for t in theta], 1), np.stack(tau, 1)
    if units is not None:
        phi_zero, theta_zero, tau_zero, ratio = (
            units.x[:, AT[name]] for name in ("phi_zero", "theta_zero", "tau_zero", "stiffness_ratio")
        )
        read = read[0] + phi_zero, read[1] + theta_zero, read[2] / (1.0 + ratio) + tau_zero
    recording = Recording(
        time=time,
        phi=read[0],
        theta=read[1],
        tau=read[2],
        ref=None,
        metadata=metadata(rate_hz=rate_hz),
    )
    wrench = np.stack([np.concatenate(pair, axis=-1) for pair in zip(m_i, f_i, strict=True)], axis=1)
    return Carried(recording, twist, twist_dot, wrench)


def as_matrix(sequence, angles):
    return Rotation.from_euler(sequence, angles.reshape(-1, 3)).as_matrix().reshape(*angles.shape, 3)


def twist_of(R_bi, p_bi):
    """Body twist and its derivative, each (Q, 6), from poses at (Q, 9) times."""
    (R, R_dot, R_ddot), (_, p_dot, p_ddot) = derivatives(R_bi), derivatives(p_bi)
    spin = np.swapaxes(R, -1, -2) @ R_dot
    spin_dot = np.swapaxes(R, -1, -2) @ R_ddot + np.swapaxes(R_dot, -1, -2) @ R_dot
    omega, omega_dot = (np.stack([s[:, 2, 1], s[:, 0, 2], s[:, 1, 0]], axis=-1) for s in (spin, spin_dot))
    v = np.einsum("qji,qj->qi", R, p_dot)
    v_dot = np.einsum("qji,qj->qi", R, p_ddot) + np.einsum("qji,qj->qi", R_dot, p_dot)
    return np.concatenate([omega, v], axis=-1), np.concatenate([omega_dot, v_dot], axis=-1)


def turned(theta, vector):
    """Vector of {i} in {b}."""
    return Rotation.from_euler("ZYX", theta).apply(vector)


def gimbal_moment(theta, theta_dot, theta_ddot):
    """Moment on the payload in {i}: no work on any gimbal axis beyond what the gimbal's bodies take."""
    torque = gimbal_torque(theta, theta_dot, theta_ddot, DESIGN)
    z, y, x = (np.tile(axis, (len(theta), 1)) for axis in np.eye(3)[::-1])
    about_x = Rotation.from_euler("X", theta[:, 2:])
    about_yx = Rotation.from_euler("YX", theta[:, 1:])
    axes = np.stack([about_yx.inv().apply(z), about_x.inv().apply(y), x], axis=1)  # rows, in {i}
    return -np.linalg.solve(axes, torque[..., None])[..., 0]


def shared(force, moment, squeeze):
    """Forces at the three grasps in {1}, shape (Q, 3, 3): least norm, plus the squeeze that cancels out."""
    arms = [p_1i - COM for _, p_1i in GRASPS]
    grasp_matrix = np.block(
        [[np.eye(3)] * 3, [np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) for x, y, z in arms]]
    )
    internal = np.linalg.svd(grasp_matrix)[2][6:]
    forces = np.concatenate([force, moment], axis=-1) @ np.linalg.pinv(grasp_matrix).T + squeeze @ internal
    return forces.reshape(-1, 3, 3)


def inertia_by_least_squares(data):
    """Inertia about the CoM in {1} from GraspData with grasps and CoM known: one plain least squares."""
    omega, omega_dot = data.twist[:, 0, :3], data.twist_dot[:, 0, :3]
    basis = []
    for i, j in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]:
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1.0
        basis.append(unit)
    regressor = np.stack([omega_dot @ b + np.cross(omega, omega @ b) for b in basis], axis=-1)
    moment = sum(
        data.wrench[:, i, :3] @ R_1i.T + np.cross(p_1i - COM, data.wrench[:, i, 3:] @ R_1i.T)
        for i, (R_1i, p_1i) in enumerate(GRASPS)
    )
    solution = np.linalg.lstsq(regressor.reshape(-1, 6), moment.ravel(), rcond=None)[0]
    return sum(s * b for s, b in zip(solution, basis, strict=True))
