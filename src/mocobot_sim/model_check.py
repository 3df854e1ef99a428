"""Safety checks of model files before MuJoCo reads them, and of the files that a copy of a model includes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import prod
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from estimator.errors import InputError
from estimator.inputs import JSON_BYTES, open_input, printable, read_input

MOST_ELEMENTS, MOST_POINTS = 100_000, 1 << 24
"""Largest number of elements of a model, copies included, and of points of one height field or texture. Chosen."""
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_NAN = re.compile(r"(?<!\S)[-+]?nan(?!\S)", re.IGNORECASE)
_PNG = b"\x89PNG\r\n\x1a\n"


def check_model(path: Path) -> None:
    """Check that a model has a bounded size and that the files it names are regular files.

    Raises:
        InputError: a check fails, a file cannot be read, or the model is not well-formed XML.
    """
    _Check(path).run()


class _Check:
    def __init__(self, path: Path) -> None:
        self._path, self._todo, self._seen = path, [path], set[Path]()
        self._elements, self._copies = 0, [1]
        self._folders, self._named = {""}, set[str]()

    def run(self) -> None:
        while self._todo:
            file = self._todo.pop()
            if file.resolve() in self._seen:
                raise InputError(f"{self._path}: includes {file.name} twice")
            self._seen.add(file.resolve())
            parser = expat.ParserCreate()
            parser.StartElementHandler, parser.EndElementHandler = self._start, lambda _: self._copies.pop()
            parser.StartDoctypeDeclHandler = self._doctype
            try:
                parser.Parse(_COMMENT.sub(b"", read_input(file, JSON_BYTES)), True)
            except OSError as error:
                raise InputError(f"{file}: cannot be read ({error.strerror})") from error
            except expat.ExpatError as error:
                raise InputError(
                    f"{file}: not a readable MJCF or URDF, it is not well-formed XML ({error})"
                ) from error
        for file in sorted(self._places()):
            try:
                with open_input(file) as opened:
                    head = opened.read(24)
            except OSError as error:
                raise InputError(f"{self._path}: {file} cannot be read ({error.strerror})") from error
            if head.startswith(_PNG):
                size = int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")
                self._limit(prod(size), MOST_POINTS, f"{file} has", "pixels")

    def _start(self, tag: str, attributes: Mapping[str, str]) -> None:
        count = attributes.get("count", "") if tag in ("replicate", "composite", "flexcomp") else ""
        self._copies.append(self._copies[-1] * prod(map(_whole, count.split())))
        self._elements += self._copies[-1]
        what = f"{self._path}: <{tag} {attributes.get('name', ''):.60}>".replace(" >", ">")
        self._limit(self._elements, MOST_ELEMENTS, f"{what} makes", "elements of the model")
        for key, value in attributes.items():
            if key != "name" and _NAN.search(value):
                raise InputError(
                    f"{printable(what)} has {key} = {value!r:.80}; every number must be a finite one"
                )
        for rows, columns in (("nrow", "ncol"), ("width", "height")):
            if rows in attributes and columns in attributes:
                points = _whole(attributes[rows]) * _whole(attributes[columns])
                self._limit(points, MOST_POINTS, f"{what} has", "points")
        if tag == "size":
            for key in attributes.keys() - {"memory"}:
                self._limit(_whole(attributes[key]), MOST_POINTS, f"{what} has {key} of", "entries")
        files = [value for key, value in attributes.items() if key.startswith("file")]
        if tag in ("include", "model"):
            self._todo += [f for name in files if (f := self._path.parent / name).exists()]
        else:
            self._named.update(files)
            self._folders.update(value for key, value in attributes.items() if key.endswith("dir"))

    def _doctype(self, *_: object) -> None:
        raise InputError(f"{self._path}: declares a document type, which no model does")

    def _limit(self, count: int, most: int, what: str, of: str) -> None:
        if count > most:
            raise InputError(f"{printable(what)} {count:,} {of}; at most {most:,} are read")

    def _places(self) -> set[Path]:
        """Existing files that the model may refer to, in all of its asset folders."""
        named = {form for name in self._named for form in (name, name.rpartition("/")[2]) if form}
        places = (self._path.parent / folder / name for folder in self._folders for name in named)
        return {place for place in places if "\0" not in str(place) and place.exists() and not place.is_dir()}


def _whole(text: str) -> int:
    found = re.match(r"\s*\+?(\d+)", text)
    return max(int(found[1][:18]), 1) if found else 1


MODELS = (".xml", ".mjcf", ".urdf")
ASSETS = (".stl", ".obj", ".msh", ".skn", ".png", ".ktx")
"""Suffixes of meshes, skins, textures and height fields."""
_DIRECTORIES = ("assetdir", "meshdir", "texturedir")


def owned(named: Path, folder: Path, types: tuple[str, ...]) -> Path:
    """Resolve a file that a model names and check that it may be copied.

    Args:
        named: path of the file.
        folder: folder of the model.
        types: allowed suffixes.

    Raises:
        InputError: the file is not in or below the model's folder, or its suffix is not allowed.
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
    """Check that all files named by a model, which a copy would include, are in or below its folder.

    Args:
        path: path of the model; models that it includes are checked too.
        assets: whether to check meshes, skins, textures and height fields as well.

    Raises:
        InputError: a file lies outside the folder or has a wrong type, or a model cannot be parsed.
    """
    folder, models, places = path.parent, [path], {""}
    named: list[str] = []
    for model in models:  # the loop appends included models
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
