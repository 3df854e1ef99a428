"""Files that a model names: only those of its kind at or below its folder leave with a copy of it."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from estimator.errors import InputError

MODELS = (".xml", ".mjcf", ".urdf")
ASSETS = (".stl", ".obj", ".msh", ".skn", ".png", ".ktx")
"""Meshes, skins, textures and height fields."""
_DIRECTORIES = ("assetdir", "meshdir", "texturedir")


def owned(named: Path, folder: Path, types: tuple[str, ...]) -> Path:
    """The file that a model names, links resolved.

    Raises:
        InputError: it is not at or below the model's folder, or of another type.
    """
    source = named.resolve()
    if not source.is_relative_to(folder.resolve()):
        raise InputError(
            f"{str(named)!r:.200} lies outside the model's folder {folder}; a copy of the model takes nothing else"
        )
    if source.suffix.lower() not in types:
        raise InputError(
            f"{str(named)!r:.200}: a copy of the model takes only files of the types {', '.join(types)}"
        )
    return source


def check_named(path: Path, *, assets: bool) -> None:
    """Refuse a model into a copy of which files would go that are not its own.

    Args:
        path: of a model that can be read.
        assets: whether to look at meshes, skins, textures and height fields, too, and not only at further models.

    Raises:
        InputError: it names such a file, or what it names cannot be told.
    """
    folder, models, places = path.parent, [path], {""}
    named: list[str] = []
    for model in models:  # grows
        for element in _elements(model):
            places |= {element.get(kind, "") for kind in _DIRECTORIES}
            files = [value for key, value in element.items() if key.startswith("file")]
            if element.tag not in ("include", "model"):
                named += files
                continue
            for inner in (above / file for above in (folder, model.parent) for file in files):
                if inner.is_file() and owned(inner, folder, MODELS) not in models:
                    models.append(inner.resolve())
    for file in named if assets else ():
        for above in (folder / place for place in places):
            if (above / file).is_file():
                owned(above / file, folder, ASSETS)


def _elements(model: Path) -> Iterator[ElementTree.Element]:
    try:
        content = model.read_bytes()
        if b"<!ENTITY" in content:
            raise ValueError("it defines entities")
        return ElementTree.fromstring(content).iter()
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise InputError(f"{model}: what it includes cannot be told ({error})") from error
