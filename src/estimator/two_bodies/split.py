"""Physically consistent masses of two bodies, where the motion tells only sums of them.

The pseudo-inertia P = sum m (r, 1)(r, 1)^T of a real body is positive definite (P. Wensing, S. Kim, J.-J. Slotine, IEEE
Robotics and Automation Letters 3, 2018). What a joint hides is a symmetric Z that may belong to either body:

    P_A = P_A0 - G_A Z G_A^T,    P_B = P_B0 + G_B Z G_B^T.

Every Z with both positive definite moves alike. The split taken has the largest log det P_A + log det P_B.
"""

from __future__ import annotations

import numpy as np

from estimator.arrays import Array, inertia_matrix
from estimator.two_bodies.team import Joint

TIGHT = 1e4
"""Weight of the mass over the barrier at the ends of its range. Derived: the ends are 8 / 1e4 of the mass short."""


def pseudo_inertia(pi: Array) -> Array:
    """Return P (4, 4) of ten parameters (m, m c, J) about the origin of their frame."""
    J = inertia_matrix(pi[4:])
    P = np.zeros((4, 4))
    P[:3, :3], P[3, 3] = 0.5 * np.trace(J) * np.eye(3) - J, pi[0]
    P[:3, 3] = P[3, :3] = pi[1:4]
    return P


def body_of(P: Array) -> tuple[float, Array, Array]:
    """Return mass [kg], centre of mass [m] and inertia about it [kg m^2] of a pseudo-inertia."""
    m, c = float(P[3, 3]), P[:3, 3] / P[3, 3]
    second = P[:3, :3] - m * np.outer(c, c)
    return m, c, np.trace(second) * np.eye(3) - second


def hidden(joint: Joint) -> tuple[Array, Array]:
    """Return G_A in {A} and G_B in {J}: a hinge hides point masses on its line, a slide hides inertia."""
    G_A, G_B = np.zeros((4, 3)), np.zeros((4, 3))
    if joint.motion == "hinged":
        G_A[:3, 0], G_A[:, 1], G_B[0, 0], G_B[3, 1] = joint.axes[:, 0], (*joint.pivot, 1.0), 1.0, 1.0
        return G_A[:, :2], G_B[:, :2]
    G_A[:3], G_B[:3] = joint.axes, np.eye(3)
    return G_A, G_B


def split(joint: Joint, pi_A: Array, pi_B: Array) -> tuple[Array, Array, tuple[float, float]] | None:
    """Return pseudo-inertias of A in {A} and B in {J}, and the range of B's mass [kg]; None if no split is real.

    ``pi_A`` and ``pi_B`` have ten parameters each, with everything hidden in A.
    """
    P_A, P_B, (G_A, G_B) = pseudo_inertia(pi_A), pseudo_inertia(pi_B), hidden(joint)
    k = G_A.shape[1]
    parts = [np.eye(k)[[i]].T @ np.eye(k)[[j]] for i in range(k) for j in range(i + 1)]
    parts = [part + part.T for part in parts]
    D_A, D_B = (sign * np.array([G @ part @ G.T for part in parts]) for G, sign in ((G_A, -1.0), (G_B, 1.0)))
    z = np.zeros(len(parts))
    size, slack = np.diag([*(np.trace(P_A[:3, :3]) * np.ones(3)), P_A[3, 3]]), 10.0
    if not (_positive(P_A + slack * size) and _positive(P_B + slack * size)):
        return None
    for _ in range(60):
        z = _centre(z, P_A + slack * size, P_B + slack * size, D_A, D_B, np.zeros(len(z)))
        A, B = P_A + np.tensordot(z, D_A, 1), P_B + np.tensordot(z, D_B, 1)
        if _positive(A) and _positive(B):
            break
        for shrink in (0.1, 0.5, 0.9):
            if _positive(A + shrink * slack * size) and _positive(B + shrink * slack * size):
                slack *= shrink
                break
        else:
            return None
    else:
        return None
    z = _centre(z, P_A, P_B, D_A, D_B, np.zeros(len(z)))
    mass = D_B[:, 3, 3] / P_A[3, 3]
    ends = []
    for sign in (-1.0, 1.0):
        end = z
        for weight in np.geomspace(1.0, TIGHT, 9):
            end = _centre(end, P_A, P_B, D_A, D_B, sign * weight * mass)
        ends.append(float(P_B[3, 3] + D_B[:, 3, 3] @ end))
    return P_A + np.tensordot(z, D_A, 1), P_B + np.tensordot(z, D_B, 1), (ends[0], ends[1])


def _positive(P: Array) -> bool:
    try:
        np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        return False
    return True


def _log_det(P: Array) -> float:
    return float(np.linalg.slogdet(P)[1])


def _centre(z: Array, P_A: Array, P_B: Array, D_A: Array, D_B: Array, slope: Array) -> Array:
    """Maximize log det of both bodies plus slope . z by Newton steps from a feasible z."""

    def value(z: Array) -> float:
        each = [P + np.tensordot(z, D, 1) for P, D in ((P_A, D_A), (P_B, D_B))]
        return sum(_log_det(P) for P in each) + float(slope @ z) if all(map(_positive, each)) else -np.inf

    now = value(z)
    for _ in range(60):
        gradient, hessian = slope.copy(), np.zeros((len(z), len(z)))
        for P, D in ((P_A, D_A), (P_B, D_B)):
            each = np.linalg.solve(P + np.tensordot(z, D, 1), D)
            gradient += np.trace(each, axis1=1, axis2=2)
            hessian += np.einsum("aij,bji->ab", each, each)
        step = np.linalg.lstsq(hessian, gradient, rcond=1e-14)[0]
        gain, length = float(gradient @ step), 1.0
        while (there := value(z + length * step)) < now + 0.2 * length * gain and length > 1e-9:
            length *= 0.5
        if length <= 1e-9 or gain < 1e-10:
            break
        z, now = z + length * step, there
    return z
