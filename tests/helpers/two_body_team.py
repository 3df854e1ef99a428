"""Omnids that carry two bodies on a joint along an analytic path; MuJoCo's inverse dynamics says what the motion needs.

Poses are sums of sines. MuJoCo has a free body A and a body B on a hinge or a slide, and returns B's pose, the total
wrench and the joint's force. The robots' forces are the least that give these seven, plus a slow squeeze.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arm.delta import inverse_kinematics, jacobian
from estimator.arm.dynamics import arm_torque
from estimator.recording.model import Recording
from omnid_design import DESIGN
from recorded_team import STEP_S, Sines, as_matrix, derivatives, gimbal_moment
from recordings import metadata
from synthetic_team import HOME

TURN = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()


@dataclass(frozen=True)
class TwoBodies:
    """Two bodies in {1} at joint zero.

    ``kind`` is hinge, slide or weld. Centres of mass and pivot are in {1}, inertias about the centres of mass.
    ``grasps`` are (x, y, z, yaw in degrees) in {1} at joint zero.
    """

    kind: str = "hinge"
    axis: tuple[float, float, float] = (0.3, -0.2, 0.93)
    pivot: tuple[float, float, float] = (0.48, 0.02, 0.079)
    mass_A: float = 3.6
    com_A: tuple[float, float, float] = (0.23, 0.1, 0.1)
    mass_B: float = 6.9
    com_B: tuple[float, float, float] = (0.8, 0.15, 0.1)
    I_A: np.ndarray = field(default_factory=lambda: TURN @ np.diag([0.05, 0.12, 0.15]) @ TURN.T)
    I_B: np.ndarray = field(default_factory=lambda: TURN.T @ np.diag([0.5, 0.7, 1.1]) @ TURN)
    damping: float = 0.06
    stiffness: float = 0.0
    rest: float = 0.0
    halves: tuple[tuple[int, ...], tuple[int, ...]] = ((0,), (1, 2))
    grasps: tuple[tuple[float, float, float, float], ...] = (
        (0.0, 0.0, 0.0, 0.0), (0.647, 0.533, 0.0, 0.0), (1.105, -0.305, 0.0, -90.0),
    )  # fmt: skip

    @property
    def model(self) -> mujoco.MjModel:
        """The MuJoCo model; B's frame has its origin in that of A at joint zero."""

        def body(name: str, m: float, com, at: np.ndarray) -> str:
            full = f"{at[0, 0]} {at[1, 1]} {at[2, 2]} {at[0, 1]} {at[0, 2]} {at[1, 2]}"
            return f'<inertial mass="{m}" pos="{com[0]} {com[1]} {com[2]}" fullinertia="{full}"/>'

        a, c = (" ".join(map(str, v)) for v in (self.axis, self.pivot))
        joint = "" if self.kind == "weld" else (
            f'<joint type="{self.kind}" axis="{a}" pos="{c}" damping="{self.damping}" '
            f'stiffness="{self.stiffness}" springref="{self.rest}"/>'
        )  # fmt: skip
        return mujoco.MjModel.from_xml_string(f"""<mujoco><compiler angle="radian"/>
            <option gravity="0 0 -{DESIGN.gravity_mps2}"/><worldbody>
            <body><freejoint/>{body("A", self.mass_A, self.com_A, self.I_A)}
            <body>{joint}{body("B", self.mass_B, self.com_B, self.I_B)}</body></body></worldbody></mujoco>""")

    @property
    def truth(self) -> dict:
        """The keys of a truth file."""
        a = np.array(self.axis) / np.linalg.norm(self.axis)
        turned = [Rotation.from_euler("z", yaw, degrees=True) for *_, yaw in self.grasps]
        places = [np.array(p) for *p, _ in self.grasps]
        bodies = []
        for half, m, com, at in (
            (self.halves[0], self.mass_A, self.com_A, self.I_A),
            (self.halves[1], self.mass_B, self.com_B, self.I_B),
        ):
            back = turned[half[0]].as_matrix().T
            bodies.append({
                "robots": [i + 1 for i in half], "mass_kg": m,
                "p_kc_m": (back @ (np.array(com) - places[half[0]])).tolist(),
                "inertia_k_kgm2": (back @ at @ back.T).tolist(),
            })  # fmt: skip
        unit = "Nm_per_rad" if self.kind == "hinge" else "N_per_m"
        joint = {
            "axis_1": a.tolist(), "pivot_1_m": list(self.pivot), f"stiffness_{unit}": float(self.stiffness),
            "damping_N": float(self.damping), "rest_rad" if self.kind == "hinge" else "rest_m": self.rest,
        }  # fmt: skip
        grasps = [
            {"p_1i_m": p.tolist(), "R_1i_rotvec_deg": np.rad2deg(R.as_rotvec()).tolist()}
            for p, R in zip(places, turned, strict=True)
        ]
        return {"bodies": bodies, "joint": joint, "grasps": grasps}

    def needed(self, qpos: np.ndarray, qvel: np.ndarray, qacc: np.ndarray) -> np.ndarray:
        """Generalized forces that a motion needs according to MuJoCo, shape (Q, 7), or (Q, 6) welded."""
        model = self.model
        data, out = mujoco.MjData(model), np.zeros((len(qpos), model.nv))
        for k in range(len(qpos)):
            data.qpos[:], data.qvel[:], data.qacc[:] = (x[k, : len(y)] for x, y in (
                (qpos, data.qpos), (qvel, data.qvel), (qacc, data.qacc)))  # fmt: skip
            mujoco.mj_inverse(model, data)
            out[k] = data.qfrc_inverse
        return out


