"""Put effects into the MJCF of a serial robot, as far as MJCF can express them, and build a model for rollouts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.serial.effects import DRY, LAWS, ActingLaw, JointLaw, RobotEffect

LEAST_MOMENT = 1e-3
"""Smallest over largest principal second moment of mass of a body. Chosen: that of a thin sheet."""
_POSSIBLE = 1e-9
"""Relative tolerance for the physical consistency of an inertia. Chosen: rounding of the numbers of a model."""


def set_inertial(body: mujoco.MjsBody, mass: float, centre: Array, inertia: Array) -> None:
    """Replace the inertial parameters of a body.

    Args:
        body: body of the model.
        mass: mass [kg].
        centre: centre of mass in the body's frame [m], shape (3,).
        inertia: inertia about the centre of mass in the axes of the body's frame [kg m^2], shape (3, 3); if it is not
            physically consistent, the nearest consistent one is used.
    """
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] < 0.0 or moments[0] + moments[1] < moments[2] * (1.0 - _POSSIBLE):
        inertia = real_inertia(inertia)
    moments, axes = np.linalg.eigh(inertia)
    axes = axes * [1.0, 1.0, np.sign(np.linalg.det(axes))]
    body.mass, body.ipos, body.inertia = mass, centre, moments
    body.iquat = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    # MuJoCo accepts only one specification of orientation and inertia, so clear the others.
    body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.fullinertia = np.full(6, np.nan)
    body.explicitinertial = True


def keep_inertials(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Write the compiled inertial parameters of all bodies into ``spec``, if compiler settings would alter new ones.

    Such settings compute inertias from geoms, scale the total mass or raise small values. They could undo a cause or
    spread it to other bodies, so they are switched off.
    """
    of = spec.compiler
    from_shapes = of.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    if not (from_shapes or of.settotalmass > 0 or of.boundmass > 0 or of.boundinertia > 0):
        return
    for body in spec.bodies:
        if 0 < body.id < model.nbody:
            mass, centre, inertia = inertial_of(model, body.id)
            set_inertial(body, mass, centre, inertia)
    of.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    of.settotalmass, of.boundmass, of.boundinertia = -1.0, 0.0, 0.0


def inertial_of(model: mujoco.MjModel, body: int) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2] of a compiled body, in the body's frame."""
    own = Rotation.from_quat(model.body_iquat[body], scalar_first=True).as_matrix()
    inertia = own @ np.diag(model.body_inertia[body]) @ own.T
    return float(model.body_mass[body]), np.array(model.body_ipos[body]), inertia


def real_inertia(inertia: Array) -> Array:
    """Project a symmetric inertia about the centre of mass [kg m^2] onto physically consistent ones.

    Density is not negative, so the matrix of second moments of mass is positive semidefinite (P. M. Wensing, S. Kim and
    J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial parameter identification", RA-L
    2018). Eigenvalues below a thousandth of the largest are raised to that value.
    """
    size, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    second = (axes * np.maximum(size, LEAST_MOMENT * max(size[-1], 0.0))) @ axes.T
    return np.trace(second) * np.eye(3) - second


INERTIA = ("xx", "yy", "zz", "xy", "xz", "yz")
SOLREF, SOLIMP = (0.002, 1.0), (0.99, 0.999, 0.001, 0.5, 2.0)
"""Parameters of the rows of dry friction. With MuJoCo's defaults, friction reaches its full value only at a speed of
about loss / (100 / s inertia), which is 0.2 rad/s for 20 N m on 1 kg m^2. With these parameters a tenth of that speed
suffices, for steps of up to 1 ms."""


def into_mjcf(spec: mujoco.MjSpec, effect: RobotEffect) -> bool:
    """Put an effect into a model; return False if MJCF cannot express the effect or its sign.

    The joints of the effect are numbered in the order of ``qpos``, from 1.
    """
    model = spec.compile()
    if effect.cause == "gravity_direction":
        spec.option.gravity = [effect.number(axis) for axis in "xyz"]
        return True
    if effect.cause == "gravity_compensation":
        if model.jnt_actgravcomp.any():  # applied by the actuators, which are disabled
            return False
        for body in spec.bodies[1:]:
            body.gravcomp += effect.number("share")
        return True
    if effect.joint is None and not effect.body:
        return False
    joint = None if effect.joint is None else spec.joint(model.joint(effect.joint - 1).name)
    body = spec.body(effect.body) if effect.body else joint.parent
    index = model.body(effect.body).id if effect.body else int(model.joint(joint.name).bodyid[0])
    if effect.cause == "link_length":
        body.pos = np.array(body.pos) + [effect.number(axis) for axis in "xyz"]
        return True
    if effect.cause in ("link_mass", "link_com", "link_inertia", "payload"):
        return _inertial(spec, body, inertial_of(model, index), effect)
    return joint is not None and _at_joint(spec, joint, model, effect)


