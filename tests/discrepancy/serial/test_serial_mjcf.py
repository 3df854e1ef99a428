"""Fitted inertia put into a model: bodies that can be."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mocobot_sim.serial.mjcf import real_inertia


def compiled(inertia: np.ndarray) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.mass, body.explicitinertial = 1.0, True
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    return spec.compile()


def test_a_body_keeps_its_inertia() -> None:
    turn = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix()
    inertia = turn @ np.diag([0.02, 0.03, 0.04]) @ turn.T
    np.testing.assert_allclose(real_inertia(inertia), inertia, atol=1e-16)


@pytest.mark.parametrize("moments", [(1e-4, 3e-4, 1.2e-3), (-1e-3, 2e-3, 2e-3), (1e-3, 1e-3, -5e-4)])
def test_what_no_body_can_have_becomes_the_nearest_that_one_can(moments: tuple[float, float, float]) -> None:
    turn = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix()
    inertia = turn @ np.diag(moments) @ turn.T
    with pytest.raises(ValueError, match="inertia"):
        compiled(inertia)
    real = real_inertia(inertia)
    kept = np.sort(compiled(real).body_inertia[1])
    assert kept[0] + kept[1] >= kept[2]
    # Second moments along the same axes; those above zero are as they were.
    before = 0.5 * sum(moments) - np.array(moments)
    after = np.diag(turn.T @ (0.5 * np.trace(real) * np.eye(3) - real) @ turn)
    np.testing.assert_allclose(after, np.maximum(before, 1e-3 * before.max()), atol=1e-15)
