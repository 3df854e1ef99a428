"""Kalman filter and smoother of deviations from a motion, for many input series at once.

The state is x = (deviation of positions, deviation of velocities). Over one step of the grid

    x' = A x + B (u + w),   w ~ N(0, diag(Q)),

with u the torque that the motion lacks, and at every ``every``-th grid point y = positions of x + e, e ~ N(0, diag(R)).
The filter is linear: the innovations of a sum of inputs are the sums of their innovations. Eliminating all states this
way is the block-tridiagonal elimination of the whole trajectory.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimator.arrays import Array
from mocobot_sim.kernels import compiled


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """Linearised closed loop of J joints over N steps of a grid, with M measurements.

    Attributes:
        A, B: shapes (N, 2J, 2J) and (N, 2J, J).
        Q: variance of the torque of each step, shape (N, J) [(N m)^2].
        R: variance of each measurement, inf where there is none, shape (M, J) [rad^2].
        every: steps from one measurement to the next; the first is at grid point 0.
        start: variance of the initial state, shape (2J,).
    """

    A: Array
    B: Array
    Q: Array
    R: Array
    every: int
    start: Array


@dataclass(frozen=True, eq=False)
class Filtered:
    """Gains of the filter, which depend on no data.

    Attributes:
        loop: the loop.
        gain: shape (M, 2J, J).
        spread: covariance of the predicted state at every grid point, shape (N + 1, 2J, 2J).
        root: inverse of the lower Cholesky factor of the innovations' covariance, shape (M, J, J).
    """

    loop: LinearLoop
    gain: Array
    root: Array
    spread: Array

    @classmethod
    def of(cls, loop: LinearLoop) -> Filtered:
        """Run the covariance recursion."""
        M, J = loop.R.shape
        gain, root = np.zeros((M, 2 * J, J)), np.zeros((M, J, J))
        spread = np.zeros((len(loop.A) + 1, 2 * J, 2 * J))
        _gains((loop.A, loop.B, loop.Q), loop.R, loop.every, loop.start, (gain, root, spread))
        return cls(loop, gain, root, spread)

    def innovations(self, torque: Array, position: Array | None = None) -> Array:
        """Whitened innovations of input series, shape (M, J, P).

        Args:
            torque: input torques, shape (N, J, P).
            position: measurements of the first series, shape (M, J); None: 0.
        """
        M, J = self.loop.R.shape
        out, loop = np.zeros((M, J, torque.shape[2])), self.loop
        y = np.zeros((M, J)) if position is None else position
        _filter((loop.A, loop.B), (self.gain, self.root), loop.every, np.ascontiguousarray(torque), y, out)
        return out

    def predicted(self, torque: Array, position: Array) -> Array:
        """Likeliest deviations at the begin and the end of each step given the measurements so far, shape (2, N, 2J).

        Args:
            torque: input torques, shape (N, J).
            position: measurements, shape (M, J).
        """
        loop = self.loop
        out = np.empty((2, *loop.A.shape[:2]))
        _predict(
            (loop.A, loop.B),
            self.gain,
            loop.every,
            np.ascontiguousarray(torque),
            np.ascontiguousarray(position),
            out,
        )
        return out

    def smoothed(self, torque: Array, position: Array) -> Array:
        """Likeliest deviations at all grid points given the inputs and the measurements, shape (N + 1, 2J).

        Args:
            torque: input torques, shape (N, J).
            position: measurements, shape (M, J).
        """
        loop, out = self.loop, np.zeros((len(self.loop.A) + 1, self.loop.A.shape[1]))
        _smooth(
            (loop.A, loop.B), (self.gain, self.root, self.spread), loop.every, np.ascontiguousarray(torque),
            np.ascontiguousarray(position), out,
        )  # fmt: skip
        return out


@compiled
def _gains(steps, R, every, start, out):
    (A, B, Q), (gain, root, spread) = steps, out
    N, twice, J = B.shape
    P = np.diag(start)
    for n in range(N + 1):
        spread[n] = P
        if n % every == 0:
            k = n // every
            if np.isfinite(R[k]).all():
                H = np.ascontiguousarray(P[:, :J])
                S = P[:J, :J] + np.diag(R[k])
                inverse = np.linalg.inv(np.linalg.cholesky(S))
                K = np.dot(np.dot(H, np.ascontiguousarray(inverse.T)), inverse)
                # Joseph's form keeps P positive definite.
                kept = np.eye(twice)
                kept[:, :J] -= K
                P = np.dot(np.dot(kept, P), np.ascontiguousarray(kept.T))
                P = P + np.dot(K * R[k], np.ascontiguousarray(K.T))
                gain[k] = K
                root[k] = inverse
        if n < N:
            noise = B[n] * Q[n]
            P = np.dot(np.dot(A[n], P), np.ascontiguousarray(A[n].T)) + np.dot(
                noise, np.ascontiguousarray(B[n].T)
            )


@compiled
def _filter(steps, gains, every, torque, position, out):
    (A, B), (gain, root) = steps, gains
    N, twice, J = B.shape
    x = np.zeros((twice, torque.shape[2]))
    for n in range(N + 1):
        if n % every == 0:
            k = n // every
            e = -x[:J]
            e[:, 0] += position[k]
            out[k] = np.dot(root[k], e)
            x = x + np.dot(gain[k], e)
        if n < N:
            x = np.dot(A[n], x) + np.dot(B[n], torque[n])


@compiled
def _predict(steps, gain, every, torque, position, out):
    A, B = steps
    N, twice, J = B.shape
    x = np.zeros(twice)
    for n in range(N):
        if n % every == 0:
            k = n // every
            x = x + np.dot(gain[k], position[k] - x[:J])
        out[0, n] = x
        x = np.dot(A[n], x) + np.dot(B[n], torque[n])
        out[1, n] = x


@compiled
def _smooth(steps, gains, every, torque, position, out):
    (A, B), (gain, root, spread) = steps, gains
    N, twice, J = B.shape
    x, white = np.zeros(twice), np.zeros((len(gain), J))
    for n in range(N + 1):
        out[n] = x
        if n % every == 0:
            k = n // every
            e = position[k] - x[:J]
            white[k] = np.dot(root[k], e)
            x = x + np.dot(gain[k], e)
        if n < N:
            x = np.dot(A[n], x) + np.dot(B[n], torque[n])
    back = np.zeros(twice)
    for n in range(N, -1, -1):
        if n < N:
            back = np.dot(np.ascontiguousarray(A[n].T), back)
        if n % every == 0:
            k = n // every
            score = np.dot(np.ascontiguousarray(root[k].T), white[k])
            back[:J] += score - np.dot(np.ascontiguousarray(gain[k].T), back)
        out[n] += np.dot(spread[n], back)


@compiled
def cost(steps, R, every, start, torque, position):
    """Negative log likelihood of one joint, up to a constant: as above with J = 1, in one pass and without matrices."""
    A, B, Q = steps
    p, v = 0.0, 0.0
    P, C, V = start[0], 0.0, start[1]
    out = 0.0
    for n in range(len(Q) + 1):
        if n % every == 0 and np.isfinite(R[n // every]):
            e, S = position[n // every] - p, P + R[n // every]
            out += 0.5 * (e * e / S + np.log(S))
            f, g = P / S, C / S
            p, v = p + f * e, v + g * e
            V, C, P = V - g * C, C - f * C, P - f * P
        if n < len(Q):
            a, b, c, d = A[n, 0, 0], A[n, 0, 1], A[n, 1, 0], A[n, 1, 1]
            x, y = B[n, 0], B[n, 1]
            p, v = a * p + b * v + x * torque[n], c * p + d * v + y * torque[n]
            P, C, V = (
                a * a * P + 2.0 * a * b * C + b * b * V + x * x * Q[n],
                a * c * P + (a * d + b * c) * C + b * d * V + x * y * Q[n],
                c * c * P + 2.0 * c * d * C + d * d * V + y * y * Q[n],
            )
    return out
