"""Our own Newton and Euler against MuJoCo: torques, their slopes by every number of the model, forces on a link."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from discrepancy.joints.mechanics import (
    Motion,
    Tree,
    body_regressor,
    by_acceleration,
    by_displacement,
    force_torque,
    inertial_parameters,
    inverse_torque,
    rigid_torque,
    torque_of,
)

BRANCHED = """
<mujoco><compiler angle="radian"/><worldbody>
  <body name="a" pos=".1 0 .3" quat="1 .2 .3 .1"><joint name="ja" axis="1 .3 .2" pos=".05 0 .02" ref=".2"/>
    <inertial pos=".1 .2 .1" mass="2" fullinertia=".05 .06 .07 .01 .002 -.003"/>
    <body name="b" pos=".2 .1 .3" quat="1 -.2 .3 .4"><joint name="jb" type="slide" axis="0 .3 1" pos=".05 .1 .02"/>
      <inertial pos=".1 .02 .1" mass="1" diaginertia=".05 .06 .07" quat="1 .1 .2 .3"/>
      <body name="fixed" pos=".3 0 0"><inertial pos=".1 .02 .1" mass=".5" diaginertia=".05 .06 .07"/>
        <body name="c" pos=".2 .1 .3" quat="1 -.2 .3 .4">
          <joint name="jc" axis="0 .3 1" pos=".05 .1 .02"/><joint name="jd" axis="1 .3 0" pos=".05 .3 .02"/>
          <inertial pos=".1 .02 .1" mass="1" diaginertia=".05 .06 .07" quat="1 .1 .2 .3"/></body></body></body>
    <body name="e" pos=".2 -.1 .3" quat="1 -.2 .3 .4"><joint name="je" axis="0 1 0" damping="3" frictionloss="2"/>
      <inertial pos=".1 .02 .1" mass="1" diaginertia=".05 .06 .07" quat="1 .1 .2 .3"/></body></body>
</worldbody></mujoco>"""
"""Hinges and a slide, a branch, a body of two joints, a welded body, a joint whose zero is elsewhere."""


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(BRANCHED)


@pytest.fixture(scope="module")
def states(model: mujoco.MjModel) -> np.ndarray:
    return np.random.default_rng(0).standard_normal((3, 40, model.nv))


@pytest.fixture(scope="module")
def motion(model: mujoco.MjModel, states: np.ndarray) -> Motion:
    return Motion.of(Tree.of(model), *states)


def test_torques_are_those_of_mujoco(model: mujoco.MjModel, states: np.ndarray, motion: Motion) -> None:
    theirs = inverse_torque(model, *states)
    assert np.abs(theirs).max() > 40.0
    np.testing.assert_allclose(rigid_torque(motion), theirs, atol=1e-11)
    np.testing.assert_allclose(torque_of(motion.tree, *states), theirs, atol=1e-11)


def test_accelerations_are_those_of_the_motion_whatever_a_step_would_make_of_them(states: np.ndarray) -> None:
    option = '<option integrator="implicit" timestep=".02"><flag invdiscrete="enable"/></option>'
    other = mujoco.MjModel.from_xml_string(BRANCHED.replace("<worldbody>", f"{option}<worldbody>"))
    plain = mujoco.MjModel.from_xml_string(BRANCHED)
    np.testing.assert_allclose(inverse_torque(other, *states), inverse_torque(plain, *states), atol=1e-11)


def test_regressors_make_the_torques(model: mujoco.MjModel, states: np.ndarray, motion: Motion) -> None:
    tree = motion.tree
    made = sum(
        body_regressor(motion, b) @ inertial_parameters(tree.mass[b], tree.com[b], tree.inertia[b])
        for b in range(1, model.nbody)
    )
    np.testing.assert_allclose(made, inverse_torque(model, *states), atol=1e-11)


@pytest.mark.parametrize("body", [1, 2, 4, 5])
def test_slopes_by_mass_and_centre(states: np.ndarray, motion: Motion, body: int) -> None:
    """MuJoCo's inverse dynamics is linear in a mass and in first moments, so differences are exact."""
    tree = motion.tree
    before = inverse_torque(mujoco.MjModel.from_xml_string(BRANCHED), *states)
    heavier = mujoco.MjModel.from_xml_string(BRANCHED)
    heavier.body_mass[body] += 0.5
    slope = (inverse_torque(heavier, *states) - before) / 0.5
    point = inertial_parameters(1.0, tree.com[body], np.zeros((3, 3)))
    np.testing.assert_allclose(body_regressor(motion, body) @ point, slope, atol=1e-10)
    moved = mujoco.MjModel.from_xml_string(BRANCHED)
    moved.body_ipos[body] += [0.01, -0.02, 0.03]
    here, there = (
        inertial_parameters(tree.mass[body], c, tree.inertia[body])
        for c in (tree.com[body], tree.com[body] + [0.01, -0.02, 0.03])
    )
    np.testing.assert_allclose(
        body_regressor(motion, body) @ (there - here), inverse_torque(moved, *states) - before, atol=1e-10
    )


@pytest.mark.parametrize("body", [1, 2, 4, 5])
def test_slopes_by_a_displaced_frame(states: np.ndarray, motion: Motion, body: int) -> None:
    step = 1e-5
    for k in range(3):
        ends = []
        for sign in (1.0, -1.0):
            moved = mujoco.MjModel.from_xml_string(BRANCHED)
            moved.body_pos[body, k] += sign * step
            ends.append(inverse_torque(moved, *states))
        np.testing.assert_allclose(
            by_displacement(motion, body)[:, :, k], (ends[0] - ends[1]) / (2 * step), atol=2e-6
        )


def test_slopes_by_gravity(states: np.ndarray, motion: Motion) -> None:
    """Gravity enters linearly."""
    before = inverse_torque(mujoco.MjModel.from_xml_string(BRANCHED), *states)
    for k in range(3):
        other = mujoco.MjModel.from_xml_string(BRANCHED)
        other.opt.gravity[k] -= 2.0
        slope = (inverse_torque(other, *states) - before) / 2.0
        np.testing.assert_allclose(by_acceleration(motion)[:, :, k], slope, atol=1e-11)


def test_force_on_a_link(model: mujoco.MjModel, states: np.ndarray, motion: Motion) -> None:
    """Against MuJoCo's Jacobian of the point."""
    data, jacobian, point = mujoco.MjData(model), np.zeros((3, model.nv)), np.array([0.1, -0.2, 0.3])
    body = model.body("c").id
    torque = force_torque(motion, body, point)
    for k in range(10):
        data.qpos[:] = states[0, k]
        mujoco.mj_forward(model, data)
        at = data.xpos[body] + data.xmat[body].reshape(3, 3) @ point
        mujoco.mj_jac(model, data, jacobian, None, at, body)
        np.testing.assert_allclose(torque[k], jacobian.T, atol=1e-12)
