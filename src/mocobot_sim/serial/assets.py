"""Files that a model refers to, taken along where it is written anew."""

from __future__ import annotations

import shutil
from pathlib import Path

import mujoco

ASSETS = "assets"


def take_along(spec: mujoco.MjSpec, folder: Path) -> None:
    """Copy meshes, height fields, skins and textures into ``assets`` beside a model that is written anew.

    What is not found stays as it is named.

    Args:
        spec: the model as it was read from its file; changed.
        folder: where it is written to.

    Raises:
        OSError: a file cannot be read or written.
    """
    taken: dict[Path, str] = {}

    def moved(file: str, inside: str) -> str:
        source = _found(spec, file, inside)
        if source is None:
            return file
        if source not in taken:
            name = source.name if source.name not in taken.values() else f"{len(taken)}_{source.name}"
            (folder / ASSETS).mkdir(exist_ok=True)
            shutil.copyfile(source, folder / ASSETS / name)
            taken[source] = name
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
        spec.modelfiledir = str(folder.resolve())  # from where MuJoCo reads them when it writes the model


def _found(spec: mujoco.MjSpec, file: str, inside: str) -> Path | None:
    """A file that the model refers to, or None where there is none."""
    if not file:
        return None
    named = Path(file).name if spec.strippath else file
    path = Path(spec.modelfiledir, inside, named)  # an absolute one stands for itself
    return path.resolve() if path.is_file() else None
