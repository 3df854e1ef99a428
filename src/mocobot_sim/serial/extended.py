"""A robot with effects, to take away: MJCF for what it can express, a small file for the rest, and how to step both."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import write_json, write_text
from estimator.strict import Fields, read_json
from mocobot_sim.scene.named_files import ASSETS as TYPES
from mocobot_sim.scene.named_files import owned
from mocobot_sim.serial.built import Effect, refused, steps
from mocobot_sim.serial.effects import DRY, RobotEffect, dry_levels, resistances
from mocobot_sim.serial.law import ActingLaw, JointLaw, State
from mocobot_sim.serial.mjcf import into_mjcf

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


FORMAT, VERSION = "mocobot-extended-robot", 3
SCENE, NUMBERS, README = "robot.xml", "effects.json", "README.md"
KEYS = ("cause", "joint", "partner", "body", "parameters", "law", "in")
LAW = "law"
CHANGED = ", which is what has changed since the reference; what is wrong with the model in both is not in it"
LEAST_LOSS = 1e-12
"""Dry friction with which MuJoCo makes a row for it [N m or N]."""


def write_extended(
    spec: mujoco.MjSpec,
    effects: Sequence[Effect],
    folder: Path,
    recordings: Sequence[str],
    *,
    reference: bool = False,
) -> None:
    """Write ``robot.xml`` with the files that it needs, ``effects.json`` and a README into a new folder.

    Args:
        spec: the nominal model; changed.
        effects: what is off.
        folder: is created.
        recordings: names of those that it was found from.
        reference: whether it is what has changed since other logs, whose own errors are then in no model.

    Raises:
        InputError: the folder cannot be written, an effect makes a model that MuJoCo refuses, or a mesh or texture is
            not the model's own.
    """
    try:
        inside = [isinstance(e, RobotEffect) and into_mjcf(spec, e) for e in effects]
        spec.compile()
    except (ValueError, RuntimeError) as error:
        raise refused(error) from error
    places = [
        SCENE if said else NUMBERS if steps(e) else "none" for e, said in zip(effects, inside, strict=True)
    ]
    taken = take_along(spec)
    try:
        folder.mkdir()
        put(taken, spec, folder)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from error
    write_text(folder / SCENE, spec.to_xml())
    causes = [_entry(e) | {"in": place} for e, place in zip(effects, places, strict=True)]
    write_json(
        folder / NUMBERS,
        {"format": FORMAT, "version": VERSION, "causes": causes, "recordings": list(recordings)},
    )
    write_text(folder / README, _readme(effects, places, CHANGED if reference else ""))


def _entry(effect: Effect) -> dict[str, Any]:
    if isinstance(effect, JointLaw):
        return asdict(RobotEffect(LAW, effect.joint)) | {"law": effect.to_dict()}
    return asdict(effect) | {"law": None}


def load_effects(folder: Path) -> list[RobotEffect | ActingLaw]:
    """The effects of an extended robot that its MJCF lacks, for ``step``.

    Laws may remember what was, such as a play: load them anew for every run.

    Raises:
        InputError: ``effects.json`` cannot be read or is something else.
    """
    path = Path(folder) / NUMBERS
    file = Fields(
        read_json(path, "the effects of an extended robot"),
        ("format", "version", "causes", "recordings"),
        str(path),
    )
    if file.values["format"] != FORMAT:
        file.refuse("format", repr(FORMAT))
    if file.values["version"] != VERSION:
        file.refuse("version", f"{VERSION}: diagnose again to have the folder written by this release")
    where = f"{path}: causes"
    entries = [Fields(item, KEYS, where) for item in file.list("causes")]
    return [_effect(e, where) for e in entries if e.values["in"] == NUMBERS]


def _effect(entry: Fields, where: str) -> RobotEffect | ActingLaw:
    values = entry.values
    if values["cause"] == LAW:
        return ActingLaw(JointLaw.of_dict(values["law"], where))
    numbers = {k: float(v) for k, v in values["parameters"].items()}
    return RobotEffect(values["cause"], values["joint"], values["partner"], numbers, values["body"])


def step(
    model: mujoco.MjModel, data: mujoco.MjData, effects: Sequence[RobotEffect | ActingLaw], torque: Array
) -> None:
    """One step of a robot whose drives give some torques, with the effects that its MJCF lacks.

    Args:
        model, data: of ``robot.xml``; ``qfrc_applied`` is written.
        effects: of ``load_effects``.
        torque: at the joints, shape (J,).
    """
    if not effects:
        data.qfrc_applied[:] = torque
        return mujoco.mj_step(model, data)
    before = np.array(data.qacc)
    listed = [effect for effect in effects if isinstance(effect, RobotEffect)]
    rubbing = [effect for effect in listed if effect.cause in DRY]
    _with_rows(model, data, rubbing)
    # What the gears pass on: gravity, springs and the bodies' inertia, but nothing that rubs, and no rotors.
    inertia = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, inertia, before)
    load = inertia - model.dof_armature * before + data.qfrc_bias - data.qfrc_spring - data.qfrc_gravcomp
    dry = model.dof_frictionloss + dry_levels(rubbing, data.qvel, load, data.time)
    taken = resistances(listed, data.qpos, data.qvel, model.dof_damping, dry)
    state = State(data.time, model.opt.timestep, data.qpos, data.qvel, before, load, torque)
    for acting in (effect for effect in effects if isinstance(effect, ActingLaw)):
        taken[acting.law.joint - 1] += acting.torque(state)
    data.qfrc_applied[:] = torque - taken
    _rub(data, dry)
    mujoco.mj_step2(model, data)


def _with_rows(model: mujoco.MjModel, data: mujoco.MjData, rubbing: Sequence[RobotEffect]) -> None:
    """``mj_step1`` with a row of MuJoCo's dry friction for every joint that rubs, of whatever size."""
    own = sorted({effect.joint - 1 for effect in rubbing if effect.joint is not None})
    said = model.dof_frictionloss[own]
    model.dof_frictionloss[own] = np.maximum(said, LEAST_LOSS)
    mujoco.mj_step1(model, data)
    model.dof_frictionloss[own] = said


