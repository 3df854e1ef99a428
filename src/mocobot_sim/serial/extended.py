"""A robot with effects, to take away: MJCF for what it can express, a small file for the rest, and how to step both."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import write_json, write_text
from estimator.strict import Fields, read_json
from mocobot_sim.serial.effects import LAWS, RobotEffect, resistances
from mocobot_sim.serial.mjcf import into_mjcf

FORMAT, VERSION = "mocobot-extended-robot", 1
SCENE, NUMBERS, README = "robot.xml", "effects.json", "README.md"
KEYS = ("cause", "joint", "partner", "parameters", "in")


def write_extended(
    spec: mujoco.MjSpec, effects: Sequence[RobotEffect], folder: Path, recordings: Sequence[str]
) -> None:
    """Write ``robot.xml``, ``effects.json`` and a README into a new folder.

    Args:
        spec: the nominal model; changed.
        effects: what is off.
        folder: is created.
        recordings: names of those that it was found from.

    Raises:
        InputError: the folder cannot be written, or an effect makes a model that MuJoCo refuses.
    """
    try:
        inside = [into_mjcf(spec, effect) for effect in effects]
        spec.compile()
        text = spec.to_xml()
    except (ValueError, RuntimeError) as error:
        raise InputError(
            f"MuJoCo refuses the model with the causes in it ({' '.join(str(error).split())})"
        ) from error
    places = [
        SCENE if said else NUMBERS if e.cause in LAWS else "none"
        for e, said in zip(effects, inside, strict=True)
    ]
    try:
        folder.mkdir()
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from error
    write_text(folder / SCENE, text)
    causes = [
        {
            "cause": e.cause,
            "joint": e.joint,
            "partner": e.partner,
            "parameters": dict(e.parameters),
            "in": place,
        }
        for e, place in zip(effects, places, strict=True)
    ]
    write_json(
        folder / NUMBERS,
        {"format": FORMAT, "version": VERSION, "causes": causes, "recordings": list(recordings)},
    )
    write_text(folder / README, _readme(effects, places))


def load_effects(folder: Path) -> list[RobotEffect]:
    """The effects of an extended robot that its MJCF lacks, for ``step``.

    Raises:
        InputError: ``effects.json`` cannot be read or is something else.
    """
    path = Path(folder) / NUMBERS
    file = Fields(
        read_json(path, "the effects of an extended robot"),
        ("format", "version", "causes", "recordings"),
        str(path),
    )
    if (file.values["format"], file.values["version"]) != (FORMAT, VERSION):
        file.refuse("format", f"{FORMAT!r}, with version {VERSION}")
    entries = [Fields(item, KEYS, f"{path}: causes") for item in file.list("causes")]
    return [
        RobotEffect(
            e.values["cause"],
            e.values["joint"],
            e.values["partner"],
            {k: float(v) for k, v in e.values["parameters"].items()},
        )
        for e in entries
        if e.values["in"] == NUMBERS
    ]


def step(model: mujoco.MjModel, data: mujoco.MjData, effects: Sequence[RobotEffect], torque: Array) -> None:
    """One step of a robot whose drives give some torques, with the effects that its MJCF lacks.

    Args:
        model, data: of ``robot.xml``; ``qfrc_applied`` is written.
        effects: of ``load_effects``.
        torque: at the joints, shape (J,).
    """
    mujoco.mj_step1(model, data)
    load = np.array(data.qfrc_bias) - np.array(data.qfrc_passive)
    data.qfrc_applied[:] = torque - resistances(list(effects), data.qpos, data.qvel, load)
    mujoco.mj_step2(model, data)


def _readme(effects: Sequence[RobotEffect], places: Sequence[str]) -> str:
    rows = [
        f"| `{e.cause}` | {'' if e.joint is None else e.joint} | "
        f"{', '.join(f'`{n}` = {v:.6g}' for n, v in e.parameters.items())} | "
        f"{'not simulated' if place == 'none' else f'`{place}`'} |"
        for e, place in zip(effects, places, strict=True)
    ]
    table = (
        "\n".join(["| cause | joint | parameters | in |", "|---|---|---|---|", *rows]) if rows else "None."
    )
    return f"""# Extended robot

The robot with these causes built in:

{table}

- `{SCENE}`: loads in plain MuJoCo.
- `{NUMBERS}`: all numbers, those included that MJCF cannot say. What is said to be simulated nowhere is an error of the
  log, such as the scale of a torque, or passed.

One step with all of it, from torques at the joints:

    import mujoco
    from mocobot_sim.serial.extended import load_effects, step
    model = mujoco.MjModel.from_xml_path("{SCENE}")
    data, effects = mujoco.MjData(model), load_effects(".")
    step(model, data, effects, torque)
"""
