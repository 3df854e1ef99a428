"""Kinematics and inverse dynamics of the arm against MuJoCo's compiled model of the whole chain.

Driven angles, gimbal angles and their derivatives are random; the passive joints follow from MuJoCo's own
constraint Jacobian. The forces that MuJoCo's inverse dynamics asks for are then balanced by spring torques,
the rods' constraint forces and the payload's reaction, found by linear algebra.
"""

import numpy as np
import pytest

from estimator.arm.delta import forward_kinematics, jacobian
from estimator.arm.dynamics import rotation, wrench_on_payload
from mujoco_arm import LEGS, Arm, random_motion
from omnid_design import DESIGN


@pytest.fixture(scope="module")
def arm():
    return Arm()


@pytest.mark.parametrize("seed", range(20))
def test_pose_and_jacobian(arm, seed):
    rng = np.random.default_rng(seed)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    base, grasp = arm.data.site("base"), arm.data.site("grasp")
    assert base.xmat.reshape(3, 3) == pytest.approx(np.eye(3), abs=1e-15)
    assert grasp.xpos - base.xpos == pytest.approx(forward_kinematics(phi[0], DESIGN), abs=1e-12)
    assert grasp.xmat.reshape(3, 3) == pytest.approx(rotation(theta[0]), abs=1e-12)
    assert arm.site_jacobian("grasp")[0] @ arm.data.qvel == pytest.approx(jacobian(phi[0], DESIGN) @ phi[1])


@pytest.mark.parametrize("seed", range(20))
def test_wrench_on_the_payload(arm, seed):
    rng = np.random.default_rng(100 + seed)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    f_b = rng.normal(0, 30, 3)
    tau, m_i = arm.balance(f_b)
    wrench = wrench_on_payload(phi, theta, tau, DESIGN)
    assert wrench[3:] == pytest.approx(rotation(theta[0]).T @ f_b, abs=1e-8)
    assert wrench[:3] == pytest.approx(m_i, abs=1e-11)
    assert np.abs(m_i).max() > 1e-4


def test_gravity_of_the_resting_arm(arm):
    rng = np.random.default_rng(7)
    phi, theta = random_motion(rng)
    still = np.zeros(3), np.zeros(3)
    arm.set_motion((phi[0], *still), (theta[0], *still), rng)
    arm.data.qvel[:], arm.data.qacc[:] = 0, 0
    tau, _ = arm.balance(np.zeros(3))
    wrench = wrench_on_payload((phi[0], *still), (theta[0], *still), tau, DESIGN)
    assert wrench == pytest.approx(np.zeros(6), abs=1e-9)
    assert tau.min() > 0.3


def test_slender_rods_neglect_next_to_nothing():
    """With the rods' small axial inertia left in, the force changes by less than 0.1 mN."""
    arm = Arm()
    rng = np.random.default_rng(1)
    for k in LEGS:
        arm.model.body(f"rod{k}").inertia[0] = 1e-6
    worst = 0.0
    for _ in range(20):
        phi, theta = random_motion(rng)
        arm.set_motion(phi, theta, rng)
        tau, _ = arm.balance(np.zeros(3))
        worst = max(worst, np.abs(wrench_on_payload(phi, theta, tau, DESIGN)[3:]).max())
    assert 1e-9 < worst < 1e-4
