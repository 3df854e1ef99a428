"""Masses and inertias of a body, written over whatever way its model gives them in."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from estimator.arrays import Array

LEAST_MOMENT = 1e-3
"""Of a body's largest second moment of mass, the least that it has in any direction. Chosen: a thin sheet's."""
_POSSIBLE = 1e-9
"""Relative; by so much may an inertia be off one that a body can have: rounding of the model's own numbers."""


def set_inertial(body: mujoco.MjsBody, mass: float, centre: Array, inertia: Array) -> None:
    """Give a body mass, centre and inertia in place of its own.

    Args:
        body: of the model, changed in place.
        mass: [kg].
        centre: of mass, in the body's frame [m], shape (3,).
        inertia: about that centre, along the body's frame [kg m^2], shape (3, 3); as near as a body can have it.
    """
    moments, axes = np.linalg.eigh(possible_inertia(inertia))
    axes = axes * [1.0, 1.0, np.sign(np.linalg.det(axes))]
    body.mass, body.ipos, body.inertia = mass, centre, moments
    body.iquat = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    # MuJoCo refuses two ways of giving an orientation or an inertia beside each other.
    body.ialt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.fullinertia = np.full(6, np.nan)
    body.explicitinertial = True


def keep_inertials(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Fix all bodies at what the model was compiled to, if its compiler would change what is put into it.

    Settings that take inertias from shapes whatever is written, scale the total mass or raise small ones would undo a
    cause, or pass it on to every other body.

    Args:
        spec: the model, changed in place.
        model: what it compiles to.
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
    """Mass [kg], centre [m] and inertia about it [kg m^2] of a compiled body, along its frame."""
    own = Rotation.from_quat(model.body_iquat[body], scalar_first=True).as_matrix()
    inertia = own @ np.diag(model.body_inertia[body]) @ own.T
    return float(model.body_mass[body]), np.array(model.body_ipos[body]), inertia


def possible_inertia(inertia: Array) -> Array:
    """An inertia as it is where a body can have it, else the nearest that one can, shape (3, 3)."""
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] >= 0.0 and moments[0] + moments[1] >= moments[2] * (1.0 - _POSSIBLE):
        return inertia
    return real_inertia(inertia)


def real_inertia(inertia: Array) -> Array:
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
