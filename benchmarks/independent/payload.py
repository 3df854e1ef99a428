"""A payload's numbers from its MJCF, and the wrench that its motion takes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from independent.numerics import Array, derivative
from independent.rotations import back_turned, turned

MODELS = Path(__file__).parents[2] / "models"


@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body with grasps, in its frame {1}.

    Attributes:
        mass_kg: mass [kg].
        p_1c: centre of mass [m], shape (3,).
        inertia: about the centre of mass, axes of {1} [kg m^2], shape (3, 3).
        p_1i: grasps [m], shape (N, 3).
        R_1i: their axes, shape (N, 3, 3).
    """

    mass_kg: float
    p_1c: Array
    inertia: Array
    p_1i: Array
    R_1i: Array


@cache
def load_payload(name: str) -> Payload:
    """Payload a, b, c or d. MuJoCo only reads the numbers out of the file."""
    file = MODELS / f"payload_{name}" / "payload.xml"
    model = mujoco.MjModel.from_xml_path(str(file))  # pyright: ignore[reportAttributeAccessIssue]
    body = model.body("payload")
    axes = _matrix(body.iquat)
    grasps = [model.site(f"grasp{i}") for i in (1, 2, 3)]
    return Payload(
        mass_kg=float(body.mass[0]),
        p_1c=np.array(body.ipos),
        inertia=axes @ np.diag(body.inertia) @ axes.T,
        p_1i=np.array([site.pos for site in grasps]),
        R_1i=np.array([_matrix(site.quat) for site in grasps]),
    )


def needed_wrench(
    payload: Payload, R_W1: Array, omega: Array, acceleration: Array, gravity: Array
) -> tuple[Array, Array]:
    """What has to act on the payload besides its weight, by Newton and Euler.

    Args:
        payload: the body.
        R_W1: its orientation, shape (Q, 3, 3).
        omega: its angular velocity in W [rad/s], shape (Q, 3).
        acceleration: of its centre of mass in W [m/s^2], shape (Q, 3).
        gravity: in W [m/s^2], shape (3,).

    Returns:
        Force [N] and moment about the centre of mass [N m], in W, shape (Q, 3) each.
    """
    momentum = turned(R_W1, back_turned(R_W1, omega) @ payload.inertia)
    return payload.mass_kg * (acceleration - gravity), derivative(momentum)


def _matrix(quaternion: Array) -> Array:
    return Rotation.from_quat(np.asarray(quaternion), scalar_first=True).as_matrix()