def _at_joint(
    spec: mujoco.MjSpec, joint: mujoco.MjsJoint, model: mujoco.MjModel, effect: RobotEffect
) -> bool:
    at = model.joint(joint.name).id
    if effect.cause in DRY:
        joint.solref_friction, joint.solimp_friction = list(SOLREF), list(SOLIMP)
    if effect.cause == "friction":
        coulomb = float(joint.frictionloss) + effect.number("coulomb")
        damping = np.array(joint.damping, dtype=float).reshape(-1)
        viscous = damping[0] + effect.number("viscous")
        if min(coulomb, viscous) < 0:
            return False
        damping[0] = viscous
        if "cubic" in effect.parameters:
            damping = np.pad(damping, (0, 3 - damping.size))
            damping[1:] += effect.number("quadratic"), effect.number("cubic")
        joint.frictionloss, joint.damping = coulomb, damping if damping.size > 1 else viscous
    elif effect.cause == "armature":
        joint.armature = max(float(joint.armature) + effect.number("armature"), 0.0)
    elif effect.cause == "spring":
        most = effect.number("stiffness")
        if most <= 0 or model.jnt_stiffness[at]:
            return False
        stiffness = np.array(joint.stiffness, dtype=float).reshape(-1)
        stiffness[0] = most
        joint.stiffness = stiffness if stiffness.size > 1 else most
        joint.springref = _as_written(spec, joint, effect.number("middle") - effect.number("offset") / most)
    elif effect.cause == "joint_zero":
        # The true angle exceeds the reading by the zero, so the reading in the reference pose is lower.
        joint.ref = float(joint.ref) - _as_written(spec, joint, effect.number("zero"))
    elif effect.cause == "coupled_drive":
        return _coupled(spec, model, effect)
    else:
        return False
    return True


def _coupled(spec: mujoco.MjSpec, model: mujoco.MjModel, effect: RobotEffect) -> bool:
    """Give a fixed tendon along both joints friction and armature at their combined speed.

    Inverse dynamics of a model that has the tendon, such as one as found before, hold its damping and its armature but
    not its dry friction, so the effect adds to the former and replaces the latter.
    """
    values = [effect.number(stem) for stem in ("coulomb", "viscous", "armature")]
    if min(values) < 0 or effect.partner is None or effect.joint is None:
        return False
    name = f"drive_of_{effect.partner}_and_{effect.joint}"
    tendon = spec.tendon(name)
    if tendon is None:
        tendon = spec.add_tendon(name=name)
        tendon.wrap_joint(model.joint(effect.joint - 1).name, 1.0)
        tendon.wrap_joint(model.joint(effect.partner - 1).name, effect.number("ratio"))
    damping = np.array(tendon.damping, dtype=float).reshape(-1)
    damping[0] += values[1]
    tendon.solref_friction, tendon.solimp_friction = list(SOLREF), list(SOLIMP)
    tendon.frictionloss, tendon.armature = values[0], float(tendon.armature) + values[2]
    tendon.damping = damping if damping.size > 1 else damping[0]
    return True


def _as_written(spec: mujoco.MjSpec, joint: mujoco.MjsJoint, position: float) -> float:
    """Convert a joint position [rad or m] to the unit of the model's file: degrees for hinges by default."""
    turns = joint.type == mujoco.mjtJoint.mjJNT_HINGE
    return float(np.degrees(position)) if turns and spec.compiler.degree else position


def _inertial(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, own: tuple[float, Array, Array], effect: RobotEffect
) -> bool:
    mass, centre, inertia = own
    if effect.cause == "payload":
        load, at = effect.number("mass"), np.array([effect.number(axis) for axis in "xyz"])
        if mass + load <= 0.0:
            return False
        if load > 0.0:
            keep_inertials(spec, spec.compile())
            more = body.add_body(name=f"payload_at_{body.name}")
            set_inertial(more, load, at, real_inertia(_moments(effect)))
            return True
        total = (mass * centre + load * at) / (mass + load)
        moved = mass * _spread(centre - total) + load * _spread(at - total)
        mass, centre, inertia = mass + load, total, inertia + moved + _moments(effect)
    elif effect.cause == "link_mass":
        mass += effect.number("excess")
    elif effect.cause == "link_com":
        centre = centre + [effect.number(axis) for axis in "xyz"]
    else:
        inertia = inertia * (1.0 + effect.number("share"))
    if mass <= 0.0 or np.trace(inertia) < 0.0:
        return False
    keep_inertials(spec, spec.compile())
    set_inertial(body, mass, centre, inertia)
    return True


