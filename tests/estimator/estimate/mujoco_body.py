"""Data of a rigid body held at sites, with MuJoCo as the authority for twists and required wrenches."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.signals import GraspData
from rigid_body_data import Body, body_pose

GRAVITY = 9.81


def mujoco_data(body: Body, t: np.ndarray, seed: int = 0) -> GraspData:
    """A prescribed motion; ``mj_inverse`` gives the wrench needed, ``mj_applyFT`` shares it among the sites.

    The twist derivative is a central difference over 0.1 ms of MuJoCo's site velocities (error near 1e-7).
    """
    N, Q = len(body.p_1i), len(t)
    rows = "".join(
        f'<site name="grasp{i + 1}" pos="{_text(body.p_1i[i])}" quat="{_text(_wxyz(body.R_1i[i]))}"/>'
        for i in range(N)
    )
    I = body.inertia  # noqa: E741
    full = _text([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler autolimits="true"/><option gravity="0 0 {-GRAVITY}"/><worldbody>'
        f'<body name="payload"><freejoint/><inertial pos="{_text(body.p_1c)}" mass="{body.mass}" '
        f'fullinertia="{full}"/>{rows}</body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    sites = [model.site(f"grasp{i + 1}").id for i in range(N)]
    rng = np.random.default_rng(seed)
    h = 1e-4

    def place(time):
        R, omega, alpha, p, v, a = (x[0] for x in body_pose(np.array([time])))
        data.qpos[:3], data.qpos[3:] = p, _wxyz(R)
        data.qvel[:3], data.qvel[3:] = v, omega
        data.qacc[:3], data.qacc[3:] = a, alpha

    def twists(time):
        place(time)
        mujoco.mj_forward(model, data)
        out, local = np.empty((N, 6)), np.empty(6)
        for i, site in enumerate(sites):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, site, local, 1)
            out[i] = local
        return out

    twist, twist_dot, wrench = (np.empty((Q, N, 6)) for _ in range(3))
    R_bi, p_bi = np.empty((Q, N, 3, 3)), np.empty((Q, N, 3))
    for q, time in enumerate(t):
        twist_dot[q] = (twists(time + h) - twists(time - h)) / (2 * h)
        twist[q] = twists(time)
        place(time)
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse.copy()
        R_bi[q] = data.site_xmat[sites].reshape(N, 3, 3)
        p_bi[q] = data.site_xpos[sites]
        for i in range(1, N):
            f, m = rng.normal(0, 10, 3), rng.normal(0, 2, 3)
            applied = np.zeros(6)
            mujoco.mj_applyFT(model, data, f, m, data.site_xpos[sites[i]], model.body("payload").id, applied)
            needed -= applied
            wrench[q, i] = np.concatenate([R_bi[q, i].T @ m, R_bi[q, i].T @ f])
        # A free joint's generalised force: the force in the world, the moment about {1} in {1}.
        wrench[q, 0] = np.concatenate([needed[3:], R_bi[q, 0].T @ needed[:3]])
    return GraspData(t, R_bi, p_bi, twist, twist_dot, wrench, 1 / (t[1] - t[0]), GRAVITY)


def _wxyz(R):
    return np.roll(Rotation.from_matrix(R).as_quat(), 1)


def _text(values):
    return " ".join(repr(float(v)) for v in values)
