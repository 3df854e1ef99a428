"""Read a robot's file as an editable ``MjSpec`` that inverse dynamics can use, and say what was read otherwise."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.inputs import JSON_BYTES, read_input
from mocobot_logs.formats import shown
from mocobot_sim.model_check import check_model
from mocobot_sim.serial.mjcf import set_inertial

ERRORS = (ValueError, RuntimeError, OSError, UserWarning)
"""What MuJoCo raises for a file that it cannot use; a warning is one of a singular inertia matrix."""
LEAST_KG, LEAST_KGM2 = 1e-9, 1e-12
"""Mass and inertia of a moving link without any, since MuJoCo demands some. Chosen: 1e-8 N of weight."""
_COMMENT, _TAG = re.compile(rb"<!--.*?-->", re.DOTALL), re.compile(rb"<([A-Za-z_][^\s/>]*)")


@dataclass(frozen=True, eq=False)
class Read:
    """A model as read from its file.

    Attributes:
        spec: a model that compiles.
        notes: sentences on what differs from the file.
        exact: principal moments [kg m^2] in the file of bodies whose inertia MuJoCo refuses, by name, ascending, shape
            (3,): no body can have them, but inverse dynamics can be computed with them.
    """

    spec: mujoco.MjSpec
    notes: list[str] = field(default_factory=list)
    exact: dict[str, Array] = field(default_factory=dict)


def read_spec(path: Path) -> Read:
    """Read a model that compiles, without its meshes if it does not compile with them.

    A URDF's links have the mass that their ``inertial`` states, and none without one. Gravity acts on all bodies.

    Raises:
        InputError: MuJoCo cannot read or compile the file.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; a model is an MJCF or URDF file")
    check_model(path)
    text = _COMMENT.sub(b"", read_input(path, JSON_BYTES))
    root, said = _TAG.search(text), ""
    if b"<xacro:" in text:
        raise InputError(
            f"{path}: is a xacro file; make a URDF of it: ros2 run xacro xacro {shlex.quote(str(path))} > robot.urdf"
        )
    for bare in (False, True):
        try:
            read = Read(mujoco.MjSpec.from_file(str(path)))
            spec = read.spec
            if root is not None and root[1] == b"robot":
                read.notes.extend(_as_urdf_says(spec, path, read.exact))
        except InputError:
            raise
        except ERRORS as error:  # a name that occurs twice shows when a URDF's bodies are visited
            raise InputError(
                f"{path}: MuJoCo cannot read it ({sentence(error)}); correct the file there"
            ) from error
        if bare:
            body = _body_of_meshes(spec)
            if body is not None:
                raise InputError(
                    f"{path}: MuJoCo cannot compile it ({said}); without its meshes: the inertia of {body} would be "
                    "another (give the body an inertial)"
                )
            _drop_meshes(spec)
        read.notes.extend(_with_gravity(spec))
        try:
            spec.compile()
            _name(spec)
            return read
        except ERRORS as error:
            said += f"; without its meshes: {sentence(error)}" if bare else sentence(error)
            if bare or not spec.meshes:
                raise InputError(f"{path}: MuJoCo cannot compile it ({said})") from error
    raise AssertionError


def _as_urdf_says(spec: mujoco.MjSpec, path: Path, exact: dict[str, Array]) -> Iterable[str]:
    """Give every link the mass and inertia of its ``inertial``, which MuJoCo takes from shapes or refuses."""
    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        return
    said: dict[str, list[str]] = {}
    for body in spec.bodies[1:]:
        for geom in body.geoms:
            geom.mass = 0.0
        if not (body.explicitinertial and body.mass > 0):
            if body.joints:
                said.setdefault("Links that move without an <inertial> are read without mass", []).append(
                    body.name
                )
                set_inertial(body, LEAST_KG, np.zeros(3), LEAST_KGM2 * np.eye(3))
            continue
        xx, yy, zz, xy, xz, yz = body.fullinertia
        full = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        matrix = np.diag(body.inertia) if np.isnan(xx) else full
        if not np.isfinite(matrix).all():
            raise InputError(f"{path}: link {body.name} has an inertia that is not finite; correct it there")
        moments = np.linalg.eigvalsh(matrix)
        if moments[0] >= LEAST_KGM2 and moments[0] + moments[1] >= moments[2]:
            continue
        own = Rotation.from_quat(body.iquat, scalar_first=True).as_matrix()
        set_inertial(body, body.mass, np.array(body.ipos), own @ matrix @ own.T)
        body.inertia = np.maximum(body.inertia, LEAST_KGM2)
        what, name = "Links with a mass and no inertia are read as points", body.name
        if moments.any():
            what = "Links with an inertia that no body has are read with the nearest possible one"
            name = f"{name} ({', '.join(f'{x:.3g}' for x in moments)} kg m^2)"
        if moments[0] >= LEAST_KGM2 and body.joints:  # MuJoCo fuses the others with what carries them
            what = "Links have an inertia that no body has; torques are computed with it, simulations with the nearest"
            exact[body.name] = moments
        if _moves(body):
            said.setdefault(what, []).append(name)
    if not any(b.mass > LEAST_KG and _moves(b) for b in spec.bodies[1:]) and any(
        b.joints for b in spec.bodies
    ):
        raise InputError(f"{path}: no link that moves has a mass; give the links their <inertial>")
    yield from (f"{what}: {', '.join(links)}." for what, links in said.items())


def _with_gravity(spec: mujoco.MjSpec) -> Iterable[str]:
    """Switch off ``gravcomp``, which the drives of a real robot do not have."""
    bodies = [body for body in spec.bodies[1:] if body.gravcomp]
    shares = sorted({float(body.gravcomp) for body in bodies})
    for body in bodies:
        body.gravcomp = 0.0
    if bodies:
        share = " to ".join(dict.fromkeys(f"{100.0 * x:.3g} %" for x in (shares[0], shares[-1])))
        names = ", ".join(body.name or "a body without a name" for body in bodies)
        yield (
            f"The file cancels {share} of gravity by gravcomp on {names:.300}, an aid of simulations; it is read "
            "without, so that the drives carry the weight."
        )


def _name(spec: mujoco.MjSpec) -> None:
    """Give every body and joint a name, because findings refer to bodies and maps to joints by name."""
    taken = {body.name for body in spec.bodies}
    for k, body in enumerate(spec.bodies):
        if not body.name:
            joint = body.joints[0].name if body.joints else ""
            name = f"link of {joint}" if joint else f"body {k}"
            body.name = f"{name} ({k})" if name in taken else name
            taken.add(body.name)
    for k, joint in enumerate(spec.joints, start=1):
        joint.name = joint.name or f"joint {k} of {joint.parent.name}"


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


def _drop_meshes(spec: mujoco.MjSpec) -> None:
    """Delete meshes and the geoms that use them."""
    for geom in [geom for geom in spec.geoms if geom.meshname]:
        spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)


def sentence(error: BaseException) -> str:
    """The message of MuJoCo on one line."""
    return shown(" ".join(str(error).split()), 300) or type(error).__name__
