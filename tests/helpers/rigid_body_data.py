"""Synthetic data of one rigid body held at N grasps, computed apart from the estimator.

The body's pose is analytic: sums of sines in position and in roll-pitch-yaw angles, differentiated by hand.
Newton-Euler is applied about the centre of mass in the world frame, and the wrench is shared among the grasps
at random, with internal forces and moments.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from estimator.signals import GraspData

GRAVITY = 9.81
RATE = 100.0


@dataclass(frozen=True)
class Body:
    """A payload: mass, centre of mass in {1}, inertia about it in the axes of {1}, grasps in {1}."""

    mass: float
    p_1c: np.ndarray
    inertia: np.ndarray
    R_1i: np.ndarray  # (N, 3, 3)
    p_1i: np.ndarray  # (N, 3)


def make_body(N: int = 3, seed: int = 0) -> Body:
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(np.deg2rad([1.0, -2.0, 30.0])).as_matrix()
    R_1i = np.concatenate([np.eye(3)[None], Rotation.random(N - 1, rng=rng).as_matrix().reshape(-1, 3, 3)])
    p_1i = np.concatenate([np.zeros((1, 3)), rng.uniform(-1, 1, (N - 1, 3)) * [1, 1, 0.1]])
    return Body(11.0, np.array([0.4, 0.2, 0.07]), R @ np.diag([2.1, 3.3, 5.2]) @ R.T, R_1i, p_1i)


def _sines(t, amplitudes, frequencies, phases):
    """Value, first and second derivative, each (Q, K)."""
    arg = 2 * np.pi * np.outer(t, np.ones(len(amplitudes))) * frequencies + phases
    w = 2 * np.pi * np.asarray(frequencies)
    return amplitudes * np.sin(arg), amplitudes * w * np.cos(arg), -amplitudes * w**2 * np.sin(arg)


def body_pose(t, angle_amplitude=(0.08, 0.09, 0.05), shift_amplitude=(0.04, 0.05, 0.03), seed=1):
    """Pose of {1} in the world and its derivatives: R, omega, alpha (body), p, p-dot, p-ddot (world)."""
    rng = np.random.default_rng(seed)
    f = rng.uniform(0.3, 0.8, (2, 2, 3))
    ph = rng.uniform(0, 6, (2, 2, 3))

    def two(amplitude, k):
        a = [_sines(t, np.asarray(amplitude) * s, f[k, i], ph[k, i]) for i, s in ((0, 0.7), (1, 0.5))]
        return [u + v for u, v in zip(*a, strict=True)]

    e, ed, edd = two(angle_amplitude, 0)  # yaw-pitch-roll as (roll, pitch, yaw)
    p, pd, pdd = two(shift_amplitude, 1)
    R = Rotation.from_euler("ZYX", e[:, ::-1]).as_matrix()
    # Body rates of Z-Y-X Euler angles: omega = roll' x + Rx^T (pitch' y + Ry^T yaw' z), differentiated once.
    (r, q), (rd, qd, yd), (rdd, qdd, ydd) = (e[:, 0], e[:, 1]), ed.T, edd.T
    sr, cr, sq, cq = np.sin(r), np.cos(r), np.sin(q), np.cos(q)
    omega = np.stack([rd - sq * yd, cr * qd + sr * cq * yd, -sr * qd + cr * cq * yd], axis=1)
    alpha = np.stack(
        [
            rdd - sq * ydd - cq * qd * yd,
            cr * qdd - sr * rd * qd + sr * cq * ydd + (cr * cq * rd - sr * sq * qd) * yd,
            -sr * qdd - cr * rd * qd + cr * cq * ydd + (-sr * cq * rd - cr * sq * qd) * yd,
        ],
        axis=1,
    )
    return R, omega, alpha, p, pd, pdd


def low_passed_noise(rng, shape, std, cutoff_hz=5.0):
    """White noise of standard deviation ``std`` before a zero-phase Butterworth low-pass, axis 0 is time."""
    sos = butter(3, cutoff_hz, fs=RATE, output="sos")
    padded = rng.normal(0, std, (shape[0] + 200, *shape[1:]))
    return sosfiltfilt(sos, padded, axis=0)[100:-100]


def make_data(
    body: Body,
    pose,
    t,
    *,
    seed=2,
    internal=5.0,
    moments=True,
    twist_noise=0.0,
    linear_noise=0.0,
    wrench_noise=0.0,
    constant_share=False,
) -> GraspData:
    """Data points for a pose as from ``body_pose``; noise is drawn before low-passing and differencing."""
    rng = np.random.default_rng(seed)
    R_w1, omega, alpha, p_w1, v_w, a_w = pose
    Q, N = len(t), len(body.p_1i)
    omega_w, alpha_w = (np.einsum("qab,qb->qa", R_w1, x) for x in (omega, alpha))
    arm = R_w1 @ body.p_1c
    a_c = a_w + np.cross(alpha_w, arm) + np.cross(omega_w, np.cross(omega_w, arm))
    force_w = body.mass * (a_c + np.array([0, 0, GRAVITY]))
    inertia_w = R_w1 @ body.inertia @ R_w1.transpose(0, 2, 1)
    moment_w = np.einsum("qab,qb->qa", inertia_w, alpha_w) + np.cross(
        omega_w, np.einsum("qab,qb->qa", inertia_w, omega_w)
    )
    # Share out: random forces and moments for robots 2..N, the rest, whatever it is, for robot 1.
    lever = np.einsum("qab,ib->qia", R_w1, body.p_1i - body.p_1c)
    slow = np.zeros((Q, N, 3)) if constant_share else np.cumsum(rng.normal(0, 0.02, (Q, N, 3)), axis=0)
    f_w = internal * np.sin(slow + rng.uniform(0, 6, (N, 3))) + force_w[:, None] / N
    m_w = (0.2 * internal * np.cos(slow) if moments else np.zeros((Q, N, 3))) * np.ones((Q, N, 3))
    f_w[:, 0] = force_w - f_w[:, 1:].sum(axis=1)
    m_w[:, 0] = moment_w - m_w[:, 1:].sum(axis=1) - np.cross(lever, f_w).sum(axis=1)

    # Every robot's base is level but turned about the vertical by its own unknown angle.
    yaw = Rotation.from_rotvec(rng.uniform(-3, 3, N)[:, None] * [0, 0, 1]).as_matrix()
    R_wi = np.einsum("qab,ibc->qiac", R_w1, body.R_1i)
    R_bi = np.einsum("iba,qibc->qiac", yaw, R_wi)
    arm_i = np.einsum("qab,ib->qia", R_w1, body.p_1i)
    o, al = omega_w[:, None], alpha_w[:, None]
    v_i = v_w[:, None] + np.cross(o, arm_i)
    a_i = a_w[:, None] + np.cross(al, arm_i) + np.cross(o, np.cross(o, arm_i))

    def local(x):
        return np.einsum("qiba,qib->qia", R_wi, np.broadcast_to(x, (Q, N, 3)))

    w_b, v_b = local(o), local(v_i)
    twist = np.concatenate([w_b, v_b], axis=2)
    twist_dot = np.concatenate([local(al), local(a_i) - np.cross(w_b, v_b)], axis=2)
    wrench = np.concatenate([local(m_w), local(f_w)], axis=2)
    if twist_noise or linear_noise:
        std = np.repeat([twist_noise, linear_noise], 3)
        e = low_passed_noise(rng, (Q, N, 6), 1.0) * std
        twist = twist + e
        twist_dot = twist_dot + np.gradient(e, 1 / RATE, axis=0)
    if wrench_noise:
        wrench = wrench + low_passed_noise(rng, (Q, N, 6), wrench_noise) * (
            1.0 if moments else [0, 0, 0, 1, 1, 1]
        )
    return GraspData(
        time=t,
        R_bi=R_bi,
        p_bi=np.einsum("iba,qib->qia", yaw, p_w1[:, None] + arm_i),
        twist=twist,
        twist_dot=twist_dot,
        wrench=wrench,
        rate_hz=RATE,
        gravity_mps2=GRAVITY,
    )


def moving(body: Body, duration=30.0, seed=1, pose_options=None, **options) -> GraspData:
    """A trial of smooth motion in all six degrees of freedom."""
    t = np.arange(round(duration * RATE)) / RATE
    return make_data(body, body_pose(t, seed=seed, **(pose_options or {})), t, seed=seed + 100, **options)


def still(body: Body, tilts, seconds=8.0, travel=2.0, **options) -> GraspData:
    """Holds at the given (roll, pitch) [rad] with smooth transitions in between."""
    n, k = round(seconds * RATE), round(travel * RATE)
    s = np.linspace(0, 1, k + 2)[1:-1]
    ramp = 10 * s**3 - 15 * s**4 + 6 * s**5
    angles = [np.tile(tilts[0], (n, 1))]
    for a, b in pairwise(tilts):
        angles += [np.asarray(a) + ramp[:, None] * (np.asarray(b) - a), np.tile(b, (n, 1))]
    e = np.concatenate(angles)
    t = np.arange(len(e)) / RATE
    ed = np.gradient(e, 1 / RATE, axis=0)
    edd = np.gradient(ed, 1 / RATE, axis=0)
    r = e[:, 0]
    R = Rotation.from_euler("YX", e[:, ::-1]).as_matrix()
    omega = np.stack([ed[:, 0], np.cos(r) * ed[:, 1], -np.sin(r) * ed[:, 1]], axis=1)
    alpha = np.stack(
        [
            edd[:, 0],
            np.cos(r) * edd[:, 1] - np.sin(r) * ed[:, 0] * ed[:, 1],
            -np.sin(r) * edd[:, 1] - np.cos(r) * ed[:, 0] * ed[:, 1],
        ],
        axis=1,
    )
    zero = np.zeros((len(t), 3))
    return make_data(body, (R, omega, alpha, zero, zero, zero), t, **{"constant_share": True, **options})
