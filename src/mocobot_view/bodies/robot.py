"""One Omnid to look at: its bodies' shapes, taken from the MJCF and adapted to a recording's design."""

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np

from estimator.arm.delta import LEG_DIRECTIONS
from estimator.arm.design import OmnidDesign
from estimator.arrays import Array
from mocobot_sim.scene.models import base_height_m, models_dir, omnid_design, posed
from mocobot_view.bodies.shapes import Shape, body_shape

LEGS = (1, 2, 3)
GIMBAL = ("yoke", "ring", "flange")
TINTED = ("proximal1", "proximal2", "proximal3")
"""Bodies drawn in their robot's colour, which its series have, too."""
PATHS: dict[str, str] = {
    **{f"proximal{k}": f"base/leg{k}/proximal" for k in LEGS},
    **{f"rod{k}": f"base/leg{k}/proximal/knee/rod" for k in LEGS},
    "platform": "base/platform",
    "yoke": "base/platform/yoke",
    "ring": "base/platform/yoke/ring",
    "flange": "base/platform/yoke/ring/flange",
}
"""Where each moving body of the MJCF is below its robot. The rest stands on the floor with the base. Links and rods
turn in frames of their own: ``leg`` at the driven axis with x outward, ``knee`` at the link's end."""


@dataclass(frozen=True)
class RobotShapes:
    """Shapes of one robot's bodies.

    Attributes:
        standing: chassis, wheels and base, in {b}.
        moving: shapes of the bodies in ``PATHS``, in their body frames.
        base_height_m: height of {b} over the floor [m].
    """

    standing: Shape
    moving: dict[str, Shape]
    base_height_m: float


@cache
def robot_shapes(design: OmnidDesign) -> RobotShapes:
    """The Omnid with a design's lengths."""
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
    """Stretch links, plates and driven axes of the shipped Omnid to another design, for the eye: no mass changes.

    Args:
        model: a model that holds the shipped Omnid.
        design: the lengths it shall have.
        prefix: of the Omnid's names in the model.
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
    """Frames of ``PATHS`` that do not move in their parents: position [m] (3,) and quaternion (x, y, z, w), by path."""
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
