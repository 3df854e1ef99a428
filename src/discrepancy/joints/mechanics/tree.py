"""The numbers of a fixed-base tree: frames, axes, inertial parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.arrays import Array


@dataclass(frozen=True, eq=False)
class Tree:
    """Bodies in an order in which parents come first; body 0 is the world. B bodies, J joints.

    Attributes:
        parent: of every body, shape (B,).
        position, rotation: of every body's frame in its parent's, all joints at ``zero``, shapes (B, 3), (B, 3, 3).
        joint_body: which body a joint moves, shape (J,).
        slides: whether it slides, shape (J,).
        anchor, axis: a point on the joint's axis and its direction, in the frame of its body, shapes (J, 3).
        zero: joint position at which the frames are as said, shape (J,).
        mass: shape (B,) [kg].
        com: centres of mass in the frames of their bodies, shape (B, 3) [m].
        inertia: about the centres of mass, along the bodies' frames, shape (B, 3, 3) [kg m^2].
        gravity: in the frame of the world, shape (3,) [m/s^2].
        armature: inertia of the rotors as the joints feel it, shape (J,).
        coulomb, viscous: dry friction [N m or N] and damping per rad/s or m/s of every joint, shape (J,).
    """

    parent: NDArray[np.intp]
    position: Array
    rotation: Array
    joint_body: NDArray[np.intp]
    slides: NDArray[np.bool_]
    anchor: Array
    axis: Array
    zero: Array
    mass: Array
    com: Array
    inertia: Array
    gravity: Array
    armature: Array
    coulomb: Array
    viscous: Array

    @classmethod
    def of(cls, model: Any) -> Tree:
        """From a compiled ``mujoco.MjModel`` of hinges and slides."""
        own = _rotations(model.body_iquat)
        return cls(
            parent=np.asarray(model.body_parentid, dtype=np.intp),
            position=np.array(model.body_pos),
            rotation=_rotations(model.body_quat),
            joint_body=np.asarray(model.jnt_bodyid, dtype=np.intp),
            slides=np.asarray(model.jnt_type) == 2,  # mjJNT_SLIDE
            anchor=np.array(model.jnt_pos),
            axis=np.array(model.jnt_axis),
            zero=np.array(model.qpos0),
            mass=np.array(model.body_mass),
            com=np.array(model.body_ipos),
            inertia=own @ (model.body_inertia[:, :, None] * own.swapaxes(1, 2)),
            gravity=np.array(model.opt.gravity),
            armature=np.array(model.dof_armature),
            coulomb=np.array(model.dof_frictionloss),
            viscous=np.array(model.dof_damping),
        )

    @property
    def moved(self) -> NDArray[np.bool_]:
        """Which joints move which bodies, shape (J, B)."""
        out = np.zeros((len(self.joint_body), len(self.parent)), dtype=bool)
        for b in range(1, len(self.parent)):
            out[:, b] = out[:, self.parent[b]] | (self.joint_body == b)
        return out

    @property
    def last_link(self) -> int:
        """The joint that moves the last link: the one with the longest way to the base."""
        ways = self.moved[:, self.joint_body].sum(axis=0)
        return int(np.flatnonzero(ways == ways.max())[-1])

    @property
    def links(self) -> NDArray[np.intp]:
        """Bodies that move and have mass: those whose inertias can show."""
        return np.flatnonzero(self.moved.any(axis=0) & (self.mass > 0))


def _rotations(quaternions: Array) -> Array:
    """Rotation matrices of quaternions (w, x, y, z), shape (B, 4) -> (B, 3, 3)."""
    return np.asarray(Rotation.from_quat(quaternions, scalar_first=True).as_matrix())
