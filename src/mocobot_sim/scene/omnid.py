"""One Omnid in MJCF: loaded, parked, put where it stands (PyMJCF)."""

from typing import Any

from numpy.typing import ArrayLike

from mocobot_sim.base.design import WHEELS
from mocobot_sim.base.rollers import BASE_JOINTS
from mocobot_sim.scene.model_files import models_dir
from mocobot_sim.scene.pymjcf import mjcf


def load_omnid(number: int) -> "mjcf.RootElement":
    """The shipped model, its names prefixed with ``omnid{number}/`` when it is attached."""
    omnid = mjcf.from_path(str(models_dir() / "omnid" / "omnid.xml"))
    omnid.model = f"omnid{number}"
    return omnid


def stand(root: "mjcf.RootElement", omnid: "mjcf.RootElement", place: ArrayLike, quat: ArrayLike) -> Any:
    """Attach an Omnid to a scene and return its frame.

    Args:
        root: the scene.
        omnid: the robot.
        place, quat: of its floor mount in the world [m], shapes (3,) and (4,), w first.
    """
    name = omnid.model.replace("omnid", "mount")
    return root.worldbody.add("site", name=name, group=4, pos=place, quat=quat).attach(omnid)


def park(omnid: "mjcf.RootElement") -> None:
    """Lock base and wheels to the floor, exactly and at no cost: a parked joint is one that is not there."""
    for name in (*BASE_JOINTS, *(f"wheel_{wheel}" for wheel in WHEELS)):
        omnid.find("joint", name).remove()
