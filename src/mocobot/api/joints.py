"""Model of a single robot (MJCF or URDF), and logs of its joints in the units and order of the model."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from discrepancy.joints.locking import Lock
from discrepancy.joints.model import SerialModel, load_model
from estimator.errors import InputError
from mocobot.api.recordings import quiet
from mocobot_logs.formats import log_kind
from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.joints.joint_map import JointMap, read_joint_map
from mocobot_logs.joints.read import open_joint_log, read_joint_log
from mocobot_logs.table.parquet import episodes_of

MAP = "log.toml"
"""Name of the default map, searched beside the log and then beside the model."""
GivenModel = SerialModel | Path | str
GivenLogs = Path | str | JointLog | Iterable[Path | str | JointLog]


def read_model(given: GivenModel, *, lock: Lock = (), base: str | None = None) -> SerialModel:
    """Read a fixed-base tree of hinges and slides from MJCF or URDF; a model that is already read is returned.

    Args:
        given: the file, or a model.
        lock: joints that do not move: ``{"wrist": 0.5}`` [rad or m], or texts such as ``["wrist=30deg"]``.
        base: name of the body whose subtree is the arm; its parent is fixed to the world.

    Raises:
        InputError: MuJoCo cannot read the file; the model or its part is no such tree; or it is already read.
    """
    if not isinstance(given, SerialModel):
        return load_model(given, lock, base)
    if lock or base is not None:
        raise InputError(f"{given.path} is already read; name lock and base when you read it")
    return given


def read_logs(
    logs: GivenLogs,
    model: GivenModel,
    *,
    map: Path | str | None = None,
    episode: int | None = None,
    advance: Callable[[int], object] = quiet,
) -> list[JointLog]:
    """Read joint logs in the units and order of the model's joints; long gaps split a log into several.

    Every episode of a LeRobot dataset is a log.

    Args:
        logs: files in any format that ``convert`` reads, or logs that are already read.
        model: robot, or path of its file.
        map: map file (docs/serial/guide.md); default: ``log.toml`` beside the log or the model.
        episode: the only episode of a LeRobot dataset to read; None for all.
        advance: called with 1 after every file.

    Raises:
        InputError: a file or the map cannot be read, or does not fit the model.
    """
    robot = read_model(model)
    found: list[JointLog] = []
    for log in [logs] if isinstance(logs, Path | str | JointLog) else logs:
        if isinstance(log, JointLog):
            if log.joints != robot.joints:
                raise InputError(f"{log.name}: its joints are not those of {robot.path}")
            found.append(log)
            continue
        log_map, every = map_of(robot, Path(log), map), [episode]
        if episode is None and log_kind(Path(log)) == "lerobot":
            every = [*episodes_of(Path(log))]
        for each in every:
            read = read_joint_log(open_joint_log(log, log_map, each), log_map)
            several = f" (episode {each})" if len(every) > 1 else ""
            found += [replace(part, name=part.name.replace(str(log), f"{log}{several}", 1)) for part in read]
        advance(1)
    return found


def map_path(model: SerialModel, log: Path, given: Path | str | None) -> Path:
    """Find the map file of a log.

    Raises:
        InputError: no map is given, and there is no ``log.toml`` beside the log or the model.
    """
    if given is not None:
        return Path(given)
    for beside in (log.parent / MAP, model.path.parent / MAP):
        if beside.is_file():
            return beside
    raise InputError(
        f"{log}: no map was given (--map), and there is no {MAP} beside it or beside {model.path}; draft one with "
        + shlex.join(["mocobot", "map", *map(str, (log, "--model", model.path, "--out", log.parent / MAP))])
    )


def map_of(model: SerialModel, log: Path, given: Path | str | None) -> JointMap:
    """Read the map of a log; see ``map_path`` for its file."""
    return read_joint_map(map_path(model, log, given), model.joints, [bool(s) for s in model.slides])
