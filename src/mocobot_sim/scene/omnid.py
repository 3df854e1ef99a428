"""One Omnid in MJCF: loaded, parked, off its design, put where it stands (PyMJCF)."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mocobot_sim.base.design import WHEELS
from mocobot_sim.base.rollers import BASE_JOINTS
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.models import models_dir, omnid_design
from mocobot_sim.scene.pymjcf import mjcf

WRIST_BODIES = ("platform", "yoke", "ring", "flange")
"""What translates with the wrist."""


def load_omnid(number: int) -> mjcf.RootElement:
    """The shipped model, its names prefixed with ``omnid{number}/`` when it is attached."""
    omnid = mjcf.from_path(str(models_dir() / "omnid" / "omnid.xml"))
    omnid.model = f"omnid{number}"
    return omnid


def stand(root: mjcf.RootElement, omnid: mjcf.RootElement, place: ArrayLike, quat: ArrayLike) -> Any:
    """Attach an Omnid to a scene and return its frame.

    Args:
        root: the scene.
        omnid: the robot.
        place, quat: of its floor mount in the world [m], shapes (3,) and (4,), w first.
    """
    name = omnid.model.replace("omnid", "mount")
    return root.worldbody.add("site", name=name, group=4, pos=place, quat=quat).attach(omnid)


def park(omnid: mjcf.RootElement) -> None:
    """Lock base and wheels to the floor, exactly and at no cost: a parked joint is one that is not there."""
    for name in (*BASE_JOINTS, *(f"wheel_{wheel}" for wheel in WHEELS)):
        omnid.find("joint", name).remove()


def deviate(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Move one unit's geometry, springs and masses off their design values."""
    deviate_geometry(omnid, unit)
    _deviate_masses(omnid, unit)
    for k in range(3):
        spring = omnid.find("joint", f"spring{k + 1}")
        spring.stiffness = omnid_design().sea_stiffness_Nm_per_rad * (1.0 + unit.stiffness_ratio[k])


def deviate_geometry(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Move one unit's geometry by what ``unit`` says, on top of what it is."""
    for k in range(3):
        azimuth = 2.0 * np.pi * k / 3.0
        u = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        proximal = omnid.find("body", f"proximal{k + 1}")
        proximal.pos = proximal.pos + unit.base_radius_m[k] * u
        rod = omnid.find("body", f"rod{k + 1}")
        rod.pos = rod.pos + np.array([unit.proximal_length_m[k], 0.0, 0.0])
        tip = omnid.find("site", f"rod{k + 1}_tip")
        if unit.rod_length_m[k]:  # a longer rod has its mass along all of it
            grown = 1.0 + unit.rod_length_m[k] / tip.pos[0]
            rod.inertial.pos = rod.inertial.pos * grown
            rod.inertial.diaginertia = rod.inertial.diaginertia * np.array([1.0, grown**2, grown**2])
        tip.pos = tip.pos + np.array([unit.rod_length_m[k], 0.0, 0.0])
        platform = omnid.find("site", f"platform{k + 1}")
        platform.pos = platform.pos + unit.platform_radius_m[k] * u


def _deviate_masses(omnid: mjcf.RootElement, unit: AsBuilt) -> None:
    """Scale mass and inertia of the arm's bodies together, as denser or thicker parts would."""
    ratios = {f"proximal{k + 1}": unit.proximal_mass_ratio[k] for k in range(3)}
    ratios |= {f"rod{k + 1}": unit.rod_mass_ratio[k] for k in range(3)}
    ratios |= dict.fromkeys(WRIST_BODIES, unit.wrist_mass_ratio)
    for body, ratio in ratios.items():
        if ratio:  # a design's own numbers keep their bits
            inertial = omnid.find("body", body).inertial
            inertial.mass = inertial.mass * (1.0 + ratio)
            inertial.diaginertia = inertial.diaginertia * (1.0 + ratio)
