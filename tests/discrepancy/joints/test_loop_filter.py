"""Filter and smoother of a position loop against dense Gaussian elimination of the whole trajectory."""

from dataclasses import dataclass

import numpy as np
import pytest

from discrepancy.joints.loop_filter import Filtered, LinearLoop, cost

STEPS, EVERY, LOST = 40, 4, 3
MEASURED = [k for k in range(STEPS // EVERY + 1) if k != LOST]


@dataclass
class Dense:
    """All states and measurements of a loop as linear functions of the initial state and the noise torques."""

    loop: LinearLoop
    torque: np.ndarray

    def __post_init__(self) -> None:
        """Stack the recursion; the unknowns are (x_0, w_0, ..., w_N-1)."""
        A, B = self.loop.A, self.loop.B
        N, two, J = B.shape
        self.states, self.forced = (
            np.zeros((N + 1, two, two + N * J)),
            np.zeros((N + 1, two, self.torque.shape[2])),
        )
        self.states[0, :, :two] = np.eye(two)
        for n in range(N):
            self.states[n + 1] = A[n] @ self.states[n]
            self.states[n + 1, :, two + n * J : two + (n + 1) * J] += B[n]
            self.forced[n + 1] = A[n] @ self.forced[n] + B[n] @ self.torque[n]
        self.prior = np.diag(np.concatenate([self.loop.start, self.loop.Q.ravel()]))
        at = [k * EVERY for k in MEASURED]
        self.read = np.concatenate([self.states[n, :J] for n in at])
        self.of_torque = np.concatenate([self.forced[n, :J] for n in at])
        errors = np.diag(np.concatenate([self.loop.R[k] for k in MEASURED]))
        self.covariance = self.read @ self.prior @ self.read.T + errors


def system(joints: int, torques: int = 3) -> tuple[LinearLoop, np.ndarray, np.ndarray]:
    """A random loop that changes from step to step, input torques, and measurements of which one is missing."""
    rng = np.random.default_rng(joints)
    two = 2 * joints
    A = np.eye(two) + 0.1 * rng.standard_normal((STEPS, two, two))
    B = rng.standard_normal((STEPS, two, joints))
    R = rng.uniform(0.1, 1.0, (STEPS // EVERY + 1, joints))
    R[LOST] = np.inf
    loop = LinearLoop(A, B, rng.uniform(0.0, 1.0, (STEPS, joints)), R, EVERY, rng.uniform(0.1, 1.0, two))
    read = rng.standard_normal(R.shape)
    read[LOST] = 0.0
    return loop, rng.standard_normal((STEPS, joints, torques)), read


@pytest.mark.parametrize("joints", [1, 2, 3])
def test_innovations_are_white_and_of_the_same_likelihood(joints):
    loop, torque, read = system(joints)
    dense = Dense(loop, torque)
    white = Filtered.of(loop).innovations(torque, read)
    own = white[MEASURED].reshape(-1, torque.shape[2])
    lacking = -dense.of_torque
    lacking[:, 0] += read[MEASURED].ravel()
    np.testing.assert_allclose(own.T @ own, lacking.T @ np.linalg.solve(dense.covariance, lacking), rtol=1e-8)
    np.testing.assert_array_equal(white[LOST], 0.0)


@pytest.mark.parametrize("joints", [1, 2, 3])
def test_the_smoother_is_the_conditional_mean(joints):
    loop, torque, read = system(joints)
    dense = Dense(loop, torque)
    gain = dense.prior @ dense.read.T
    noise = gain @ np.linalg.solve(dense.covariance, read[MEASURED].ravel() - dense.of_torque[:, 0])
    wanted = dense.states @ noise + dense.forced[:, :, 0]
    np.testing.assert_allclose(
        Filtered.of(loop).smoothed(torque[:, :, 0], read), wanted, atol=1e-8 * np.abs(wanted).max()
    )


@pytest.mark.parametrize("joints", [1, 2])
def test_predictions_are_conditional_means_given_the_measurements_so_far(joints):
    loop, torque, read = system(joints)
    dense = Dense(loop, torque)
    begin, end = Filtered.of(loop).predicted(torque[:, :, 0], read)
    for n in range(STEPS):
        known = joints * sum(k * EVERY <= n for k in MEASURED)
        left = read[MEASURED].ravel()[:known] - dense.of_torque[:known, 0]
        gain = dense.prior @ dense.read[:known].T
        noise = gain @ np.linalg.solve(dense.covariance[:known, :known], left)
        for own, at in ((begin, n), (end, n + 1)):
            wanted = dense.states[at] @ noise + dense.forced[at, :, 0]
            np.testing.assert_allclose(own[n], wanted, atol=1e-8 * max(1.0, np.abs(wanted).max()))


def test_the_cost_of_one_joint_is_its_negative_log_likelihood():
    loop, torque, read = system(1)
    for scale in (1.0, 4.0):
        more = LinearLoop(loop.A, loop.B, scale * loop.Q, loop.R, EVERY, loop.start)
        dense = Dense(more, torque)
        left = read[MEASURED].ravel() - dense.of_torque[:, 0]
        wanted = (
            0.5 * left @ np.linalg.solve(dense.covariance, left)
            + 0.5 * np.linalg.slogdet(dense.covariance)[1]
        )
        steps = loop.A, loop.B[:, :, 0].copy(), more.Q[:, 0].copy()
        found = cost(steps, loop.R[:, 0].copy(), EVERY, loop.start, torque[:, 0, 0].copy(), read[:, 0].copy())
        assert found == pytest.approx(wanted, rel=1e-9)
