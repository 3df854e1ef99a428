"""Files that a model refers to, taken along where it is written anew."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import mujoco

from mocobot_sim.scene.named_files import ASSETS as TYPES
from mocobot_sim.scene.named_files import owned

ASSETS = "assets"


def take_along(spec: mujoco.MjSpec) -> dict[Path, str]:
    """Name meshes, height fields, skins and textures by their place in ``assets`` beside a model that is written anew.

    What is not found stays as it is named.

    Args:
        spec: the model as it was read from its file; changed.

    Returns:
        The files, each with its name in ``assets``.

    Raises:
        InputError: a file is not the model's own (see ``owned``).
    """
    taken: dict[Path, str] = {}

    def moved(file: str, inside: str) -> str:
        named = Path(
            spec.modelfiledir, inside, Path(file).name if spec.strippath else file
        )  # an absolute one alone
        if not file or not named.is_file():
            return file
        source = owned(named, Path(spec.modelfiledir), TYPES)
        if source not in taken:
            taken[source] = (
                source.name if source.name not in taken.values() else f"{len(taken)}_{source.name}"
            )
        return taken[source]

    of = spec.compiler
    for element in (*spec.meshes, *spec.hfields, *spec.skins):
        element.file = moved(element.file, of.meshdir)
    for texture in spec.textures:
        texture.file = moved(texture.file, of.texturedir)
        for k, file in enumerate(texture.cubefiles):
            texture.cubefiles[k] = moved(file, of.texturedir)
    if taken:
        of.meshdir = of.texturedir = ASSETS
    return taken


def put(taken: Mapping[Path, str], spec: mujoco.MjSpec, folder: Path) -> None:
    """Copy what ``take_along`` found into the folder that the model is written to.

    Raises:
        OSError: a file cannot be read or written.
    """
    if taken:
        (folder / ASSETS).mkdir()
        spec.modelfiledir = str(folder.resolve())  # from where MuJoCo reads them when it writes the model
    for source, name in taken.items():
        shutil.copyfile(source, folder / ASSETS / name)
