"""Extended models: folders with a team and its effects or calibration, for plain MuJoCo and for trials."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.arrays import Array
from estimator.calibrate.calibration import Calibration, Carried, carried
from estimator.errors import InputError
from estimator.files import holds, whole_folder
from estimator.inputs import JSON_BYTES, read_input
from estimator.strict import Fields, parse_json
from mocobot_sim.effects import Effect, apply_effects, effect_from_dict, effect_to_dict
from mocobot_sim.effects.base import PLACE
from mocobot_sim.effects.geometry import BaseTilt
from mocobot_sim.model_check import ASSETS, check_model, owned
from mocobot_sim.scene.as_built import AsBuilt, SensorEffects, unit_in, units_as_built
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.payload import nearest_inertia, payload_mjcf
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.scene.team_index import TeamIndex

POSE = ("position_m", "quaternion_wxyz")


def poses_to_list(poses: RigidTransform) -> list[dict[str, list[float]]]:
    """Convert poses to JSON objects with position [m] and unit quaternion (w first)."""
    quats = poses.rotation.as_quat(scalar_first=True)
    return [
        dict(zip(POSE, (p.tolist(), q.tolist()), strict=True))
        for p, q in zip(poses.translation, quats, strict=True)
    ]


def read_poses(read: Fields, key: str, count: int) -> RigidTransform:
    """Read poses in the form of ``poses_to_list``.

    Args:
        read: the object that contains the list.
        key: key of the list.
        count: required number of poses.

    Raises:
        InputError: the number of poses is wrong, or an entry is not a pose.
    """
    positions, quats = [], []
    for i, entry in enumerate(read.list(key, count), start=1):
        pose = Fields(entry, POSE, f"{read.where}: {key}[{i}]")
        positions.append(pose.array("position_m", (3,)))
        quats.append(pose.array("quaternion_wxyz", (4,)))
        if abs(np.linalg.norm(quats[-1]) - 1.0) > 1e-6:
            raise InputError(f"{pose.where}: quaternion_wxyz has not length 1; it must have")
    return RigidTransform.from_components(np.array(positions), Rotation.from_quat(quats, scalar_first=True))


def readme(effects: Sequence[Mapping[str, Any]], robots: int, healthy: int = 0) -> str:
    """Write the README of an extended model in Markdown.

    Args:
        effects: effects in the form of ``effect_to_dict``.
        robots: number of robots.
        healthy: how many effects at the end belong to parts whose deviations are within tolerance.
    """
    named = len(effects) - healthy
    table = _table(effects[:named])
    if healthy:
        table = table if named else "No cause was named."
        rest = _table(effects[named:])
        table = f"{table}\n\nEvery other part is as far off as it was found, within its tolerance:\n\n{rest}"
    many = "1 Omnid" if robots == 1 else f"{robots} Omnids"
    return f"""# Extended model

A team of {many} and its payload in MuJoCo, with these effects built in:

{table}

- `team.xml`: the scene, complete. `mujoco.MjModel.from_xml_path("team.xml")` or MuJoCo's viewer loads it. What MJCF
  cannot express is not in it: zeros and play of encoders, torque zeros, sensor timing, pushes, laws, a payload whose
  mass changes, friction that gives way before it slips (`presliding_...` above 0).
- `effects.json`: all numbers, those included.

Simulate a trial with it:

    mocobot simulate --model . --trajectory random --out trial.parquet

