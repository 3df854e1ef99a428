"""Read logs of one robot's joints, of any format, by a map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from mocobot_logs.joints.assemble import assemble
from mocobot_logs.joints.even import even_parts
from mocobot_logs.joints.joint_log import JointLog
from mocobot_logs.joints.joint_map import JointMap, label
from mocobot_logs.joints.quantities import QUANTITIES
from mocobot_logs.joints.turns import unwrapped
from mocobot_logs.log import LogSource, Samples, collect
from mocobot_logs.open_log import open_log


def open_joint_log(path: Path | str, log_map: JointMap, episode: int | None = None) -> LogSource:
    """A log that can be read by a map.

    Args:
        path: a file or a folder of any format that ``open_log`` knows.
        log_map: where its channels are.
        episode: of a LeRobot dataset that holds several.

    Raises:
        InputError: there is no such log, or the map does not suit it.
    """
    return open_log(path, log_map.of_source(), episode)


def read_joint_log(
    source: LogSource, log_map: JointMap, advance: Callable[[int], object] = lambda _: None
) -> list[JointLog]:
    """The parts of a log between long gaps, mostly one.

    Args:
        source: the log.
        log_map: its map.
        advance: takes the progress made, in the source's units.

    Raises:
        InputError: the log is damaged, its stamps or values cannot be used, or it is too short.
    """
    return joint_logs_of(source.name, collect(source, advance).streams[0], log_map)


def joint_logs_of(name: str, samples: Samples, log_map: JointMap) -> list[JointLog]:
    """The parts of a log that is in memory.

    Args:
        name: of the log, whose last part may decide about gains.
        samples: its rows, channels in the map's order.
        log_map: its map.

    Raises:
        InputError: see ``read_joint_log``.
    """
    channels = tuple(label(*key) for key in log_map.channels)
    at = [k for k, (quantity, _) in enumerate(log_map.channels) if QUANTITIES[quantity].kind == "position"]
    positions, notes = unwrapped(samples.values[:, at], [channels[k] for k in at])
    if notes:
        values = samples.values.copy()
        values[:, at] = positions
        samples = replace(samples, values=values)
    parts = even_parts(name, channels, samples, log_map.rate_hz)
    parts = [replace(part, notes=(*notes, *part.notes)) for part in parts]
    control = log_map.control_of(Path(name).name)
    logs = [assemble(part, log_map, name, control) for part in parts]
    if len(logs) == 1:
        return logs
    return [replace(log, name=f"{log.name} (part {number})") for number, log in enumerate(logs, 1)]
