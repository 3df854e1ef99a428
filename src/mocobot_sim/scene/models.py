"""Shipped models and their design parameters, without loading MuJoCo; path of the truth beside a recording."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from estimator.errors import InputError

if TYPE_CHECKING:
    import mujoco

    from estimator.arm.design import OmnidDesign
    from estimator.arrays import Array

GIMBAL_AXES = ("z", "y", "x")
"""Axes of gimbal joints 1, 2, 3."""


@cache
def models_dir() -> Path:
    """Folder with ``omnid`` and ``payload_*``, in the repository or in an installed wheel.

    Raises:
        FileNotFoundError: the installation has no models.
    """
    here = Path(__file__).resolve()
    for folder in (here.parents[1] / "mjcf", here.parents[3] / "models"):
        if (folder / "omnid" / "omnid.xml").is_file():
            return folder
    raise FileNotFoundError("the mocobot models are missing from this installation")


def payload_names() -> list[str]:
    """Names of the shipped payloads, such as ``a``."""
    return sorted(path.name.removeprefix("payload_") for path in models_dir().glob("payload_*"))


RIGID = ("a", "b", "c", "d")
"""Shipped payloads of one body."""


def payload_path(name: str, *, rigid: bool = False) -> Path:
    """Path of the MJCF file of a shipped payload, with ``rigid`` of one body.

    Raises:
        InputError: there is no such payload of that name.
    """
    names = RIGID if rigid else payload_names()
    if name not in names:
        what = "has two bodies" if name in payload_names() else "does not exist"
        raise InputError(f"payload {name!r} {what}; the payloads are {', '.join(names)}")
    return models_dir() / f"payload_{name}" / "payload.xml"


@cache
def omnid_design() -> OmnidDesign:
    """Design parameters of the shipped Omnid."""
    from estimator.arm.design import load_design

    return load_design(models_dir() / "omnid" / "design.toml")


@cache
def base_height_m() -> float:
    """Height of {b} above the floor mount of an Omnid [m]; the axes of both frames are parallel."""
    import mujoco  # here, because only this value needs the model

    model = mujoco.MjModel.from_xml_path(str(models_dir() / "omnid" / "omnid.xml"))
    return float(posed(model).body("base").xpos[2])


def posed(model: mujoco.MjModel, qpos: Array | None = None) -> mujoco.MjData:
    """Make MuJoCo data with all poses computed at ``qpos``, shape (nq,); None for ``qpos0``."""
    import mujoco

    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    return data


def truth_path(recording: Path) -> Path:
    """Path of the ground truth of a recording: ``rec.truth.json`` for ``rec.parquet``."""
    return recording.with_suffix(".truth.json")