def carried(
    bodies: TwoBodies,
    rng: np.random.Generator,
    duration_s: float = 60.0,
    turn_rad: float = 0.05,
    joint_rms: float = 0.08,
    rate_hz: float = 100.0,
    **labels,
) -> Recording:
    """A trial without noise."""
    time = np.arange(round(duration_s * rate_hz)) / rate_hz
    at = time[:, None] + STEP_S * np.arange(-4, 5)
    x = Sines.draw(rng, [turn_rad, turn_rad, turn_rad, 0.02, 0.02, 0.015], 4, 0.05, 0.9)(at)
    q = Sines.draw(rng, [joint_rms], 4, 0.05, 0.9)(at)[..., 0]
    R_W = as_matrix("xyz", x[..., :3])
    middle = np.mean(bodies.grasps, axis=0)[:3]  # all robots move alike
    p_W = x[..., 3:] + middle - R_W @ middle
    # Rates: world velocity of the origin, angular velocity in {1}.
    R, R_dot, R_ddot = derivatives(R_W)
    spin, faster = (
        np.swapaxes(R, 1, 2) @ R_dot,
        np.swapaxes(R, 1, 2) @ R_ddot + np.swapaxes(R_dot, 1, 2) @ R_dot,
    )
    w, alpha = (np.stack([A[:, 2, 1], A[:, 0, 2], A[:, 1, 0]], axis=1) for A in (spin, faster))
    p, q0 = derivatives(p_W), derivatives(q)
    needed = np.zeros((len(time), 7))
    quat = np.roll(Rotation.from_matrix(R).as_quat(), 1, axis=1)
    along = [part[:, None] for part in q0]
    found = bodies.needed(
        np.hstack([p[0], quat, along[0]]), np.hstack([p[1], w, along[1]]), np.hstack([p[2], alpha, along[2]])
    )
    needed[:, : found.shape[1]] = found
    force, moment = np.einsum("qji,qj->qi", R, needed[:, :3]), needed[:, 3:6]

    a = np.array(bodies.axis) / np.linalg.norm(bodies.axis)
    c = np.array(bodies.pivot)
    N = len(bodies.grasps)
    motion, readings, arms = [], [], []
    places = np.zeros((len(time), N, 3))
    for i, (*p_i, yaw) in enumerate(bodies.grasps):
        R_i = Rotation.from_euler("z", yaw, degrees=True).as_matrix() if yaw else np.eye(3)
        turn, shift = np.broadcast_to(np.eye(3), R_W.shape), np.broadcast_to(np.array(p_i), p_W.shape)
        if i in bodies.halves[1] and bodies.kind == "hinge":
            turn = Rotation.from_rotvec((q[..., None] * a).reshape(-1, 3)).as_matrix().reshape(R_W.shape)
            shift = c + turn @ (np.array(p_i) - c)
        elif i in bodies.halves[1] and bodies.kind == "slide":
            shift = shift + q[..., None] * a
        off = Rotation.from_euler("z", rng.uniform(-0.1, 0.1)).as_matrix() @ R_i
        off = off if i else np.eye(3)
        R_bi = off.T @ R_W @ turn @ R_i
        h = (
            p_W + (R_W @ shift[..., None])[..., 0] - p_i - rng.uniform(-0.02, 0.02, 3) * (i > 0)
        ) @ off + HOME
        theta = Rotation.from_matrix(R_bi.reshape(-1, 3, 3)).as_euler("ZYX").reshape(h.shape)
        motion.append(derivatives(np.concatenate([inverse_kinematics(h, DESIGN), theta], axis=-1)))
        arms.append(turn[:, 4] @ R_i)
        places[:, i] = shift[:, 4]
    matrix = np.zeros((len(time), 7, 3 * N))
    right = np.concatenate([force, moment, needed[:, 6:]], axis=1)
    for i in range(N):
        r, at_i = places[:, i], slice(3 * i, 3 * i + 3)
        matrix[:, :3, at_i] = np.eye(3)
        matrix[:, 3:6, at_i] = _skew(r)
        m_1 = (arms[i] @ gimbal_moment(*(part[:, 3:] for part in motion[i]))[..., None])[..., 0]
        right[:, 3:6] -= m_1
        if i in bodies.halves[1] and bodies.kind == "hinge":
            matrix[:, 6, at_i] = np.cross(a, r - c)
            right[:, 6] -= m_1 @ a
        elif i in bodies.halves[1]:
            matrix[:, 6, at_i] = a
    if bodies.kind == "weld":
        matrix, right = matrix[:, :6], right[:, :6]
    f = (np.linalg.pinv(matrix) @ right[..., None])[..., 0]
    squeeze = Sines.draw(rng, [2.0] * (3 * N), 3, 0.1, 0.6)(time)
    inside = np.eye(3 * N) - np.linalg.pinv(matrix) @ matrix
    f = f + (inside @ squeeze[..., None])[..., 0]
    for i in range(N):
        phi, theta = (tuple(part[:, at] for part in motion[i]) for at in (slice(0, 3), slice(3, 6)))
        f_i = np.einsum("qji,qj->qi", arms[i], f[:, 3 * i : 3 * i + 3])
        f_b = Rotation.from_euler("ZYX", theta[0]).apply(f_i)
        tau = np.einsum("qij,qi->qj", jacobian(phi[0], DESIGN), f_b) + arm_torque(*phi, DESIGN)
        readings.append((phi[0], theta[0], tau))
    phi, theta, tau = (np.stack(parts, axis=1) for parts in zip(*readings, strict=True))
    return Recording(time, phi, theta, tau, None, metadata(robots=N, rate_hz=rate_hz, **labels), "two_bodies")


def _skew(r: np.ndarray) -> np.ndarray:
    zero = np.zeros(len(r))
    x, y, z = r.T
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