def _spread(way: Array) -> Array:
    """Inertia of a point mass of 1 kg about a point at distance ``way`` [m], shape (3, 3)."""
    return way @ way * np.eye(3) - np.outer(way, way)


def _moments(effect: RobotEffect) -> Array:
    xx, yy, zz, xy, xz, yz = (effect.number(f"inertia_{axes}") for axes in INERTIA)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


Effect = RobotEffect | JointLaw


@dataclass(frozen=True, eq=False)
class Built:
    """A robot with effects, ready for ``mocobot_sim.serial.extended.step``."""

    # compiled model with the effects that MJCF can express; contacts, limits and actuators are disabled, the integrator
    # is ``implicitfast``, and dry friction is nearly independent of speed
    model: mujoco.MjModel
    stepped: tuple[Effect, ...]  # effects that ``step`` adds
    left_out: tuple[int, ...]  # indices, from 0, of the given effects that are not simulated

    def running(self) -> list[RobotEffect | ActingLaw]:
        """Effects for ``step``, new for every run because laws can have a state."""
        return [ActingLaw(e) if isinstance(e, JointLaw) else e for e in self.stepped]


def with_effects(spec: mujoco.MjSpec, effects: Sequence[Effect]) -> tuple[mujoco.MjModel, list[bool]]:
    """Put effects into a model as far as MJCF can express them; return the compiled model and which effects it has.

    Raises:
        InputError: MuJoCo rejects the model with the effects.
    """
    try:
        inside = [isinstance(e, RobotEffect) and into_mjcf(spec, e) for e in effects]
        return spec.compile(), inside
    except (ValueError, RuntimeError) as error:
        text = " ".join(str(error).split())
        raise InputError(f"MuJoCo refuses the model with the causes in it ({text})") from error


def servo(
    spec: mujoco.MjSpec, joint: str, stiffness: float, damping: float, more: float, most: float
) -> None:
    """Make the actuator of a joint, or a new one, a position loop.

    Args:
        spec: the robot; changed.
        joint: name of the joint.
        stiffness, damping: torque per error of position and per velocity [N m/rad, N m s/rad; N/m, N s/m].
        more: torque added [N m or N].
        most: largest torque [N m or N], inf for no limit.
    """
    own = [a for a in spec.actuators if a.trntype == mujoco.mjtTrn.mjTRN_JOINT and a.target == joint]
    if not own:
        own = [spec.add_actuator(name=f"{joint} loop", trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint)]
    for actuator in own:
        actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        actuator.dyntype, actuator.ctrllimited = mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtLimited.mjLIMITED_FALSE
        gear, count = actuator.gear[0], len(own)
        actuator.gainprm[:3] = stiffness / gear / count, 0.0, 0.0
        actuator.biasprm[:3] = (
            more / gear / count,
            -stiffness / gear**2 / count,
            -max(damping, 0.0) / gear**2 / count,
        )
        if np.isfinite(most):
            actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            actuator.forcerange = np.array([-most, most]) / abs(gear) / count


def build(spec: mujoco.MjSpec, effects: Sequence[Effect], step_s: float) -> Built:
    """Build a robot with effects for rollouts.

    Args:
        spec: nominal model; changed.
        effects: effects to add.
        step_s: integration step [s].

    Raises:
        InputError: MuJoCo rejects the model with the effects.
    """
    model, inside = with_effects(spec, effects)
    off = mujoco.mjtDisableBit
    for bit in (off.mjDSBL_CONTACT, off.mjDSBL_LIMIT, off.mjDSBL_ACTUATION, off.mjDSBL_AUTORESET):
        model.opt.disableflags |= int(bit)
    model.opt.integrator, model.opt.timestep = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST), step_s
    model.dof_solref[:], model.dof_solimp[:] = SOLREF, SOLIMP
    rest = [k for k, said in enumerate(inside) if not said]
    stepped = tuple(effects[k] for k in rest if steps(effects[k]))
    return Built(model, stepped, tuple(k for k in rest if not steps(effects[k])))


def steps(effect: Effect) -> bool:
    """Whether ``step`` can simulate an effect; errors of the log are not simulated."""
    return effect.acts if isinstance(effect, JointLaw) else effect.cause in LAWS
