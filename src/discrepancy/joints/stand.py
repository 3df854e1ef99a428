"""A stand that yields: the base on six springs with dampers, which the wrench that the motion asks for sets swinging.

The springs act along and about the model's axes at the origin of the base. With the joints' motion known, the base
obeys

    M(q) x'' + D x' + K x = -w,

with w the wrench on a base that stands still, M the inertia of robot and base, and springs in K and dampers in D. Steps
of Newton's method around the base's motion make it exact where the base turns far.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from discrepancy.evidence.cells import Cells, Series
from discrepancy.evidence.posterior import Group, Posterior
from discrepancy.joints.causes import WORDS
from discrepancy.joints.closed_loop import derivatives, midpoint
from discrepancy.joints.loop_filter import Filtered, LinearLoop
from discrepancy.joints.mechanics import Coupling, Motion, Tree, body_regressor, rigid_torque
from discrepancy.joints.signals import Signals
from estimator.arrays import Array
from estimator.filtering import differentiate

CAUSE = "soft_stand"
WAYS = 6
FIRST_HZ, FIRST_DAMPING = (2.0, 4.0, 8.0, 16.0), 0.15
"""Natural frequencies [Hz] and damping ratio of the stands that are tried first. Chosen: an octave apart, so damped
that each answers to its neighbours' frequencies."""
SLAB = 0.5
"""Prior standard deviation of the logarithms around a shape. Chosen: half of the step between frequencies."""
NEWTON, MATRICES_HZ = 3, 50.0
"""Steps of Newton's method, and rate at which its matrices are computed [Hz]. Chosen."""
FIT_STEPS, SETTLED, MOST_STEP = 12, 0.05, 0.7
"""Most steps of a fit of the springs, the change of the logarithms at which it ends, and the largest one of a step.
Chosen."""
NAMES = WORDS[CAUSE].parameters
"""Parameters that are told: six springs, then six dampers."""
SHAPE = (*NAMES, "base_kg", *(f"base_{axis}{axis}_kgm2" for axis in "xyz"))


def with_stand(tree: Tree) -> Tree:
    """The tree on six more joints, the first ones, of a massless body at the origin of the base."""
    first, c = int(tree.joint_body[0]), tree.coupling
    base = int(tree.parent[first]) or first
    still = Motion.of(tree, *np.zeros((3, 1, len(c.own))))
    at, none = still.origin[base, 0], np.zeros((WAYS, 3))
    position = np.concatenate([tree.position[:1], at[None], tree.position[1:]])
    position[2:][tree.parent[1:] == 0] -= at
    few, ratio = np.zeros(WAYS), np.zeros((WAYS + len(c.ratio), WAYS + len(c.own)))
    ratio[:WAYS, :WAYS], ratio[WAYS:, WAYS:] = np.eye(WAYS), c.ratio
    coupling = Coupling(np.arange(WAYS + len(c.own)), ratio, np.append(few, c.offset))

    def apart(x: Array) -> Array:
        return np.concatenate([x[:1], np.zeros((1, *x.shape[1:])), x[1:]])

    rotation = apart(tree.rotation)
    rotation[1] = np.eye(3)
    return replace(
        tree, parent=np.concatenate([[0, 0], tree.parent[1:] + 1]), position=position, rotation=rotation,
        joint_body=np.append(np.ones(WAYS, dtype=np.intp), tree.joint_body + 1),
        slides=np.append(np.arange(WAYS) < 3, tree.slides), anchor=np.concatenate([none, tree.anchor]),
        axis=np.concatenate([np.eye(3), np.eye(3), tree.axis]), zero=np.append(few, tree.zero), mass=apart(tree.mass),
        com=apart(tree.com), inertia=apart(tree.inertia), armature=np.append(few, tree.armature),
        coulomb=np.append(few, tree.coulomb), viscous=np.append(few, tree.viscous),
        drag=np.concatenate([np.zeros((WAYS, 2)), tree.drag]), coupling=coupling,
    )  # fmt: skip


Shape = tuple[tuple[str, float], ...]