def _rub(data: mujoco.MjData, dry: Array) -> None:
    """Dry friction in MuJoCo's own rows: it stops a joint and never drives it."""
    if dry.any():
        at = np.flatnonzero(data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF))
        data.efc_frictionloss[at] = np.maximum(dry[data.efc_id[at]], 0.0)
        if data.nisland:  # each is solved from a copy
            data.iefc_frictionloss[:] = data.efc_frictionloss[data.map_iefc2efc]


def _readme(effects: Sequence[Effect], places: Sequence[str], more: str) -> str:
    rows = [
        f"| {_row(e)} | {'not simulated' if place == 'none' else f'`{place}`'} |"
        for e, place in zip(effects, places, strict=True)
    ]
    table = (
        "\n".join(["| cause | joint or body | parameters | in |", "|---|---|---|---|", *rows])
        if rows
        else "None."
    )
    return f"""# Extended robot

The robot with these causes built in{more}:

{table}

- `{SCENE}`: loads in plain MuJoCo. A payload's inertia is the nearest to the fitted one that a body can have.
- `{NUMBERS}`: all numbers, those included that MJCF cannot say. What is said to be simulated nowhere is an error of the
  log, such as the scale of a torque, or passed.

One step with all of it, from torques at the joints:

    import mujoco
    from mocobot_sim.serial.extended import load_effects, step
    model = mujoco.MjModel.from_xml_path("{SCENE}")
    data, effects = mujoco.MjData(model), load_effects(".")
    step(model, data, effects, torque)
"""


def _row(effect: Effect) -> str:
    entry = _entry(effect)
    numbers = entry["law"] or entry["parameters"]
    each = (
        f"`{n}` = {v:.6g}" if isinstance(v, float) else f"`{n}` = {v}" for n, v in numbers.items() if v != ""
    )
    return f"`{entry['cause']}` | {entry['joint'] or entry['body']} | {', '.join(each)}"
