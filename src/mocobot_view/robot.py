"""Drawing of one Omnid: shapes of its bodies, their motion from joint angles, and the bodies where causes act."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from discrepancy.result.read import NamedCause
from discrepancy.team.causes import CAUSES
from estimator.arm.delta import LEG_DIRECTIONS, leg_geometry
from estimator.arm.design import OmnidDesign
from estimator.arm.unit import Arms
from estimator.arrays import Array
from mocobot_sim.scene.models import base_height_m, models_dir, omnid_design, posed
from mocobot_view.shapes import Shape, body_shape

LEGS = (1, 2, 3)
GIMBAL = ("yoke", "ring", "flange")
TINTED = ("proximal1", "proximal2", "proximal3")
"""Bodies drawn in the colour of their robot, which its plots also use."""
PATHS: dict[str, str] = {
    **{f"proximal{k}": f"base/leg{k}/proximal" for k in LEGS},
    **{f"rod{k}": f"base/leg{k}/proximal/knee/rod" for k in LEGS},
    "platform": "base/platform",
    "yoke": "base/platform/yoke",
    "ring": "base/platform/yoke/ring",
    "flange": "base/platform/yoke/ring/flange",
}
"""Entity path of each moving body of the MJCF below its robot; all other bodies stand on the floor with the base.
Links and rods rotate in fixed frames: ``leg`` at the driven axis with x outward, ``knee`` at the end of the link."""


@dataclass(frozen=True)
class RobotShapes:
    """Shapes of one robot's bodies."""

    standing: Shape  # shape of chassis, wheels and base in {b}
    moving: dict[str, Shape]  # shapes of the bodies in ``PATHS`` in their body frames, by name
    base_height_m: float  # height of {b} over the floor [m]


@cache
def robot_shapes(design: OmnidDesign) -> RobotShapes:
    """Make the shapes of an Omnid with the lengths of a design."""
    model = mujoco.MjModel.from_xml_path(str(models_dir() / "omnid" / "omnid.xml"))
    fit_design(model, design)
    data = posed(model)
    base = model.body("base").id
    moving = {name: model.body(name).id for name in PATHS}
    standing = [b for b in range(1, model.nbody) if b not in moving.values()]
    frame = data.xpos[base].copy(), data.xmat[base].reshape(3, 3).copy()
    shapes = {name: body_shape(model, [body]) for name, body in moving.items()}
    stand = body_shape(model, standing, frame)
    assert stand is not None
    return RobotShapes(
        stand, {name: shape for name, shape in shapes.items() if shape is not None}, base_height_m()
    )


def fit_design(model: mujoco.MjModel, design: OmnidDesign, prefix: str = "") -> None:
    """Change the lengths of the shipped Omnid, whose names have a prefix, to those of another design, for drawing only.

    Masses and inertias do not change.
    """
    shipped = omnid_design()
    wider = design.base_radius_m - shipped.base_radius_m
    for k, u in zip(LEGS, LEG_DIRECTIONS, strict=True):
        model.body_pos[model.body(f"{prefix}proximal{k}").id] = design.base_radius_m * u
        model.body_pos[model.body(f"{prefix}rod{k}").id] = [design.proximal_length_m, 0.0, 0.0]
        model.geom_pos[model.geom(f"{prefix}actuator{k}").id] += wider * u
        for name, length in (
            (f"{prefix}proximal{k}", design.proximal_length_m),
            (f"{prefix}rod{k}", design.rod_length_m),
        ):
            geom = model.geom(name).id
            model.geom_pos[geom, 0] = model.geom_size[geom, 1] = 0.5 * length
    model.geom_size[model.geom(f"{prefix}base_plate").id, 0] += wider
    model.geom_size[model.geom(f"{prefix}platform").id, 0] += (
        design.platform_radius_m - shipped.platform_radius_m
    )


