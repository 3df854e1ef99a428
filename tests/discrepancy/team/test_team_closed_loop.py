"""The team that is simulated again stands as the unknowns say, in the axes in which they say it."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from discrepancy.team.closed_loop import team_of
from estimator.arrays import inertia_matrix
from estimator.rigid_team import Bases, pose_error
from mocobot_sim.effects import make_effect
from team_case import true_bases, true_shared

TILT = np.array([0.02, -0.013, 0.0])


@pytest.mark.parametrize("robot", [None, 1, 2, 3])
def test_tilted_bases_stand_where_the_rows_have_them(robot):
    """Rigid grasps seen from the simulated bases: the pose residual is zero once the tilt alone is put into it.

    The rows' column of robot 1's tilt turns all other bases, places included, about {b1}; so the unknown places are
    those in the axes of {b1} before it tilts.
    """
    shared, bases = true_shared(), true_bases()
    effects = []
    if robot is not None:
        effects = [make_effect("base_tilt", {"roll_rad": TILT[0], "pitch_rad": TILT[1]}, robot)]
    model = team_of(shared, bases, effects).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    frames = [data.body(f"omnid{i}/base") for i in (1, 2, 3)]
    R_Wb = np.array([frame.xmat.reshape(3, 3) for frame in frames])
    p_Wb = np.array([frame.xpos for frame in frames])
    # Any pose of the payload, and what every robot would see of its grasp frame.
    R_W1 = Rotation.from_rotvec([0.05, -0.08, 0.11]).as_matrix()
    p_W1 = p_Wb[0] + np.array([0.03, -0.02, 0.41])
    R_bi = np.swapaxes(R_Wb, 1, 2) @ R_W1 @ shared.grasps.R_1i
    p_bi = np.einsum("nji,nj->ni", R_Wb, p_W1 + shared.grasps.p_1i @ R_W1.T - p_Wb)
    turn = Rotation.from_rotvec(TILT).as_matrix()
    tilted = Bases(bases.R.copy(), bases.p.copy())
    if robot == 1:
        tilted.R[1:], tilted.p[1:] = turn.T @ bases.R[1:], bases.p[1:] @ turn
    elif robot is not None:
        tilted.R[robot - 1] = bases.R[robot - 1] @ turn
    left = pose_error(R_bi[None], p_bi[None], shared, tilted)
    np.testing.assert_allclose(left, 0.0, atol=1e-9)


def test_a_swinging_mass_is_not_simulated_twice():
    """Payload and pendulum, its bob at the pivot, are together what the rows' inertial parameters say."""
    shared, at, bob = true_shared(), np.array([0.3, 0.4, -0.05]), 0.25
    point = dict(zip(("point_x_m", "point_y_m", "point_z_m"), at.tolist(), strict=True))
    effect = make_effect("slosh", {"mass_kg": bob, "length_m": 0.2, "damping_ratio": 0.05, **point})
    model = team_of(shared, true_bases(), [effect]).compile()
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "omnid1/payload/payload")
    swinging = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "omnid1/payload/slosh")
    mass, com = model.body_mass[body], model.body_ipos[body]
    R = Rotation.from_quat(model.body_iquat[body], scalar_first=True).as_matrix()
    assert model.body_mass[swinging] == pytest.approx(bob)
    np.testing.assert_allclose(model.body_pos[swinging], at, atol=1e-12)
    about_1 = R @ np.diag(model.body_inertia[body]) @ R.T + mass * (
        com @ com * np.eye(3) - np.outer(com, com)
    )
    together = about_1 + bob * (at @ at * np.eye(3) - np.outer(at, at))
    assert mass + bob == pytest.approx(shared.pi[0])
    np.testing.assert_allclose(mass * com + bob * at, shared.pi[1:4], atol=1e-9)
    np.testing.assert_allclose(together, inertia_matrix(shared.pi[4:]), atol=1e-6)
