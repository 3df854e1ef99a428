"""One Omnid in PyMJCF: load it, park or release it, and attach it to a scene.

A released Omnid stands on four mecanum wheels with free rollers, which are ellipsoids of revolution about their axles.
Seen along the wheel's axle, a roller with half axes (l, r, r) at the angle t from straight down reaches below the
wheel's centre by

    (R - r) cos t + sqrt(r^2 + (l^2 - r^2) sin(a)^2 sin(t)^2)

where R is the wheel radius and a the roller angle. A wheel with twelve rollers is round within 0.09 mm.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.base.design import HAND, WHEELS, BaseDesign
from mocobot_sim.scene.models import models_dir
from mocobot_sim.scene.pymjcf import mjcf

BASE_JOINTS = ("base_x", "base_y", "base_yaw")
# Half width of the drawn hub of a wheel [m]. Chosen: for display only.
HUB_HALF_WIDTH_M = 0.018
# Stiffness of friction relative to the normal contact. Chosen: MuJoCo's friction creeps under load, with this ratio by
# micrometres per second (docs/base.md).
FRICTION_RATIO = 100.0
CONTACT_SOLIMP = [0.9, 0.95, 0.001, 0.5, 2.0]  # MuJoCo's default
# Contact bit of floor and rollers, so that they touch only each other, whatever bits the geoms of a payload have.
FLOOR_BIT = 1 << 10


def wheel_reach(design: BaseDesign, angle: ArrayLike) -> Array:
    """Height of the wheel's centre above the floor when a given roller touches it [m], shape (...).

    ``angle`` is the angle of the roller's middle from straight down about the wheel's axle [rad], shape (...).
    """
    t = np.asarray(angle, dtype=float)
    r, half = design.roller_radius_m, design.roller_half_length_m
    lift = (half**2 - r**2) * np.sin(design.roller_angle_rad) ** 2 * np.sin(t) ** 2
    return (design.wheel_radius_m - r) * np.cos(t) + np.sqrt(r**2 + lift)


def release(omnid: mjcf.RootElement, design: BaseDesign) -> None:
    """Add rollers and motors to the wheels of an Omnid and remove its planar joints.

    Mass and inertia of each wheel stay unchanged. The caller must add a free joint to the frame with which the robot is
    attached.

    Raises:
        InputError: the rollers are heavier than the wheel.
    """
    for name in BASE_JOINTS:
        omnid.find("joint", name).remove()
    for wheel, hand in zip(WHEELS, HAND, strict=True):
        name = f"wheel_{wheel}"
        hub = omnid.find("body", name)
        # Shrink the cylinder to a hub, for display.
        radius = design.wheel_radius_m - 1.8 * design.roller_radius_m
        omnid.find("geom", name).size = [radius, HUB_HALF_WIDTH_M]
        inertia = np.array(hub.inertial.diaginertia)
        for k in range(design.rollers):
            angle = 2.0 * np.pi * k / design.rollers
            inertia -= _add_roller(hub, f"{name}_roller{k + 1}", angle, hand, design)
        hub.inertial.mass = hub.inertial.mass - design.rollers * design.roller_mass_kg
        if not (hub.inertial.mass > 0 and (inertia > 0).all() and 2.0 * inertia.max() < inertia.sum()):
            raise InputError(
                f"base design: {design.rollers} rollers of {design.roller_mass_kg:g} kg leave no hub in a wheel of "
                f"{hub.inertial.mass + design.rollers * design.roller_mass_kg:g} kg"
            )
        hub.inertial.diaginertia = inertia
        limit = design.drive_torque_limit_Nm
        omnid.actuator.add(
            "motor", name=f"drive_{wheel}", joint=omnid.find("joint", name), ctrlrange=[-limit, limit]
        )


def rough_floor(root: mjcf.RootElement, design: BaseDesign) -> None:
    """Enable contact between rollers and floor, with elliptic friction cones."""
    root.option.flag.contact = "enable"
    root.option.cone, root.option.impratio = "elliptic", FRICTION_RATIO
    floor = root.find("geom", "floor")
    floor.contype, floor.conaffinity = FLOOR_BIT, 0
    floor.priority, floor.condim = 1, 3
    floor.friction = [design.friction, 0.005, 0.0001]
    floor.solref, floor.solimp = [design.contact_time_s, 1.0], CONTACT_SOLIMP


def _add_roller(hub: Any, name: str, angle: float, hand: float, design: BaseDesign) -> Array:
    """Add a roller at ``angle`` [rad] from straight down; return its moments of inertia about the hub's axes."""
    mass, r, half = design.roller_mass_kg, design.roller_radius_m, design.roller_half_length_m
    sin, cos = np.sin(design.roller_angle_rad), np.cos(design.roller_angle_rad)
    outward = np.array([-np.sin(angle), 0.0, -np.cos(angle)])
    axle = np.array([sin * np.cos(angle), hand * cos, -sin * np.sin(angle)])
    at = (design.wheel_radius_m - r) * outward
    # Moments of a solid ellipsoid.
    along, across = mass * 2.0 * r**2 / 5.0, mass * (half**2 + r**2) / 5.0
    roller = hub.add("body", name=name, pos=at, zaxis=axle)
    damping = design.roller_damping_Nms_per_rad
    roller.add("joint", name=name, type="hinge", axis=[0.0, 0.0, 1.0], damping=damping, armature=0.0)
    roller.add("inertial", pos=[0.0, 0.0, 0.0], mass=mass, diaginertia=[across, across, along])
    roller.add(
        "geom", name=name, type="ellipsoid", size=[r, r, half], contype=0, conaffinity=FLOOR_BIT,
        rgba=[0.24, 0.25, 0.28, 1.0],
    )  # fmt: skip
    own = across * (1.0 - axle**2) + along * axle**2
    return own + mass * (at @ at - at**2)


def load_omnid(number: int) -> mjcf.RootElement:
    """Load the shipped Omnid; attached to a scene, its names have the prefix ``omnid{number}/``."""
    omnid = mjcf.from_path(str(models_dir() / "omnid" / "omnid.xml"))
    omnid.model = f"omnid{number}"
    return omnid


def stand(root: mjcf.RootElement, omnid: mjcf.RootElement, place: ArrayLike, quat: ArrayLike) -> Any:
    """Attach an Omnid to a scene at a position [m], shape (3,), and quaternion (w first); return its frame."""
    name = omnid.model.replace("omnid", "mount")
    return root.worldbody.add("site", name=name, group=4, pos=place, quat=quat).attach(omnid)


def park(omnid: mjcf.RootElement) -> None:
    """Fix base and wheels of an Omnid to the floor by removing their joints."""
    for name in (*BASE_JOINTS, *(f"wheel_{wheel}" for wheel in WHEELS)):
        omnid.find("joint", name).remove()
