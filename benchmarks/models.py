"""How many of the robots that packages bring are read: `python benchmarks/models.py FOLDER...`, a row for each folder;
`-v` prints the advice that was followed, too.

A file counts if it has an actuated chain: a MJCF with actuators and hinges or slides, or a URDF with joints that move.
A refused file is tried again with what its refusal says to type, at most ``TRIES`` times.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from discrepancy.joints.model import load_model
from estimator.errors import InputError

TRIES = 2
"""Most rounds of advice that are followed. Chosen: a floating base, then the joints of a loop."""
ADVICE = re.compile(r"--(lock|base) ('[^']*'|[^\s;,)]+)")


def elements(path: Path, depth: int = 0) -> Iterator[ElementTree.Element]:
    """Elements of a model and of the files that it includes."""
    for element in ElementTree.parse(path).iter():
        yield element
        inner = path.parent / element.get("file", "")
        if element.tag == "include" and inner.is_file() and depth < 4:
            yield from elements(inner, depth + 1)


def has_chain(path: Path) -> bool:
    """Whether a file is a robot with an actuated chain."""
    try:
        every = list(elements(path))
    except (ElementTree.ParseError, OSError, ValueError):
        return False
    if every[0].tag == "robot":
        return any(
            e.get("type") in ("revolute", "continuous", "prismatic") for e in every if e.tag == "joint"
        )
    if every[0].tag != "mujoco":
        return False
    bodies = [joint for e in every if e.tag == "body" for joint in e.findall("joint")]
    moves = any(joint.get("type", "hinge") in ("hinge", "slide") for joint in bodies)
    return moves and any(len(e) for e in every if e.tag == "actuator")


def tried(path: Path) -> tuple[int, str]:
    """Rounds of advice until a file was read, -1 if it was not, and the last refusal."""
    given: dict[str, object] = {"lock": (), "base": None}
    said = ""
    for number in range(TRIES + 1):
        try:
            load_model(path, **given)
            return number, said
        except InputError as error:
            said = str(error)
        asked = [(kind, shlex.split(text)[0]) for kind, text in ADVICE.findall(said)]
        if not asked:
            break
        given["lock"] = (*given["lock"], *(text for kind, text in asked if kind == "lock"))
        given["base"] = next((text for kind, text in asked if kind == "base"), given["base"])
    return -1, said


def main() -> None:
    """Print the table, and each refusal."""
    print("folder | files | with a chain | read as is | after advice | refused")
    for folder in (Path(name) for name in sys.argv[1:] if name != "-v"):
        files = sorted(
            p for p in folder.rglob("*") if p.suffix.lower() in (".xml", ".urdf", ".mjcf") and p.is_file()
        )
        robots = [path for path in files if has_chain(path)]
        found = {path: tried(path) for path in robots}
        count = Counter("as is" if n == 0 else "after" if n > 0 else "refused" for n, _ in found.values())
        print(
            f"{folder.name} | {len(files)} | {len(robots)} | {count['as is']} | {count['after']} | {count['refused']}"
        )
        for number, said in found.values():
            if number < 0:
                print(f"    {said.replace(f'{folder}/', '')}")
            elif number > 0 and "-v" in sys.argv:
                print(f"    read after: {said}")


if __name__ == "__main__":
    main()
