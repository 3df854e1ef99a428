"""Look at a log before anyone trusts a number of it: of a team, or of one robot's joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from estimator.arm.design import load_design
from estimator.files import write_json
from mocobot.api.recordings import Robots, quiet
from mocobot.options import InspectOptions, made
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
    """Printable, in a terminal and as JSON."""

    name: str

    @property
    def _whole(self) -> Any:
        return self  # an inspection of a team or of joints, which a mixin cannot know

    @property
    def findings(self) -> list[Finding]:
        """All that is wrong: ``topic`` and ``sentence`` each."""
        return findings(self._whole)

    @property
    def ready_for(self) -> str:
        """What the log can be used for, one line."""
        return ready_line(self._whole)

    @property
    def is_ready(self) -> bool:
        """Whether it can be used for anything."""
        return not self.ready_for.startswith("ready for: nothing")

    def __str__(self) -> str:
        """The text report."""
        return format_inspection(self._whole)

    def __repr__(self) -> str:
        """One line."""
        return f"<{type(self).__name__} of {self.name}: {self.ready_for}>"

    def to_dict(self) -> dict[str, Any]:
        """Strict JSON with units in the keys."""
        return inspection_dict(self._whole)

    def write(self, path: Path | str) -> None:
        """Write it as JSON.

        Raises:
            InputError: the file cannot be written.
        """
        write_json(Path(path), self.to_dict())


@dataclass(frozen=True, eq=False, repr=False)
class Inspection(Look, team.Inspection):
    """Stamps, channels, clocks, wiring and excitation of a log: printable, and a table in a notebook.

    The attributes are those of ``mocobot_inspect.team.Inspection``; ``mocobot_inspect.report`` has the JSON's keys.
    """

    @property
    def is_ready(self) -> bool:
        """Whether it can be used for anything, after what must be done first."""
        return super().is_ready and " yes" in self.ready_for

    def _repr_html_(self) -> str:
        from mocobot.api.notebook import inspection_html

        return inspection_html(self.to_dict())


@dataclass(frozen=True, eq=False, repr=False)
class JointInspection(Look, joints.JointInspection):
    """Stamps, columns, signs, order, units and delays of a joint log, judged by the robot's model: printable.

    The attributes are those of ``mocobot_inspect.joints.JointInspection``; ``mocobot_inspect.report`` has the JSON's
    keys.
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
    """Look at a log; whatever is wrong with its samples is reported and not refused.

    Args:
        log: a recording, or a log of any format that ``convert`` reads.
        model: of one robot whose joints were logged, or its file; None for a team.
        options: how; ``fields`` are fields of it.
        advance: takes the progress made in reading, in the log's units.
        tried: takes the number of mistakes tried.

    Raises:
        InputError: the log, model, map, design or calibration cannot be read, or does not suit the log.
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

    robot = read_model(model)
    log_map = map_of(robot, log, chosen.map)
    source = open_joint_log(log, log_map, chosen.episode)
    tree = Tree.of(robot.model)
    known = Robot(
        robot.joints, robot.slides, robot.lower, robot.upper, robot.torque_limit,
        partial(inverse_torque, robot.model),
        lambda *motion: body_regressor(Motion.of(tree, *motion), int(tree.joint_body[tree.last_link])),
        float(tree.mass[tree.links].sum()),
    )  # fmt: skip
    return public(JointInspection, joints.inspect_joints(source, log_map, known, advance, tried))