class Stand:
    """Stands that may be under a robot in some logs.

    Args:
        parts: smoothed logs.

    Attributes:
        parts: the logs.
        tree: the robot on a base without mass that has six joints, the first ones.
    """

    def __init__(self, parts: Sequence[Signals]) -> None:
        self.parts, self.tree = parts, with_stand(parts[0].tree)
        self.known: dict[Shape, list[Series]] = {}
        self.matrices, self.thin = [], [max(1, round(s.rate_hz / MATRICES_HZ)) for s in parts]
        for s, thin in zip(parts, self.thin, strict=True):
            still = (np.pad(x[::thin], ((0, 0), (WAYS, 0))) for x in (s.q, s.dq, s.ddq))
            self.matrices.append(derivatives(self.tree, *still, count=WAYS))

    def first(self) -> list[Shape]:
        """Stands to begin with: bases as heavy as what moves, which swing at ``FIRST_HZ``."""
        mean = np.mean([M[:, :WAYS].mean(axis=0) for M, _, _ in self.matrices], axis=0)
        own, out = np.maximum(np.diag(mean), 1e-4 * np.trace(mean)), []
        for hz in FIRST_HZ:
            w = 2.0 * np.pi * hz
            numbers = 2.0 * own * w**2, 4.0 * FIRST_DAMPING * own * w, own[:1], own[3:]
            out.append(tuple(zip(SHAPE, np.concatenate(numbers).tolist(), strict=True)))
        return out

    def series(self, shape: Shape) -> list[Series]:
        """Columns of a stand: the torques that it adds, and their derivatives by the logarithms of its numbers."""
        if shape not in self.known:
            each = [self._swung(t, np.array([x for _, x in shape])) for t in range(len(self.parts))]
            self.known[shape] = [
                {j: [x[:, j, k] for x in each] for j in range(each[0].shape[1])}
                for k in range(1 + len(SHAPE))
            ]
        return self.known[shape]

    def group(self, shape: Shape, columns: Sequence[int] = ()) -> Group:
        """The cause in a shape."""
        slab = (1.0, *(SLAB,) * len(SHAPE))
        return Group(
            CAUSE,
            "base",
            tuple(columns),
            slab,
            -math.log(len(FIRST_HZ)),
            shape,
            (0.0, *(-np.inf,) * len(SHAPE)),
        )

    def fitted(
        self, group: Group, posterior: Posterior, cells: Cells, rows: Callable[[list[Series]], list[Series]]
    ) -> Group:
        """The stand that explains most beside what is in a posterior: Gauss-Newton steps from a shape.

        Args:
            group: the stand with its columns.
            posterior: of a set with this stand.
            cells: the problem, whose columns are the same afterwards.
            rows: converts series by joint to those by channel.
        """
        shape, count, healthy = group.shape, cells.count, posterior.prior.copy()
        healthy[list(group.columns)] = 0.0
        slab = np.square(self.group(shape).slab)
        mean, best = posterior.mean[list(group.columns)], (-np.inf, shape)
        for _ in range(FIT_STEPS):
            shape, moved = moved_by(shape, mean)
            own = cells.add(rows(self.series(shape)))
            now = Posterior(cells, np.concatenate([healthy, slab]), posterior.variance)
            mean, best = now.mean[own], max(best, (now.log_evidence, shape))
            cells.truncate(count)
            if moved < SETTLED:
                break
        return self.group(best[1])

    def _swung(self, t: int, numbers: Array) -> Array:
        """Torques of a stand in one log, and their derivatives by the logarithms, shape (W, J, 1 + 16)."""
        s, thin, (M, D, K) = self.parts[t], self.thin[t], self.matrices[t]
        k, d, base = numbers[:WAYS], numbers[WAYS : 2 * WAYS], numbers[2 * WAYS :]
        tree, step = self.tree, 1.0 / s.rate_hz
        tree.mass[1], tree.inertia[1] = base[0], np.diag(base[1:])
        own = np.zeros((WAYS, WAYS))
        own[range(WAYS), range(WAYS)] = [base[0]] * 3 + base[1:].tolist()
        at = np.minimum((np.arange(len(s.time) - 1) + thin // 2) // thin, len(M) - 1)
        A, B = midpoint(M[:, :WAYS] + own, D[:, :WAYS] + np.diag(d), K[:, :WAYS] + np.diag(k), step)
        A, B = A[at], B[at]
        none = np.zeros((len(A) + 1, 2 * WAYS, WAYS))
        loop = LinearLoop(A, B, np.zeros((0, WAYS)), np.zeros((len(A) + 1, WAYS)), 1, np.zeros(2 * WAYS))
        free = Filtered(loop, none, np.broadcast_to(np.eye(WAYS), (len(A) + 1, WAYS, WAYS)).copy(), none)

        def moved(force: Array) -> list[Array]:
            """Motion of the base, shape (W, 6, P), and its derivatives, by forces on it of that shape."""
            x = -free.innovations(0.5 * (force[1:] + force[:-1]))
            v = differentiate(x, s.rate_hz)
            return [x, v, differentiate(v, s.rate_hz)]

        def felt(*base: Array) -> tuple[Motion, Array, Array]:
            """Motion of all, its torques, and the force on the base that is not in balance, shape (W, 6, 1)."""
            every = (np.hstack([b[:, :, 0], own]) for b, own in zip(base, (s.q, s.dq, s.ddq), strict=True))
            motion = Motion.of(tree, *every)
            torque = rigid_torque(motion)
            return motion, torque, torque[:, :WAYS, None] + k[:, None] * base[0] + d[:, None] * base[1]

        x, v, a = (np.zeros((len(s.time), WAYS, 1)) for _ in range(3))
        x = x - np.linalg.solve(K[0, :WAYS] + np.diag(k), felt(x, v, a)[2][0])  # the log begins at rest
        for _ in range(NEWTON - 1):
            x, v, a = (b + more for b, more in zip((x, v, a), moved(-felt(x, v, a)[2]), strict=True))
        motion, torque, _ = felt(x, v, a)
        Y = body_regressor(motion, 1)[:, :WAYS]
        by = np.zeros((len(s.time), WAYS, len(SHAPE)))
        by[:, range(WAYS), range(WAYS)] = -k * x[:, :, 0]
        by[:, range(WAYS), range(WAYS, 2 * WAYS)] = -d * v[:, :, 0]
        by[:, :, 2 * WAYS :] = -Y[:, :, [0, 4, 5, 6]] * base
        near = np.minimum((np.arange(len(s.time)) + thin // 2) // thin, len(M) - 1)
        slopes = sum(own[:, WAYS:][near] @ b for own, b in zip((K, D, M), moved(by), strict=True))
        change = torque[:, WAYS:] - rigid_torque(s.motion)
        return np.concatenate([change[:, :, None], slopes], axis=2)


def moved_by(shape: Shape, mean: Array) -> tuple[Shape, float]:
    """A shape moved by the values of its columns, and the largest change of a logarithm."""
    size = max(float(mean[0]), 0.1)
    way = np.clip(mean[1:] / size - np.log(size), -MOST_STEP, MOST_STEP)
    return tuple((n, float(x * np.exp(w))) for (n, x), w in zip(shape, way, strict=True)), float(
        np.abs(way).max()
    )
