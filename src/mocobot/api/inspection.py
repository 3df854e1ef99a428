"""Inspect a log of a team or of a single robot before its numbers are used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimator.arm.design import load_design
from estimator.files import write_json
from mocobot.api.recordings import Robots, quiet
from mocobot.option_types import made
from mocobot.options import InspectOptions
from mocobot.results import public
from mocobot_inspect import joints, team
from mocobot_inspect.findings import Finding, findings
from mocobot_inspect.joint_wiring import Robot
from mocobot_inspect.report import format_inspection, inspection_dict, ready_line
from mocobot_logs.maps import read_map
from mocobot_logs.open_log import open_log
from mocobot_sim.scene.models import omnid_design

if TYPE_CHECKING:
    from mocobot.api.joints import GivenModel


class Look:
    """Base class of inspections: text report, readiness and JSON."""

    name: str

    @property
    def _whole(self) -> Any:
        return self  # an inspection of a team or of joints, which a mixin cannot know

    @property
    def findings(self) -> list[Finding]:
        """All faults found, each with ``topic`` and ``sentence``."""
        return findings(self._whole)

    @property
    def ready_for(self) -> str:
        """What the log can be used for, on one line."""
        return ready_line(self._whole)

    @property
    def is_ready(self) -> bool:
        """Whether the log can be used for anything."""
        return not self.ready_for.startswith("ready for: nothing")

    def __str__(self) -> str:
        """Return the text report."""
        return format_inspection(self._whole)

    def __repr__(self) -> str:
        """Return a one-line summary."""
        return f"<{type(self).__name__} of {self.name}: {self.ready_for}>"

    def to_dict(self) -> dict[str, Any]:
        """Return strict JSON values with units in the keys."""
        return inspection_dict(self._whole)

    def write(self, path: Path | str) -> None:
        """Write the inspection as JSON.

        Raises:
            InputError: the file cannot be written.
        """
        write_json(Path(path), self.to_dict())


@dataclass(frozen=True, eq=False, repr=False)
class Inspection(Look, team.Inspection):
    """Time stamps, channels, clocks, wiring and excitation of a team's log; shows as a table in a notebook.

    The attributes are those of ``mocobot_inspect.team.Inspection``; ``mocobot_inspect.report`` documents the JSON.
    """

    @property
    def is_ready(self) -> bool:
        """Whether the log can be used for anything, once the required steps are done."""
        return super().is_ready and " yes" in self.ready_for

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import inspection_html

        return inspection_html(self.to_dict())


@dataclass(frozen=True, eq=False, repr=False)
class JointInspection(Look, joints.JointInspection):
    """Time stamps, columns, signs, order, units and delays of a joint log, checked against the robot's model.

    The attributes are those of ``mocobot_inspect.joints.JointInspection``; ``mocobot_inspect.report`` documents the
    JSON.
    """


def inspect(
    log: Path | str,
    model: GivenModel | None = None,
    options: InspectOptions | None = None,
    *,
    advance: Callable[[int], object] = quiet,
    tried: Callable[[int], object] = quiet,
    **fields: Any,
) -> Inspection | JointInspection:
    """Inspect a log; faults in its samples are reported and raise no error.

    Args:
        log: recording, or log in any format that ``convert`` reads.
        model: model of a single robot whose joints were logged, or path of its file; None for a team.
        options: options of the inspection; ``fields`` replace its fields.
        advance: called with the progress of reading since the last call, in units that depend on the log's format.
        tried: called with the number of wiring mistakes tested since the last call.

    Raises:
        InputError: the log, model, map, design or calibration cannot be read, or does not fit the log.
    """
    chosen = made(InspectOptions, options, fields)
    chosen.check_for(model)
    if model is not None:
        return _inspect_joints(Path(log), model, chosen, advance, tried)
    robots, given = Robots(chosen.calibration), chosen.design
    log_map = read_map(str(chosen.map)) if chosen.map is not None else None
    design = load_design(Path(given)) if isinstance(given, Path | str) else given or omnid_design()
    source = open_log(Path(log), log_map, chosen.episode)
    units = robots.units(source, design)
    trial = log_map.trial if log_map is not None else None
    return public(Inspection, team.inspect_log(source, design, advance, tried, trial, units))


def _inspect_joints(
    log: Path,
    model: GivenModel,
    chosen: InspectOptions,
    advance: Callable[[int], object],
    tried: Callable[[int], object],
) -> JointInspection:
    from discrepancy.joints.mechanics import Motion, Tree, body_regressor, inverse_torque
    from mocobot.api.joints import map_of, read_model
    from mocobot_logs.joints.read import open_joint_log

    robot = read_model(model, lock=chosen.lock, base=chosen.base)
    log_map = map_of(robot, log, chosen.map)
    source = open_joint_log(log, log_map, chosen.episode)
    tree = Tree.of(robot.model)
    known = Robot(
        robot.joints, robot.slides, robot.lower, robot.upper, robot.torque_limit,
        partial(inverse_torque, robot.model),
        lambda *motion: body_regressor(Motion.of(tree, *motion), int(tree.joint_body[tree.last_link])),
        float(tree.mass[tree.links].sum()), robot.notes,
    )  # fmt: skip
    return public(JointInspection, joints.inspect_joints(source, log_map, known, advance, tried))
