"""Extended models of serial robots: MJCF for the effects it can express, a small file for the others; rollouts."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import write_json, write_text
from estimator.strict import Fields, read_json
from mocobot_sim.model_check import ASSETS as TYPES
from mocobot_sim.model_check import owned
from mocobot_sim.serial.effects import DRY, ActingLaw, JointLaw, RobotEffect, State, dry_levels, resistances
from mocobot_sim.serial.mjcf import Built, Effect, steps, with_effects

ASSETS = "assets"


def take_along(spec: mujoco.MjSpec) -> dict[Path, str]:
    """Redirect meshes, height fields, skins and textures of a model to a folder ``assets`` beside a copy of the model.

    Args:
        spec: model as read from its file; changed. Names of missing files stay unchanged.

    Returns:
        The files to copy, each with its name in ``assets``.

    Raises:
        InputError: a file is outside the model's folder or of an unknown type (see ``owned``).
    """
    taken: dict[Path, str] = {}

    def moved(file: str, inside: str) -> str:
        # ``Path`` ignores the folders before an absolute name.
        named = Path(spec.modelfiledir, inside, Path(file).name if spec.strippath else file)
        if not file or not named.is_file():
            return file
        source = owned(named, Path(spec.modelfiledir), TYPES)
        if source not in taken:
            again = source.name in taken.values()
            taken[source] = f"{len(taken)}_{source.name}" if again else source.name
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
    """Copy the files found by ``take_along`` into the folder of the new model.

    Raises:
        OSError: a file cannot be read or written.
    """
    if taken:
        (folder / ASSETS).mkdir()
        spec.modelfiledir = str(folder.resolve())  # MuJoCo reads the files from here when it writes the model
    for source, name in taken.items():
        shutil.copyfile(source, folder / ASSETS / name)


FORMAT, VERSION = "mocobot-extended-robot", 3
SCENE, NUMBERS, README = "robot.xml", "effects.json", "README.md"
KEYS = ("cause", "joint", "partner", "body", "parameters", "law", "in")
LAW = "law"
CHANGED = ", which is what has changed since the reference; what is wrong with the model in both is not in it"
LEAST_LOSS = 1e-12
"""Smallest ``frictionloss`` for which MuJoCo creates a constraint row [N m or N]. Chosen: any positive value does."""


def write_extended(
    spec: mujoco.MjSpec,
    effects: Sequence[Effect],
    folder: Path,
    recordings: Sequence[str],
    *,
    reference: bool = False,
    notes: Sequence[str] = (),
) -> None:
    """Write ``robot.xml`` with its assets, ``effects.json`` and a README into a new folder.

    Args:
        spec: the nominal model; changed.
        effects: identified effects.
        folder: folder to create.
        recordings: names of the recordings from which the effects were identified.
        reference: whether the effects are changes since reference logs; errors common to both are then not modelled.
        notes: sentences on what the nominal model has otherwise than its file.

    Raises:
        InputError: the folder cannot be written, MuJoCo rejects the effects, or a file is outside the model's folder.
    """
    inside = with_effects(spec, effects)[1]
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
    numbers = {"format": FORMAT, "version": VERSION, "causes": causes, "recordings": list(recordings)}
    write_json(folder / NUMBERS, numbers)
    write_text(folder / README, _readme(effects, places, CHANGED if reference else "", notes))


def _entry(effect: Effect) -> dict[str, Any]:
    if isinstance(effect, JointLaw):
        return asdict(RobotEffect(LAW, effect.joint)) | {"law": effect.to_dict()}
    return asdict(effect) | {"law": None}


def load_effects(folder: Path) -> list[RobotEffect | ActingLaw]:
    """Read the effects of an extended robot that are not in its MJCF, for use with ``step``.

    Laws can have a state, such as that of a backlash, so load them again for every run.

    Raises:
        InputError: ``effects.json`` cannot be read or has another format.
    """
    path = Path(folder) / NUMBERS
    values = read_json(path, "the effects of an extended robot")
    file = Fields(values, ("format", "version", "causes", "recordings"), str(path))
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
    """Simulate one time step with given motor torques and the effects that are not in the MJCF.

    Args:
        model, data: model of ``robot.xml`` and its data; ``qfrc_applied`` is overwritten.
        effects: effects from ``load_effects``.
        torque: motor torques at the joints [N m or N], shape (J,).
    """
    if not effects:
        data.qfrc_applied[:] = torque
        return mujoco.mj_step(model, data)
    before = np.array(data.qacc)
    listed = [effect for effect in effects if isinstance(effect, RobotEffect)]
    rubbing = [effect for effect in listed if effect.cause in DRY]
    _with_rows(model, data, rubbing)
    # Torques that the gears transmit: gravity, springs and link inertia, without friction and reflected inertia.
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
    """Run ``mj_step1`` so that every joint with dry friction has a friction row, even if its current value is zero."""
    own = sorted({effect.joint - 1 for effect in rubbing if effect.joint is not None})
    said = model.dof_frictionloss[own]
    model.dof_frictionloss[own] = np.maximum(said, LEAST_LOSS)
    mujoco.mj_step1(model, data)
    model.dof_frictionloss[own] = said


def _rub(data: mujoco.MjData, dry: Array) -> None:
    """Set the limits of MuJoCo's friction rows, which can stop a joint but never drive it."""
    if dry.any():
        at = np.flatnonzero(data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF))
        data.efc_frictionloss[at] = np.maximum(dry[data.efc_id[at]], 0.0)
        if data.nisland:  # the solver uses copies of the rows, ordered by island
            data.iefc_frictionloss[:] = data.efc_frictionloss[data.map_iefc2efc]


