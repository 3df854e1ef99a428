"""Effects that MJCF can say, put into a model."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from mocobot_sim.serial.effects import DRY, RobotEffect

INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
SOLREF, SOLIMP = (0.002, 1.0), (0.99, 0.999, 0.001, 0.5, 2.0)
"""Of dry friction. With MuJoCo's defaults it grows with the speed up to about loss / (100 / s inertia), 0.2 rad/s for
20 N m on 1 kg m^2; with these up to a tenth of that, for steps of up to 1 ms."""
LEAST_MOMENT = 1e-3
"""Of a payload's largest second moment of mass, the least that it has in any direction. Chosen: a thin sheet's."""


def into_mjcf(spec: mujoco.MjSpec, effect: RobotEffect) -> bool:
    """Put an effect into a model; False if MJCF has no word for it, or not for its sign.

    Args:
        spec: the model, changed in place.
        effect: with its joint counted in the order of qpos.
    """
    model = spec.compile()
    if effect.cause == "gravity_direction":
        spec.option.gravity = _tilted(np.array(model.opt.gravity), effect)
        return True
    if effect.joint is None:
        return False
    at = effect.joint - 1
    joint = spec.joint(model.joint(at).name)
    body = spec.body(model.body(model.jnt_bodyid[at]).name)
    if effect.cause in DRY:
        joint.solref_friction, joint.solimp_friction = list(SOLREF), list(SOLIMP)
    if effect.cause == "friction":
        coulomb = float(joint.frictionloss) + effect.number("coulomb")
        damping = np.array(joint.damping, dtype=float).reshape(-1)
        viscous = damping[0] + effect.number("viscous")
        if min(coulomb, viscous) < 0:
            return False
        damping[0] = viscous
        joint.frictionloss, joint.damping = coulomb, damping if damping.size > 1 else viscous
    elif effect.cause == "armature":
        joint.armature = max(float(joint.armature) + effect.number("armature"), 0.0)
    elif effect.cause == "spring":
        if effect.number("stiffness") < 0 or model.jnt_stiffness[at]:
            return False
        stiffness = np.array(joint.stiffness, dtype=float).reshape(-1)
        stiffness[0] = effect.number("stiffness")
        joint.stiffness = stiffness if stiffness.size > 1 else stiffness[0]
        joint.springref = effect.number("neutral")
    elif effect.cause == "joint_zero":
        # It stands farther than it reads: in the pose of the drawing it reads that much less.
        joint.ref = float(joint.ref) - effect.number("zero")
    elif effect.cause == "coupled_drive":
        return _coupled(spec, model, effect)
    elif effect.cause == "link_length":
        body.pos = np.array(body.pos) + [effect.number(axis) for axis in "xyz"]
    elif effect.cause in ("link_mass", "link_com", "link_inertia"):
        _inertial(body, model, int(model.jnt_bodyid[at]), effect)
    elif effect.cause == "payload":
        load = body.add_body(name=f"payload_at_{body.name}")
        load.mass, load.ipos = effect.number("mass"), [effect.number(axis) for axis in "xyz"]
        ball = effect.number("mass") * effect.number("gyration") ** 2 * np.eye(3)
        load.fullinertia = _six(real_inertia(ball + _moments(effect)))
        load.explicitinertial = True
    else:
        return False
    return True


def _coupled(spec: mujoco.MjSpec, model: mujoco.MjModel, effect: RobotEffect) -> bool:
    """A fixed tendon along both joints rubs and has inertia at their common speed."""
    values = [effect.number(stem) for stem in ("coulomb", "viscous", "armature")]
    if min(values) < 0 or effect.partner is None or effect.joint is None:
        return False
    tendon = spec.add_tendon(name=f"drive_of_{effect.partner}_and_{effect.joint}")
    tendon.wrap_joint(model.joint(effect.joint - 1).name, 1.0)
    tendon.wrap_joint(model.joint(effect.partner - 1).name, effect.number("ratio"))
    damping = np.array(tendon.damping, dtype=float).reshape(-1)
    damping[0] = values[1]
    tendon.solref_friction, tendon.solimp_friction = list(SOLREF), list(SOLIMP)
    tendon.frictionloss, tendon.armature = values[0], values[2]
    tendon.damping = damping if damping.size > 1 else values[1]
    return True


def _inertial(body: mujoco.MjsBody, model: mujoco.MjModel, index: int, effect: RobotEffect) -> None:
    own = Rotation.from_quat(model.body_iquat[index], scalar_first=True).as_matrix()
    mass, centre = float(model.body_mass[index]), np.array(model.body_ipos[index])
    inertia = own @ np.diag(model.body_inertia[index]) @ own.T
    if effect.cause == "link_mass":
        inertia *= 1.0 + effect.number("excess") / mass  # denser or less dense
        mass += effect.number("excess")
    elif effect.cause == "link_com":
        centre = centre + [effect.number(axis) for axis in "xyz"]
    else:
        inertia = inertia + _moments(effect)
    body.mass, body.ipos, body.iquat = mass, centre, [1.0, 0.0, 0.0, 0.0]
    body.fullinertia, body.explicitinertial = _six(inertia), True


def _moments(effect: RobotEffect) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = (effect.number(f"inertia_{axes}") for axes in INERTIA)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _six(inertia: np.ndarray) -> list[float]:
    return [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]


def real_inertia(inertia: np.ndarray) -> np.ndarray:
    """The inertia nearest to a fitted one that a body can have, which MuJoCo asks for.

    A density is nowhere below zero, so second moments of mass are positive semidefinite (P. M. Wensing, S. Kim and
    J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial parameter identification", RA-L
    2018); those that are not are set to a thousandth of the largest.

    Args:
        inertia: about the centre of mass [kg m^2], shape (3, 3), symmetric.
    """
    size, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    second = (axes * np.maximum(size, LEAST_MOMENT * max(size[-1], 0.0))) @ axes.T
    return np.trace(second) * np.eye(3) - second


def _tilted(gravity: np.ndarray, effect: RobotEffect) -> np.ndarray:
    """Gravity in the frame of a base that is turned about two horizontal axes."""
    up = -gravity / np.linalg.norm(gravity)
    axis = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    first = axis - up * (axis @ up)
    first /= np.linalg.norm(first)
    turn = effect.number("tilt_1") * first + effect.number("tilt_2") * np.cross(up, first)
    return Rotation.from_rotvec(turn).inv().apply(gravity)
