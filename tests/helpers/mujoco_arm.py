"""One Omnid in MuJoCo's compiled model of the whole chain, set to any motion and balanced by linear algebra."""

import mujoco
import numpy as np

from estimator.arm.delta import inverse_kinematics
from omnid_design import DESIGN, OMNID_FOLDER

LEGS = (1, 2, 3)
PASSIVE = [f"knee{k}_{kind}" for k in LEGS for kind in ("swing", "tilt")] + [f"platform_{a}" for a in "xyz"]
HOME = np.array([0.0, 0.0, DESIGN.home_height_m])
GIMBAL = ["gimbal_z", "gimbal_y", "gimbal_x"]


class Arm:
    """One Omnid in MuJoCo, its closed chain completed from driven and gimbal motion."""

    def __init__(self, model=None):
        self.model = model or mujoco.MjModel.from_xml_path(str(OMNID_FOLDER / "omnid.xml"))
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EQUALITY
        self.model.opt.gravity[2] = -DESIGN.gravity_mps2
        # The estimator's rods are slender; the model needs a speck of inertia about their own axis.
        for k in LEGS:
            assert self.model.body(f"rod{k}").inertia[0] < 2e-6
            self.model.body(f"rod{k}").inertia[0] = 1e-15
        self.data = mujoco.MjData(self.model)
        self.home = inverse_kinematics(HOME, DESIGN)

    def dofs(self, names):
        return np.array([self.model.joint(name).dofadr[0] for name in names])

    def set_motion(self, phi, theta, rng):
        """phi, theta: (angle, rate, acceleration); the share of the spring in phi is random."""
        d = self.data
        motors, springs = self.dofs([f"motor{k}" for k in LEGS]), self.dofs([f"spring{k}" for k in LEGS])
        passive = self.dofs(PASSIVE)
        for target, offset, joint, gimbal in zip(
            (d.qpos, d.qvel, d.qacc), (self.home, 0, 0), phi, theta, strict=True
        ):
            target[:] = 0
            target[springs] = rng.uniform(-0.2, 0.2, 3)
            target[motors] = joint - offset - target[springs]
            target[self.dofs(GIMBAL)] = gimbal
        # In small steps from home, so that the chain stays in its assembly.
        goal = d.qpos[motors].copy()
        start = -d.qpos[springs]
        for share in np.linspace(0, 1, 20):
            d.qpos[motors] = start + share * (goal - start)
            for _ in range(8):
                gap, c = self.constraint()
                d.qpos[passive] -= np.linalg.solve(c[:, passive], gap)
        gap, c = self.constraint()
        assert np.abs(gap).max() < 1e-13
        d.qvel[passive] = -np.linalg.solve(c[:, passive], c @ d.qvel)
        d.qacc[passive] = -np.linalg.solve(c[:, passive], c @ d.qacc + self.bias())

    def constraint(self):
        """Gap between rod tips and platform joints (9,) and its Jacobian (9, nv)."""
        m, d = self.model, self.data
        mujoco.mj_fwdPosition(m, d)
        gap = [d.site(f"rod{k}_tip").xpos - d.site(f"platform{k}").xpos for k in LEGS]
        rows = [self.site_jacobian(f"rod{k}_tip")[0] - self.site_jacobian(f"platform{k}")[0] for k in LEGS]
        return np.concatenate(gap), np.concatenate(rows)

    def site_jacobian(self, site):
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, linear, angular, self.model.site(site).id)
        return linear, angular

    def bias(self):
        """d(constraint Jacobian)/dt qvel (9,)."""
        m, d = self.model, self.data
        mujoco.mj_fwdVelocity(m, d)

        def of(site):
            derivative = np.zeros((3, m.nv))
            body = m.site(site).bodyid[0]
            mujoco.mj_jacDot(m, d, derivative, None, d.site(site).xpos, body)
            return derivative @ d.qvel

        return np.concatenate([of(f"rod{k}_tip") - of(f"platform{k}") for k in LEGS])

    def balance(self, f_b):
        """Spring torques and moment on the payload in {i} for a force f_b of the robot on the payload."""
        m, d = self.model, self.data
        mujoco.mj_inverse(m, d)
        needed = d.qfrc_inverse + d.qfrc_passive
        springs = self.dofs([f"spring{k}" for k in LEGS])
        rows = np.concatenate([springs, self.dofs(PASSIVE), self.dofs(GIMBAL)])
        _, c = self.constraint()
        linear, angular = self.site_jacobian("grasp")
        at_springs = np.eye(m.nv)[springs]
        # needed = springs' torque + constraint forces - what goes on to the payload
        unknown = np.concatenate([at_springs, c, -angular]).T[rows]
        solution = np.linalg.solve(unknown, (needed + linear.T @ f_b)[rows])
        R = d.site("grasp").xmat.reshape(3, 3)
        return solution[:3], R.T @ solution[12:]


def random_motion(rng):
    direction = rng.normal(size=3)
    h = DESIGN.workspace_radius_m * rng.uniform(0.2, 1) * direction / np.linalg.norm(direction)
    phi = inverse_kinematics(h + HOME, DESIGN)
    theta = rng.uniform(-DESIGN.gimbal_limit_rad, DESIGN.gimbal_limit_rad, 3)
    return (phi, rng.normal(0, 3, 3), rng.normal(0, 30, 3)), (
        theta,
        rng.normal(0, 3, 3),
        rng.normal(0, 30, 3),
    )