def fixed_frames(design: OmnidDesign) -> dict[str, tuple[Array, Array]]:
    """Return the fixed frames of ``PATHS`` by path: position [m], (3,), and quaternion (x, y, z, w) in the parent."""
    frames = {}
    for k, u in zip(LEGS, LEG_DIRECTIONS, strict=True):
        azimuth = 2.0 * np.pi * (k - 1) / 3.0
        outward = np.array([0.0, 0.0, np.sin(0.5 * azimuth), np.cos(0.5 * azimuth)])
        frames[f"base/leg{k}"] = design.base_radius_m * u, outward
        frames[f"base/leg{k}/proximal/knee"] = (
            np.array([design.proximal_length_m, 0.0, 0.0]),
            np.array([0.0, 0.0, 0.0, 1.0]),
        )
    return frames


@dataclass(frozen=True)
class BodyMotion:
    """Motion of the bodies of N robots at Q samples."""

    # positions of the platform in the frame of the arm, which equals {b} on a level base [m], (Q, N, 3)
    wrist: Array
    # quaternions (x, y, z, w) of the links, rods and gimbal bodies in their fixed frames, by name, shape (Q, N, 4)
    turns: dict[str, Array]


def body_motion(phi: Array, theta: Array, arms: Arms) -> BodyMotion:
    """Compute the motion of all bodies from true phi and (theta_z, theta_y, theta_x) [rad], shape (Q, N, 3) each.

    A link rotates by phi about its negative driven axis, the rod by Ry(swing) Rz(tilt) relative to the link. InputError
    if the rods do not meet at some sample.
    """
    wrist, swing, tilt = rod_angles(phi, arms)
    turns = {}
    for leg in LEGS:
        turns[f"proximal{leg}"] = _turned("Y", -phi[..., leg - 1])
        turns[f"rod{leg}"] = _turned("YZ", swing[..., leg - 1], tilt[..., leg - 1])
    for column, (name, axis) in enumerate(zip(GIMBAL, "ZYX", strict=True)):
        turns[name] = _turned(axis, theta[..., column])
    return BodyMotion(wrist, turns)


def rod_angles(phi: Array, arms: Arms) -> tuple[Array, Array, Array]:
    """Solve the forward kinematics of the arms from true driven angles [rad], shape (..., N, 3), as ``body_motion``.

    Returns wrist positions in the frames of the arms [m], and swing and tilt of each leg's rod relative to its link
    [rad], each of shape (..., N, 3). From the knee, the rod points in the direction Ry(swing) Rz(tilt) e_x = (cos swing
    cos tilt, sin tilt, -sin swing cos tilt) of the link's frame.
    """
    legs = leg_geometry(phi, arms)
    length = np.broadcast_to(np.asarray(arms.rod_length_m), legs.h.shape)[..., None]
    swing, tilt = np.empty_like(legs.h), np.empty_like(legs.h)
    for k, u in enumerate(LEG_DIRECTIONS):
        angle, rod = phi[..., k], legs.rod[..., k, :] / length[..., k, :]
        outward, aside, up = rod @ u, rod @ [-u[1], u[0], 0.0], rod[..., 2]
        x = np.cos(angle) * outward + np.sin(angle) * up
        z = np.cos(angle) * up - np.sin(angle) * outward
        swing[..., k], tilt[..., k] = np.arctan2(-z, x), np.arcsin(np.clip(aside, -1.0, 1.0))
    return legs.h, swing, tilt


def _turned(axes: str, *angles: Array) -> Array:
    """Return quaternions of successive rotations about body-fixed axes, shape (..., 4)."""
    rows = np.stack(angles, axis=-1)
    return Rotation.from_euler(axes, rows.reshape(-1, len(axes))).as_quat().reshape(*rows.shape[:-1], 4)


def by_place(causes: Iterable[NamedCause]) -> dict[tuple[int | None, str | None], list[NamedCause]]:
    """Group causes by robot (None for the payload) and by the body that ``body_of`` returns."""
    places: dict[tuple[int | None, str | None], list[NamedCause]] = {}
    for cause in causes:
        places.setdefault((cause.robot, body_of(cause)), []).append(cause)
    return places


def body_of(cause: NamedCause) -> str | None:
    """Return the body where a cause acts, such as ``proximal1``; None for the base or the payload."""
    at = CAUSES[cause.name].at if cause.name in CAUSES else None
    if cause.robot is not None and cause.joint is not None:
        return GIMBAL[cause.joint - 1] if at == "gimbal joint" else f"proximal{cause.joint}"
    return "flange" if cause.robot is not None and at == "grasp" else None
