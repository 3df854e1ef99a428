"""What commands read besides logs: a small good file of every kind, and what reads it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mocobot
from discrepancy.joints.model import load_model
from discrepancy.team.causes import read_tolerances
from estimator.errors import InputError
from mocobot.api.comparison import compare
from mocobot.cli import with_config
from mocobot_logs.joints.parse import read_joint_map
from mocobot_sim.effects.catalogue import EXAMPLE, parse_effect
from mocobot_sim.scene.as_built import read_units
from mocobot_sim.scene.payload import grasp_frames, load_payload

MODELS = Path(__file__).parents[2] / "models"
OPTIONS = '[simulate]\npayload = "b"\ntrajectory = "random"\nvias = 4\neffect = ["sea_bias:robot=1,joint=2,bias=0.1"]\n'
TOLERANCES = (
    "[sea_bias]\nbias_Nm = 0.02\n\n[link_length]\nproximal_m = 1e-3\nrod_m = 1e-3\nbase_radius_m = 1e-3\n"
)


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        name: of the good one.
        write: puts it at a path.
        read: reads it as a command does.
    """

    name: str
    write: Callable[[Path], object]
    read: Callable[[Path], object]


def _text(words: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(words, encoding="utf-8")


def _copy(model: str) -> Callable[[Path], object]:
    return lambda path: shutil.copyfile(MODELS / model, path)


def _estimate(path: Path) -> None:
    mocobot.estimate(mocobot.simulate("b", "static")).write(path)


def _joint_map(path: Path) -> None:
    model = load_model(MODELS / "xl330" / "xl330.xml")
    read_joint_map(path, model.joints, [bool(slide) for slide in model.slides])


def _effect(path: Path) -> None:
    """A word of the command line, which is no file: a refusal names it by itself."""
    try:
        parse_effect(path.read_bytes().decode("utf-8", "backslashreplace"))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


KINDS = {
    "units": Kind("units.json", _text(json.dumps({"as_built": [{"phi_zero_rad": [0.01, 0, 0]}, {}, {}]})), read_units),
    "options": Kind(
        "options.toml", _text(OPTIONS), lambda path: with_config(["simulate", "--config", str(path)])
    ),
    "effect": Kind("effect.txt", _text(EXAMPLE), _effect),
    "tolerances": Kind("tolerances.toml", _text(TOLERANCES), read_tolerances),
    "payload": Kind(
        "payload.xml", _copy("payload_c/payload.xml"), lambda path: grasp_frames(load_payload(path), str(path))
    ),
    "arm": Kind("arm.xml", _copy("xl330/xl330.xml"), load_model),
    "map of an arm": Kind("arm.toml", _copy("xl330/log.toml"), _joint_map),
    "estimate": Kind("estimate.json", _estimate, lambda path: compare(path, path)),
}  # fmt: skip
