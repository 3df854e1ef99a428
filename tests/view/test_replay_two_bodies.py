"""The replay of a payload of two bodies against the simulated motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimator.two_bodies.estimate import estimate_two_bodies
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, simulate
from mocobot_view.replay_trial import replay_trial


@pytest.mark.parametrize(("name", "given"), [("sliding", False), ("folding", False), ("folding", True)])
def test_both_bodies_move_as_simulated(name, given):
    done = simulate(TrialRequest(name, "periodic", duration_s=12.0), [sensor_preset("nominal")])
    recording, truth = done.recordings["nominal"], done.truth
    estimate = estimate_two_bodies([recording], "hinged") if given else None
    trial = replay_trial(recording, "trial", estimate)
    assert trial.two is not None
    q, two = truth.position, trial.two
    k, axis = truth.bodies[1].robots[0] - 1, truth.joint.axis_1
    sign = np.sign(two.axis @ axis)
    assert np.std(sign * two.q - q) < 2e-4
    if estimate is not None:
        np.testing.assert_allclose(two.q, estimate.true_position(truth.to_dict()), rtol=0, atol=2e-4)
    # The pose of {k} in {1} by MuJoCo's joint, against the drawn bodies.
    turn = Rotation.from_rotvec(np.outer(0.0 * q if truth.joint.slides else q, axis))
    R = turn.as_matrix() @ truth.R_1i[k]
    p = truth.joint.pivot_1 + turn.apply(truth.p_1i[k] - truth.joint.pivot_1)
    p = p + np.outer(q, axis) if truth.joint.slides else p
    back = np.swapaxes(two.first.R_W1, 1, 2)
    np.testing.assert_allclose(back @ two.second.R_W1, R, rtol=0, atol=2e-3)
    seen = np.einsum("qij,qj->qi", back, two.second.p_W1 - two.first.p_W1)
    np.testing.assert_allclose(seen, p, rtol=0, atol=2e-3)
    assert two.first.gap_position_m.shape == (len(q), len(truth.p_1i))
    assert two.first.gap_position_m.max() < 1e-3
    assert all(shape is not None for shape in two.shapes)
    assert "between robot" in " ".join(trial.notes)
