"""Read a robot model from MJCF or URDF, and reject all but fixed-base trees of hinge and slide joints."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
from numpy.typing import NDArray

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_logs.formats import shown
from mocobot_sim.model_check import check_model

_OTHER = {int(mujoco.mjtJoint.mjJNT_FREE): "free", int(mujoco.mjtJoint.mjJNT_BALL): "ball"}
_AT_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))


@dataclass(frozen=True, eq=False)
class SerialModel:
    """A robot model with J joints.

    Attributes:
        path: the file.
        model: the compiled model.
        joints: names in the order of qpos; each joint has one degree of freedom, so nq = nv = J.
        bodies: name of the body that each joint moves.
        slides: whether a joint is prismatic, shape (J,); the others are revolute.
        lower: lower position limit [rad or m], -inf if there is none, shape (J,).
        upper: upper position limit [rad or m], inf if there is none, shape (J,).
        torque_limit: largest torque of a joint's actuators [N m or N], inf if there is no limit, shape (J,).
    """

    path: Path
    model: mujoco.MjModel
    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    slides: NDArray[np.bool_]
    lower: Array
    upper: Array
    torque_limit: Array


def load_spec(path: Path | str) -> mujoco.MjSpec:
    """Read a model as an editable ``MjSpec``, without its meshes if it does not compile with them.

    Inverse dynamics needs no meshes if inertias are given, and many URDF files lack their meshes.

    Raises:
        InputError: MuJoCo cannot read or compile the file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; a model is an MJCF or URDF file")
    check_model(path)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError, OSError) as error:
        raise InputError(f"{path}: MuJoCo cannot read it ({_sentence(error)})") from error
    if path.suffix.lower() == ".urdf":
        _without_mass(spec)
    try:
        spec.compile()
    except (ValueError, RuntimeError, OSError) as error:
        said = _sentence(error)
        if spec.meshes:
            spec = mujoco.MjSpec.from_file(
                str(path)
            )  # a spec that failed to compile lists no joints, so read it again
            body = _body_of_meshes(spec)
            if body is not None:
                raise InputError(
                    f"{path}: MuJoCo cannot compile it ({said}); without its meshes: the inertia of {body} would be "
                    "another (give the body an inertial)"
                ) from error
            _drop_meshes(spec)
            try:
                spec.compile()
                return _named(spec)
            except (ValueError, RuntimeError, OSError) as other:
                said += f"; without its meshes: {_sentence(other)}"
        raise InputError(f"{path}: MuJoCo cannot compile it ({said})") from error
    return _named(spec)


def _named(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Give every unnamed body a name, because findings refer to bodies by name."""
    taken = {body.name for body in spec.bodies}
    for k, body in enumerate(spec.bodies):
        if not body.name:
            joint = body.joints[0].name if body.joints else ""
            name = f"link of {joint}" if joint else f"body {k}"
            body.name = f"{name} ({k})" if name in taken else name
            taken.add(body.name)
    return spec


def _body_of_meshes(spec: mujoco.MjSpec) -> str | None:
    """The first moving body whose inertia comes from a mesh, in words; None if there is none."""
    of = spec.compiler
    low, high = of.inertiagrouprange
    for geom in spec.geoms:
        massless = geom.mass == 0.0 or (np.isnan(geom.mass) and geom.density == 0.0)
        if not geom.meshname or massless or not low <= geom.group <= high:
            continue
        body = geom.parent
        given = (
            body.explicitinertial and of.inertiafromgeom != mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
        )
        if not given and _moves(body):
            return (
                f"body {body.name!r}"
                if body.name
                else f"a body without a name (its mesh is {geom.meshname!r})"
            )
    return None


def _moves(body: mujoco.MjsBody) -> bool:
    """Whether a body or one of its ancestors has a joint."""
    while body is not None and body.name != "world":
        if body.joints:
            return True
        body = body.parent
    return False


def _without_mass(spec: mujoco.MjSpec) -> None:
    """Set URDF links without an inertial to zero mass; MuJoCo would use the mass of the shapes of fixed ones."""
    for body in spec.bodies:
        if not body.explicitinertial and not body.joints:
            for geom in body.geoms:
                geom.mass = 0.0


def _drop_meshes(spec: mujoco.MjSpec) -> None:
    """Delete meshes and the geoms that use them."""
    for geom in [geom for geom in spec.geoms if geom.meshname]:
        spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)


def load_model(path: Path | str) -> SerialModel:
    """Read and check the model of a fixed-base tree of hinge and slide joints.

    Raises:
        InputError: MuJoCo cannot read the file, or the model is of another kind: without joints, or with unnamed,
            free or ball joints, equality constraints (closed chains), tendons, soft bodies or plugins.
    """
    model = load_spec(path).compile()
    _check(Path(path), model)
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        model.opt.gravity[:] = 0.0  # so that no caller needs to check the flag
    joint = range(model.njnt)
    limited = model.jnt_limited.astype(bool)
    return SerialModel(
        path=Path(path),
        model=model,
        joints=tuple(model.joint(j).name for j in joint),
        bodies=tuple(model.body(model.jnt_bodyid[j]).name for j in joint),
        slides=model.jnt_type == int(mujoco.mjtJoint.mjJNT_SLIDE),
        lower=np.where(limited, model.jnt_range[:, 0], -np.inf),
        upper=np.where(limited, model.jnt_range[:, 1], np.inf),
        torque_limit=_torque_limits(model),
    )


def _check(path: Path, model: mujoco.MjModel) -> None:
    allowed = "a diagnosis of joint logs needs a fixed-base tree of hinges and slides"
    if not model.njnt:
        raise InputError(f"{path}: the model has no joints; {allowed}")
    for j in range(model.njnt):
        name, word = model.joint(j).name, _OTHER.get(int(model.jnt_type[j]))
        if word is not None:
            raise InputError(f"{path}: joint {name or j + 1!r} is a {word} joint; {allowed}")
        if not name.isprintable():
            raise InputError(f"{path}: joint {name!r:.80} must have a printable name")
        if not name:
            body = model.body(model.jnt_bodyid[j]).name
            raise InputError(
                f"{path}: joint {j + 1} (of body {body!r}) has no name; the map names every joint"
            )
    for count, what in (
        (int(model.neq), "equality constraint"),
        (int(model.ntendon), "tendon"),
        (int(model.nflex), "flexible body"),
        (int(model.nplugin), "plugin"),
    ):
        if count:
            plural = what[:-1] + "ies" if what.endswith("y") else what + "s"
            raise InputError(f"{path}: the model has {count} {what if count == 1 else plural}; {allowed}")


def _torque_limits(model: mujoco.MjModel) -> Array:
    """Torque limit of each joint: its own actuator force range, or the sum of its actuators' force ranges."""
    limits = np.where(model.jnt_actfrclimited.astype(bool), np.abs(model.jnt_actfrcrange).max(axis=1), np.inf)
    at_joint = np.isin(model.actuator_trntype, _AT_JOINT)
    for joint in range(model.njnt):
        own = np.flatnonzero(at_joint & (model.actuator_trnid[:, 0] == joint))
        if len(own) and model.actuator_forcelimited[own].all():
            most = np.abs(model.actuator_forcerange[own]).max(axis=1) * np.abs(model.actuator_gear[own, 0])
            limits[joint] = min(limits[joint], float(most.sum()))
    return limits


def _sentence(error: BaseException) -> str:
    """The message of MuJoCo on one line."""
    return shown(" ".join(str(error).split()), 300) or type(error).__name__
