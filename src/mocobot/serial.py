"""Any robot in MJCF or URDF: read logs of its joints, look at them, and find out what its model gets wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from discrepancy.joints.diagnosed import JointDiagnosed
from discrepancy.joints.mechanics.motion import Motion
from discrepancy.joints.mechanics.nominal import inverse_torque
from discrepancy.joints.mechanics.regressor import body_regressor
from discrepancy.joints.mechanics.tree import Tree
from discrepancy.joints.model import SerialModel, load_model
from discrepancy.joints.rolled.told import rolled_out
from discrepancy.joints.values import NAMES
from discrepancy.joints.verdict import judged
from discrepancy.tolerances_file import read_tolerances
from estimator.errors import InputError
from mocobot.api.diagnosis import Diagnosis
from mocobot.api.look import Look
from mocobot.api.public import public
from mocobot.checks import check_seconds
from mocobot_inspect import joints as inspection
from mocobot_inspect.findings import findings as joint_findings
from mocobot_inspect.joint_wiring import Robot
from mocobot_inspect.report import format_inspection as format_joint_inspection
from mocobot_inspect.report import inspection_dict as joint_inspection_dict
from mocobot_inspect.report import ready_line as joint_ready_line
from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.joints.joint_map import JointMap
from mocobot_logs.joints.parse import read_joint_map
from mocobot_logs.joints.read import open_joint_log, read_joint_log

__all__ = ["JointInspection", "JointLog", "SerialModel", "diagnose", "inspect", "read_logs", "read_model"]

MAP = "log.toml"
"""Name of a map that is found where nobody names one: beside the log, or beside the model."""
GivenModel = SerialModel | Path | str
GivenLogs = Path | str | JointLog | Iterable[Path | str | JointLog]


def read_model(path: Path | str) -> SerialModel:
    """A fixed-base tree of hinges and slides, MJCF or URDF.

    Raises:
        InputError: MuJoCo cannot read it, or it is of another kind.
    """
    return load_model(path)


def read_logs(
    logs: GivenLogs,
    model: GivenModel,
    *,
    map: Path | str | None = None,
    episode: int | None = None,
    advance: Callable[[int], object] = lambda _: None,
) -> list[JointLog]:
    """Logs in the units and the order of the model's joints; one with long gaps becomes several.

    Args:
        logs: files of any format that ``convert`` reads, or logs read before.
        model: the robot, or its file.
        map: map file (docs/serial/guide.md); ``log.toml`` beside the log or the model if not given.
        episode: of a LeRobot dataset that holds several.
        advance: called with 1 after every file.

    Raises:
        InputError: a file or the map cannot be read, or they do not suit the model.
    """
    robot = _model(model)
    found: list[JointLog] = []
    for log in [logs] if isinstance(logs, Path | str | JointLog) else logs:
        if isinstance(log, JointLog):
            if log.joints != robot.joints:
                raise InputError(f"{log.name}: its joints are not those of {robot.path}")
            found.append(log)
            continue
        log_map = map_of(robot, Path(log), map)
        found += read_joint_log(open_joint_log(log, log_map, episode), log_map)
        advance(1)
    return found


def map_path(model: SerialModel, log: Path, given: Path | str | None) -> Path:
    """The file of a log's map.

    Raises:
        InputError: none is given, and there is none beside the log or the model.
    """
    if given is not None:
        return Path(given)
    for beside in (log.parent / MAP, model.path.parent / MAP):
        if beside.is_file():
            return beside
    raise InputError(
        f"{log}: no map was given (--map), and there is no {MAP} beside it or beside {model.path}; `mocobot map {log} "
        f"--model {model.path}` drafts one"
    )


def map_of(model: SerialModel, log: Path, given: Path | str | None) -> JointMap:
    """The map of a log.

    Raises:
        InputError: there is none, or it cannot be read, or does not suit the model.
    """
    return read_joint_map(map_path(model, log, given), model.joints, [bool(s) for s in model.slides])


@dataclass(frozen=True, eq=False, repr=False)
class JointInspection(Look, inspection.JointInspection):
    """Stamps, columns, signs, order, units and delays of a joint log, judged by the robot's model: printable.

    The attributes are those of ``mocobot_inspect.joints.JointInspection``, the JSON's keys those of
    ``mocobot_inspect.report``.
    """

    _findings, _ready_line = joint_findings, joint_ready_line
    _text, _dict = format_joint_inspection, joint_inspection_dict


def inspect(
    log: Path | str,
    model: GivenModel,
    *,
    map: Path | str | None = None,
    episode: int | None = None,
    advance: Callable[[int], object] = lambda _: None,
    tried: Callable[[int], object] = lambda _: None,
) -> JointInspection:
    """Look at a log; whatever is wrong with its samples is reported and not refused.

    Args:
        log: a file of any format that ``convert`` reads.
        model: the robot, or its file.
        map: map file; ``log.toml`` beside the log or the model if not given.
        episode: of a LeRobot dataset that holds several.
        advance: takes the progress made in reading, in the log's units.
        tried: takes the number of mistakes tried.

    Raises:
        InputError: log, model or map cannot be read.
    """
    robot = _model(model)
    log_map = map_of(robot, Path(log), map)
    source = open_joint_log(log, log_map, episode)
    tree = Tree.of(robot.model)
    known = Robot(
        robot.joints, robot.slides, robot.lower, robot.upper, robot.torque_limit,
        partial(inverse_torque, robot.model),
        lambda *motion: body_regressor(Motion.of(tree, *motion), int(tree.joint_body[tree.last_link])),
        float(tree.mass[tree.links].sum()),
    )  # fmt: skip
    return public(JointInspection, inspection.inspect_joints(source, log_map, known, advance, tried))


def diagnose(
    model: GivenModel,
    logs: GivenLogs,
    *,
    map: Path | str | None = None,
    reference: GivenLogs = (),
    tolerances: Path | str | None = None,
    exclude: Iterable[str] = (),
    closed_loop: bool = True,
    seconds: float | None = None,
    say: Callable[[str], object] = lambda _: None,
) -> Diagnosis:
    """Find out what a robot's model gets wrong, or what changed between two days.

    Args:
        model: the robot, or its file.
        logs: of its joints; several, so that what is named can be validated.
        map: map of the logs; ``log.toml`` beside the log or the model if not given.
        reference: logs of the same robot while it was well: what is wrong with the model there, too, is no news.
        tolerances: TOML file: how far a robot may be off without that being news.
        exclude: causes not to consider.
        closed_loop: whether to roll the model out, without and with what is found.
        seconds: after which the search ends with what it has; None for its own end.
        say: takes a line about what is being done.

    Raises:
        InputError: model, logs, map, tolerances, causes or seconds that cannot be used.
    """
    check_seconds(seconds)
    robot = _model(model)
    found = diagnosed(
        robot,
        read_logs(logs, robot, map=map),
        read_logs(reference, robot, map=map),
        serial_tolerances(Path(tolerances) if tolerances is not None else None),
        tuple(exclude),
        closed_loop=closed_loop,
        seconds=seconds,
        say=say,
    )
    return Diagnosis(found)


def diagnosed(
    model: SerialModel, logs: list[JointLog], reference: list[JointLog],
    tolerances: Mapping[str, Mapping[str, float]] | None, exclude: tuple[str, ...],
    *, closed_loop: bool, seconds: float | None, say: Callable[[str], object],
) -> JointDiagnosed:  # fmt: skip
    """The verdict, with rollouts on request."""
    verdict = judged(
        model, logs, reference=reference, excluded=exclude, tolerances=tolerances, seconds=seconds, say=say
    )
    return JointDiagnosed(verdict, rolled_out(verdict, say) if closed_loop else None)


def serial_tolerances(path: Path | None) -> dict[str, dict[str, float]] | None:
    """Tolerances of the causes that a file names; the others keep their own.

    Raises:
        InputError: the file cannot be read, or names something unknown.
    """
    if path is None:
        return None
    none = {name: dict.fromkeys(names, math.nan) for name, names in NAMES.items()}
    given = {
        name: {key: x for key, x in values.items() if not math.isnan(x)}
        for name, values in read_tolerances(path, none).items()
    }
    return {name: values for name, values in given.items() if values}


def _model(given: GivenModel) -> SerialModel:
    return given if isinstance(given, SerialModel) else load_model(given)