def _readme(effects: Sequence[Effect], places: Sequence[str], more: str, notes: Sequence[str]) -> str:
    rows = [
        f"| {_row(e)} | {'not simulated' if place == 'none' else f'`{place}`'} |"
        for e, place in zip(effects, places, strict=True)
    ]
    head = ["| cause | joint or body | parameters | in |", "|---|---|---|---|"]
    table = "\n".join([*head, *rows]) if rows else "None."
    read = "".join(f"\n- {note}" for note in notes)
    read = f"\nThe robot is what was read from its file, not the file:\n{read}\n" if notes else ""
    return f"""# Extended robot

The robot with these causes built in{more}:

{table}
{read}
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
    shown = {n: f"{v:.6g}" if isinstance(v, float) else v for n, v in numbers.items() if v != ""}
    each = ", ".join(f"`{name}` = {value}" for name, value in shown.items())
    return f"`{entry['cause']}` | {entry['joint'] or entry['body']} | {each}"


Drive = Callable[[float, Array, Array], Array]
"""Function from time [s], joint positions (J,) and velocities (J,) to motor torques at the joints (J,)."""
MOST_SPEED = 1e4
"""Joint speed at which a rollout is aborted [rad/s or m/s]. Chosen: over 100 times the speed of real joints."""


@dataclass(frozen=True, eq=False)
class Start:
    """Initial state of a rollout."""

    time: float  # [s]
    # joint positions, velocities and accelerations, shape (J,) each; the accelerations centre the integration and give
    # the initial load for load-dependent friction
    q: Array
    dq: Array
    ddq: Array


def rollout(built: Built, start: Start, drive: Drive, samples: int, every: int) -> Array:
    """Simulate a robot and return its joint positions, the initial ones first, shape (samples + 1, J).

    The rollout is aborted if a number is not finite or a joint is faster than ``MOST_SPEED``; the result is then
    shorter.

    Args:
        built: the robot.
        start: initial state.
        drive: motor torques.
        samples: number of samples after the initial state.
        every: integration steps per sample.
    """
    model = built.model
    data, effects = mujoco.MjData(model), built.running()
    data.time, data.qpos[:], data.qacc[:] = start.time, start.q, start.ddq
    # MuJoCo is semi-implicit: starting with the velocity half a step earlier makes the position error second order.
    data.qvel[:] = start.dq - 0.5 * model.opt.timestep * start.ddq
    out = np.empty((samples + 1, model.nq))
    out[0] = start.q
    for k in range(1, samples + 1):
        for _ in range(every):
            step(model, data, effects, drive(data.time, data.qpos, data.qvel))
            if not np.abs(data.qvel).max() < MOST_SPEED:  # also true for NaN
                return out[:k]
        out[k] = data.qpos
    return out
