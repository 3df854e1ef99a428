"""Initial values for two bodies: headings of the bases by a search, the rest by linear least squares.

The bases are level. One heading a robot therefore fixes the rotation of every grasp frame, and with these rotations the
closed loops are linear in grasps, base positions and pivot.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.spatial.transform import Rotation

from estimator import so3
from estimator.arrays import Array
from estimator.rigid_team import Bases, vee
from estimator.so3 import times
from estimator.two_bodies.team import Joint, Motion, Pair

GRID_RAD = np.deg2rad(4.0)
"""Spacing of the headings that the search tries first. Chosen: a tenth of the width of a minimum at 0.3 rad of tilt."""
DIRECTIONS = 400
"""Number of slide directions that the search tries first. Chosen: seven degrees apart."""

Poses = tuple[Array, Array]
"""Rotations (Q, N, 3, 3) and positions (Q, N, 3) of all grasps in their own bases, of one trial."""


def start(motion: Motion, halves: tuple[tuple[int, ...], tuple[int, ...]], trials: Sequence[Poses]) -> Pair:
    """Return initial values; grasps and joint come from the trial that turns most about its least turned direction."""
    main = trials[int(np.argmax([_excitation(R) for R, _ in trials]))]
    N = main[1].shape[1]
    R, p, b = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3)), halves[1][0]
    for first, *rest in halves:
        for i in rest:
            fixed = _joint_start("rigid", *(_of(main, k) for k in (first, i)))
            R[i], p[i] = fixed.R_0, fixed.p_0
    joint = _joint_start(motion, _of(main, 0), _of(main, b))
    pair = Pair(halves, R, p, joint, ())
    return Pair(halves, R, p, joint, tuple(bases_of(pair, trial) for trial in trials))


def rigid_residual(poses: Poses, i: int, j: int) -> float:
    """Return the rms of what a rigid connection of two grasps leaves: rotation [rad] and position [m] together."""
    A, B = _of(poses, i), _of(poses, j)
    joint = _joint_start("rigid", A, B)
    pair = Pair(((0,), (1,)), np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)), joint, ())
    both = np.stack([A[0], B[0]], axis=1), np.stack([A[1], B[1]], axis=1)
    left = pair.loops(*both, bases_of(pair, both))[1].left
    return float(np.sqrt(np.mean(np.sum(left**2, axis=1))))


def _of(poses: Poses, robot: int) -> Poses:
    return poses[0][:, robot], poses[1][:, robot]


def _excitation(R: Array) -> float:
    turned = Rotation.from_matrix(R[:, 0] @ so3.chordal_mean(R[:, 0]).T).as_rotvec()
    return float(np.linalg.eigvalsh(turned.T @ turned)[0]) + 1e-9 * len(R)


def _heading(cost: Callable[[Array], float]) -> Array:
    """Return the rotation about z that minimizes a cost."""
    angles = np.arange(0.0, 2.0 * np.pi, GRID_RAD)
    best = angles[int(np.argmin([cost(_turn(angle)) for angle in angles]))]
    found: float = minimize_scalar(  # type: ignore[attr-defined]
        lambda x: cost(_turn(x)), bounds=(best - GRID_RAD, best + GRID_RAD), method="bounded",
        options={"xatol": 1e-7},
    ).x  # fmt: skip
    return _turn(found)


def _turn(angle: float) -> Array:
    return Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()


def _scatter(rel: Array) -> Array:
    """Return the second moment of the rotations about their mean, shape (3, 3)."""
    turned = Rotation.from_matrix(rel @ so3.chordal_mean(rel).T).as_rotvec()
    return turned.T @ turned


def _joint_start(motion: Motion, A: Poses, B: Poses) -> Joint:
    """Return the joint between two grasps, from their poses in two bases with unknown places."""
    back = np.swapaxes(A[0], 1, 2)
    skip = 1 if motion == "hinged" else 0
    turn = _heading(lambda Z: float(np.linalg.eigvalsh(_scatter(back @ Z @ B[0]))[: 3 - skip].sum()))
    rel = back @ turn @ B[0]
    R_0 = so3.chordal_mean(rel)
    # In {A}: p = back (place + turn h_B - h_A), to be p_0 where nothing moves.
    seen = times(back, B[1] @ turn.T - A[1])
    if motion == "hinged":
        axis = np.linalg.eigh(_scatter(rel))[1][:, 2]
        axis *= np.sign(axis[np.argmax(np.abs(axis))])
        joint = Joint(motion, R_0, np.zeros(3), _basis(axis), np.zeros(3))
        q = joint.coordinates(rel, seen).q
        spin = Rotation.from_rotvec(q[:, None] * axis).as_matrix()
        # back place + seen = spin p_0 + (1 - spin) c, and c = across y.
        across = joint.axes[:, 1:]
        X = np.concatenate([-back, spin, (np.eye(3) - spin) @ across], axis=2)
        x = np.linalg.lstsq(X.reshape(-1, 8), seen.ravel(), rcond=1e-9)[0]
        pivot = across @ x[6:]
        pivot = pivot + axis * (axis @ (0.5 * x[3:6] - pivot))
        return Joint(motion, R_0, np.asarray(x[3:6], dtype=float), joint.axes, pivot)
    X = np.concatenate([-back, np.broadcast_to(np.eye(3), back.shape)], axis=2)
    if motion != "sliding":
        x = np.linalg.lstsq(X.reshape(-1, 6), seen.ravel(), rcond=1e-9)[0]
        return Joint(motion, R_0, np.asarray(x[3:], dtype=float), np.eye(3), np.zeros(3))
    moments = np.einsum("qik,qjl->ijkl", np.concatenate([X, seen[..., None]], axis=2),
                        np.concatenate([X, seen[..., None]], axis=2))  # fmt: skip

    def left(a: Array) -> tuple[float, Array]:
        gram = np.einsum("ij,ijkl->kl", np.eye(3) - np.outer(a, a), moments)
        x = np.linalg.lstsq(gram[:6, :6], gram[:6, 6], rcond=1e-12)[0]
        return float(gram[6, 6] - gram[6, :6] @ x), x

    k = np.arange(DIRECTIONS) + 0.5
    z, around = k / DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * k  # a half sphere
    rho = np.sqrt(1.0 - z**2)
    tried = np.column_stack([rho * np.cos(around), rho * np.sin(around), z])
    near = _basis(tried[int(np.argmin([left(a)[0] for a in tried]))])

    def beside(x: Array) -> Array:
        a = near @ [1.0, *x]
        return a / np.linalg.norm(a)

    axis = beside(minimize(lambda x: left(beside(x))[0], np.zeros(2), method="Nelder-Mead").x)
    axes = _basis(axis * np.sign(axis[np.argmax(np.abs(axis))]))
    x = left(axes[:, 0])[1]
    p_0 = x[3:] + axes[:, 0] * np.mean((seen + back @ x[:3] - x[3:]) @ axes[:, 0])  # zero in the middle
    return Joint(motion, R_0, p_0, axes, np.zeros(3))


def _basis(a: Array) -> Array:
    """Return a right-handed basis with a as its first column."""
    n = np.eye(3)[int(np.argmin(np.abs(a)))]
    n = n - a * (a @ n)
    n /= np.linalg.norm(n)
    return np.column_stack([a, n, so3.cross(a, n)])


def bases_of(pair: Pair, poses: Poses) -> Bases:
    """Return base poses of one trial, with grasps and joint given."""
    R, h = poses
    N, joint = h.shape[1], pair.joint
    turns, places = np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3))

    def closes(R_A: Array, p_A: Array, i: int, R_i: Array, p_i: Array) -> None:
        turns[i] = _heading(lambda Z: float(np.sum((Z @ R[:, i] - R_A @ R_i) ** 2)))
        places[i] = np.mean(p_A + times(R_A, p_i) - h[:, i] @ turns[i].T, axis=0)

    for i in pair.halves[0][1:]:
        closes(
            R[:, 0],
            h[:, 0],
            i,
            np.broadcast_to(pair.R[i], R[:, 0].shape),
            np.broadcast_to(pair.p[i], h[:, 0].shape),
        )
    b, *rest = pair.halves[1]
    back = np.swapaxes(R[:, 0], 1, 2)

    def turned_off(Z: Array) -> float:
        rel = back @ Z @ R[:, b] @ joint.R_0.T
        trace = np.trace(rel, axis1=1, axis2=2)
        if joint.motion != "hinged":
            return float(np.sum(3.0 - trace))
        a = joint.axes[:, 0]  # after the turn about a that is nearest
        along = np.einsum("i,qij,j->q", a, rel, a)
        return float(np.sum(3.0 - along - np.hypot(trace - along, 2.0 * vee(rel) @ a)))

    turns[b] = _heading(turned_off)
    seen = times(back, h[:, b] @ turns[b].T - h[:, 0])
    rel = back @ turns[b] @ R[:, b]
    left = joint.coordinates(rel, seen).left[:, -3:]
    if joint.motion == "sliding":
        across = joint.axes[:, 1:].T
        left, X = left[:, -2:], across @ back
    else:
        X = back
    places[b] = np.linalg.lstsq(X.reshape(-1, 3), -left.ravel(), rcond=1e-9)[0]
    for i in rest:
        R_B, p_B = turns[b] @ R[:, b], places[b] + h[:, b] @ turns[b].T
        closes(R_B, p_B, i, np.broadcast_to(pair.R[i], R_B.shape), np.broadcast_to(pair.p[i], p_B.shape))
    return Bases(turns, places)