From Python: `mocobot_sim.extended.extended.load_extended(folder)`, then `mocobot_sim.trial.trial.run_trial` or
`mocobot_sim.trial.resimulate.resimulate`.
"""


def _table(effects: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for effect in effects:
        place = ", ".join(f"{name} {effect[name]}" for name in PLACE if name in effect) or "payload"
        numbers = ", ".join(
            f"`{name}` = {value if isinstance(value, str) else f'{value:.6g}'}"
            for name, value in effect["parameters"].items()
        )
        rows.append(f"| `{effect['cause']}` | {place} | {numbers} |")
    return "\n".join(["| cause | where | parameters |", "|---|---|---|", *rows]) if rows else "None."


FORMAT = "mocobot-extended-model"
VERSION = 1
SCENE, NUMBERS, README = "team.xml", "effects.json", "README.md"
AS_BUILT, SENSORS = (tuple(entry.name for entry in fields(kind)) for kind in (AsBuilt, SensorEffects))
MASSES = ("proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio")
"""Optional keys of a unit: older folders lack them, and the masses are then those of the design."""
INITIAL = ("phi_rad", "theta_rad")
KEYS = (
    "format", "version", "robots", "effects", "wrist_home_b_m", "theta_home_rad", "grasps", "mounts", "initial",
    "as_built", "sensors", "grasp_slack_m", "grasp_slack_rad", "extra",
)  # fmt: skip


def write_extended(
    scene: TeamScene, effects: Sequence[Effect], folder: Path, extra: dict[str, Any],
    healthy: Sequence[Effect] = (),
) -> None:  # fmt: skip
    """Write a scene with effects as an extended model; the folder appears complete or not at all.

    Args:
        scene: scene returned by ``apply_effects``.
        effects: effects in the scene that are named as causes.
        folder: folder to create; an existing extended model is replaced.
        extra: JSON values to store with the model.
        healthy: other effects in the scene, of parts whose deviations are within tolerance; the README lists them
            separately.

    Raises:
        InputError: the folder exists and is not an extended model, it cannot be written, ``extra`` is not plain JSON,
            or there is no payload.
    """
    if not scene.carries:
        raise InputError(f"{folder}: the robots hold nothing; an extended model carries a payload")
    values: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "robots": scene.robots,
        "effects": [effect_to_dict(effect) for effect in (*effects, *healthy)],
        "wrist_home_b_m": scene.wrist_home_b.tolist(),
        "theta_home_rad": scene.theta_home.tolist(),
        "grasps": poses_to_list(scene.X_1i),
        "mounts": poses_to_list(scene.mounts),
        "initial": scene.initial
        and {k: np.asarray(q, dtype=float).tolist() for k, q in zip(INITIAL, scene.initial, strict=True)},
        "as_built": [unit.to_dict() for unit in scene.units],
        "sensors": {name: list(scene.sensors.of(name, scene.robots)) for name in SENSORS},
        "grasp_slack_m": list(scene.grasp_slack_m or (0.0,) * scene.robots),
        "grasp_slack_rad": list(scene.grasp_slack_rad or (0.0,) * scene.robots),
        "extra": extra,
    }
    try:
        text = json.dumps(values, indent=1, allow_nan=False) + "\n"
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{folder}: what is to be kept cannot be written as JSON ({error})") from error
    assets = scene.root.get_assets() if scene.xml is None else scene.assets
    page = readme(values["effects"], scene.robots, len(healthy))
    files = {SCENE: scene.to_xml().encode(), NUMBERS: text.encode(), README: page.encode(), **assets}
    folder = Path(folder)
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir()) and not holds("extended")(folder)):
        raise InputError(f"{folder}: exists and is not an extended model; name a new folder")
    try:
        with whole_folder(folder, "extended") as temporary:
            for name, content in files.items():
                (temporary / name).write_bytes(content)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from error


def load_extended(folder: Path) -> TeamScene:
    """Read an extended model; its scene simulates like the original, but accepts no further effects.

    Raises:
        InputError: a file is missing or cannot be read; a key is unknown, missing or has an invalid value; or the
            MJCF does not match the numbers.
    """
    folder = Path(folder)
    where = str(folder / NUMBERS)
    values = parse_json(_read(folder / NUMBERS), where)
    if values.get("format") != FORMAT or values.get("version") != VERSION or type(values["version"]) is bool:
        raise InputError(
            f"{where}: format and version are {values.get('format')!r:.60} and {values.get('version')!r:.60}; "
            f"this program reads {FORMAT!r} {VERSION}"
        )
    read = _fields(values, where)
    robots = read.whole("robots")
    listed = read.list("effects")
    try:
        effects = tuple(effect_from_dict(entry) for entry in listed)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    wrist, theta = (read.array(key, (robots, 3)) for key in ("wrist_home_b_m", "theta_home_rad"))
    grasps = read_poses(read, "grasps", robots)
    required = [name for name in AS_BUILT if name not in MASSES]
    entries = enumerate(read.list("as_built", robots), start=1)
    units = [Fields(entry, required, f"{where}: as_built[{i}]", MASSES) for i, entry in entries]
    initial = None
    if read.values["initial"] is not None:
        inner = read.within("initial", INITIAL)
        initial = inner.array(INITIAL[0], (robots, 3)), inner.array(INITIAL[1], (robots, 3))
    sensors = read.within("sensors", SENSORS)

    def per_robot(part: Fields, name: str) -> tuple[float, ...]:
        return tuple(part.array(name, (robots,)).tolist())

    assets = {
        path.name: path.read_bytes()
        for path in sorted(folder.iterdir())
        if path.is_file() and path.suffix.lower() in ASSETS and owned(path, folder, ASSETS)
    }
    scene = TeamScene(
        root=None,
        robots=robots,
        wrist_home_b=wrist,
        theta_home=theta,
        X_1i=grasps,
        units=tuple(unit_in(unit) for unit in units),
        mounts=read_poses(read, "mounts", robots),
        initial=initial,
        sensors=SensorEffects(**{name: per_robot(sensors, name) for name in SENSORS}),
        grasp_slack_m=per_robot(read, "grasp_slack_m"),
        grasp_slack_rad=per_robot(read, "grasp_slack_rad"),
        effects=effects,
        xml=_read(folder / SCENE),
        assets=assets,
    )
    read.object("extra")
    check_model(folder / SCENE)
    _check_model(scene, folder / SCENE)
    return scene


def extra_of(folder: Path) -> dict[str, Any]:
    """Read the extra values that were stored with an extended model.

    Raises:
        InputError: the file cannot be read.
    """
    path = Path(folder) / NUMBERS
    return _fields(parse_json(_read(path), str(path)), str(path)).object("extra")


def _fields(values: dict[str, Any], where: str) -> Fields:
    """Check the keys of the numbers; older models lack ``grasp_slack_rad``, which is then zero."""
    slack_m = values.get("grasp_slack_m")
    if isinstance(slack_m, list):
        values = {"grasp_slack_rad": [0.0] * len(slack_m), **values}
    return Fields(values, KEYS, where)


def _read(path: Path) -> str:
    try:
        return read_input(path, JSON_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        detail = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({detail}); an extended model has this file") from error


def _check_model(scene: TeamScene, path: Path) -> None:
    try:
        index = TeamIndex.of(scene.compile())
    except (InputError, KeyError) as error:
        text = " ".join(str(error).strip("\"'").split())
        raise InputError(f"{path}: not the MJCF of a team ({text})") from error
    if index.robots != scene.robots:
        raise InputError(f"{path}: has {index.robots} robots; {NUMBERS} says {scene.robots}")


NOISE = 4.0
"""Largest correction of a principal moment, in standard errors, that makes an inertia physical. Chosen."""
LEAST_MOMENT_RATIO = 1e-3
"""Smallest over largest principal moment of a calibrated payload. Chosen."""


def calibrated_team(
    calibration: Calibration, payload: int = 0, initial: tuple[Array, Array] | None = None
) -> TeamScene:
    """Build the calibrated team with the base poses of the first recording of a payload.

    Args:
        calibration: result of the calibration.
        payload: index of the payload, from 0.
        initial: true (phi, theta) near which trials start [rad], two arrays (N, 3); None for home.

    Raises:
        InputError: the robots have another design, there is no recording of the payload, or no rigid body has its mass
            and inertia.
    """
    if calibration.design != omnid_design():
        raise InputError("the calibrated robots are of another design than the simulated Omnid")
    trial = next((t for t in calibration.trials if t.payload == payload and t.bases is not None), None)
    if trial is None or trial.bases is None:
        raise InputError(f"the calibration has no recording of a payload number {payload + 1}")
    held = calibration.payloads[payload]
    found, grasps = carried(held, calibration.scale_sd), held.grasps
    X_1i = RigidTransform.from_components(grasps.p_1i, Rotation.from_matrix(grasps.R_1i))
    tilts = [
        BaseTilt(robot, *map(float, tilt))
        for robot, tilt in enumerate(calibration.units.of("tilt"), start=1)
        if tilt.any()
    ]
    p = trial.bases.p.copy()
    for tilt in tilts:  # the tilt is about the mount, below {b}
        p[tilt.robot - 1] -= trial.bases.R[tilt.robot - 1] @ tilt.base_shift()
    scene = build_team(
        payload_mjcf(found.mass_kg, found.p_1c, _of_a_body(found), X_1i),
        units_as_built(calibration.units),
        mounts=RigidTransform.from_components(
            p - [0.0, 0.0, float(np.min(p[:, 2]))], Rotation.from_matrix(trial.bases.R)
        ),
        initial=initial,
    )
    return apply_effects(scene, tilts)


def _of_a_body(found: Carried) -> Array:
    """Replace an inertia by the nearest physical one, if the change is within its uncertainty; else return it as is.

    Noise can make the fitted inertia of a flat body unphysical.
    """
    inertia = 0.5 * (found.inertia + found.inertia.T)
    nearest = nearest_inertia(inertia, LEAST_MOMENT_RATIO)
    moved = np.abs(np.linalg.eigvalsh(nearest) - found.principal.moments)
    return nearest if np.all(moved <= NOISE * found.principal.moments_se) else inertia


def write_calibrated(
    calibration: Calibration, folder: Path, payload: int = 0, initial: tuple[Array, Array] | None = None
) -> None:
    """Write the calibrated team as an extended model for ``mocobot simulate --model``.

    Arguments are as in ``calibrated_team``.

    Raises:
        InputError: as in ``calibrated_team``, or the folder cannot be written.
    """
    scene = calibrated_team(calibration, payload, initial)
    label = calibration.payloads[payload].label
    write_extended(scene, scene.effects, folder, {"calibrated": True, "payload": label})
