"""Effects that MJCF can say, put into a model."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from mocobot_sim.serial.effects import DRY, RobotEffect
from mocobot_sim.serial.inertials import inertial_of, keep_inertials, real_inertia, set_inertial

INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
SOLREF, SOLIMP = (0.002, 1.0), (0.99, 0.999, 0.001, 0.5, 2.0)
"""Of dry friction. With MuJoCo's defaults it grows with the speed up to about loss / (100 / s inertia), 0.2 rad/s for
20 N m on 1 kg m^2; with these up to a tenth of that, for steps of up to 1 ms."""


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
    body = joint.parent
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
        joint.springref = _as_written(spec, joint, effect.number("neutral"))
    elif effect.cause == "joint_zero":
        # It stands farther than it reads: in the pose of the drawing it reads that much less.
        joint.ref = float(joint.ref) - _as_written(spec, joint, effect.number("zero"))
    elif effect.cause == "coupled_drive":
        return _coupled(spec, model, effect)
    elif effect.cause == "link_length":
        body.pos = np.array(body.pos) + [effect.number(axis) for axis in "xyz"]
    elif effect.cause in ("link_mass", "link_com", "link_inertia"):
        return _inertial(spec, body, model, int(model.jnt_bodyid[at]), effect)
    elif effect.cause == "payload":
        keep_inertials(spec, model)
        load = body.add_body(name=f"payload_at_{body.name}")
        ball = effect.number("mass") * effect.number("gyration") ** 2 * np.eye(3)
        centre = np.array([effect.number(axis) for axis in "xyz"])
        set_inertial(load, effect.number("mass"), centre, real_inertia(ball + _moments(effect)))
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


def _as_written(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, position: float) -> float:
    """A joint's position [rad or m] in the unit in which its model has angles: degrees, if it says nothing."""
    turns = joint.type == mujoco.mjtJoint.mjJNT_HINGE
    return float(np.degrees(position)) if turns and spec.compiler.degree else position


def _inertial(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, model: mujoco.MjModel, index: int, effect: RobotEffect
) -> bool:
    mass, centre, inertia = inertial_of(model, index)
    if effect.cause == "link_mass":
        if mass + effect.number("excess") <= 0.0:
            return False
        inertia = inertia * (1.0 + effect.number("excess") / mass)  # denser or less dense
        mass += effect.number("excess")
    elif effect.cause == "link_com":
        centre = centre + [effect.number(axis) for axis in "xyz"]
    else:
        inertia = inertia + _moments(effect)
    keep_inertials(spec, model)
    set_inertial(body, mass, centre, inertia)
    return True


def _moments(effect: RobotEffect) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = (effect.number(f"inertia_{axes}") for axes in INERTIA)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _tilted(gravity: np.ndarray, effect: RobotEffect) -> np.ndarray:
    """Gravity in the frame of a base that is turned about two horizontal axes."""
    up = -gravity / np.linalg.norm(gravity)
    axis = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    first = axis - up * (axis @ up)
    first /= np.linalg.norm(first)
    turn = effect.number("tilt_1") * first + effect.number("tilt_2") * np.cross(up, first)
    return Rotation.from_rotvec(turn).inv().apply(gravity)
