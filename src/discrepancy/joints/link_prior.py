"""Prior of the inertial parameters of a link: the log-determinant divergence from those of the given model.

The divergence of the pseudo-inertia P, tr(P0^-1 P) - log det(P0^-1 P) - 4, is convex in the ten parameters, and
infinite where they are not physically consistent (T. Lee, P. M. Wensing and F. C. Park, "Geometric robot dynamic
identification: a convex programming approach", T-RO 2020).
"""

from __future__ import annotations

import numpy as np

from discrepancy.joints.mechanics import Tree, inertial_parameters, moments_matrix
from discrepancy.joints.problem import MOMENTS
from estimator.arrays import Array, point_inertia
from mocobot_sim.serial.mjcf import real_inertia

BODY = 0.3
"""Half the prior standard deviation of the logarithm of a mass. Chosen: masses are known within a factor of 2; the
divergence then lets centres of mass move by 0.85 radii of gyration, and second moments change by a factor of 3."""
LEAST_KG, LEAST_RADIUS_M = 1e-6, 1e-3
"""Least mass and radius of gyration of a link that is fitted. Chosen: below any part of a robot."""


class LinkPrior:
    """Prior of the ten inertial parameters of one link about its frame's origin."""

    def __init__(self, tree: Tree, body: int) -> None:
        mass, com, inertia = float(tree.mass[body]), tree.com[body], real_inertia(tree.inertia[body])
        if np.trace(inertia) < mass * LEAST_RADIUS_M**2:
            inertia = 0.4 * mass * LEAST_RADIUS_M**2 * np.eye(3)
        self.body, self.given = body, inertial_parameters(mass, com, inertia)
        self.inverse = np.linalg.inv(pseudo_inertia(self.given))

    def slopes(self, p: Array) -> tuple[float, Array, Array]:
        """Negative log prior, its gradient (10,) and its Hessian (10, 10); infinite if ``p`` is not consistent."""
        P, scale = pseudo_inertia(p), 1.0 / (16.0 * BODY**2)
        if not _positive(P):
            return np.inf, np.zeros(10), np.eye(10)
        each = np.linalg.inv(P) @ _PSEUDO
        value = np.sum(self.inverse * P) - np.linalg.slogdet(P)[1] - np.linalg.slogdet(self.inverse)[1] - 4.0
        gradient = np.einsum("ij,kji->k", self.inverse, _PSEUDO) - np.einsum("kii->k", each)
        return scale * float(value), scale * gradient, scale * np.einsum("aij,bji->ab", each, each)


def _positive(P: Array) -> bool:
    """Whether a symmetric matrix is positive definite."""
    try:
        np.linalg.cholesky(P)
    except np.linalg.LinAlgError:
        return False
    return True


def pseudo_inertia(p: Array) -> Array:
    """Pseudo-inertia (4, 4) from ten inertial parameters about the frame's origin."""
    inertia = moments_matrix(p[4:])
    out = np.zeros((4, 4))
    out[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    out[:3, 3] = out[3, :3] = p[1:4]
    out[3, 3] = p[0]
    return out


_PSEUDO = np.array([pseudo_inertia(e) for e in np.eye(10)])
"""Pseudo-inertia of one unit of each inertial parameter, shape (10, 4, 4)."""


def central(p: Array) -> Array:
    """Mass, centre of mass and central inertia (xx, yy, zz, xy, xz, yz) of ten parameters about the frame's origin."""
    c = p[1:4] / p[0]
    about = p[0] * point_inertia(c)
    moved = np.array([*np.diag(about), about[0, 1], about[0, 2], about[1, 2]])
    return np.array([p[0], *c, *(p[4:] - moved)])


CENTRAL = ("mass_kg", "com_x_m", "com_y_m", "com_z_m", *(f"inertia_{a}_kgm2" for a in MOMENTS[4:]))


def fitted_links(tree: Tree) -> list[int]:
    """For every set of moving bodies that are welded together, the heaviest: torques do not tell them apart."""
    root = np.arange(len(tree.parent))
    for b in range(1, len(root)):
        if b not in tree.joint_body:
            root[b] = root[tree.parent[b]]
    groups: dict[int, list[int]] = {}
    for b in map(int, tree.links):
        groups.setdefault(int(root[b]), []).append(b)
    each = (max(own, key=lambda b: tree.mass[b]) for own in groups.values())
    return [b for b in each if tree.mass[b] > LEAST_KG]


def welded(tree: Tree, body: int, root: int) -> bool:
    """Whether a body is another, or is fixed to it from there on."""
    while body != root and body not in tree.joint_body:
        body = int(tree.parent[body])
    return body == root
